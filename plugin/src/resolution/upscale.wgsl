// Catmull-Rom upscaling in nine bilinear taps, clamped to the range of the four nearest texels so
// that edges do not ring, and sharpened where contrast is low.
//
// Sharpening follows Lottes, "FidelityFX contrast adaptive sharpening" (AMD, 2019): a negative lobe
// on the four neighbours of a texel, less of it the nearer they are to black, to white, and to each
// other's opposite. Each of the four nearest texels is sharpened by its own neighbours, and the
// changes are interpolated.

#import bevy_core_pipeline::fullscreen_vertex_shader::FullscreenVertexOutput

@group(0) @binding(0) var source_texture: texture_2d<f32>;
@group(0) @binding(1) var source_sampler: sampler;

/// Weight of the lobe on each neighbour where contrast is lowest, as a share of the texel's own:
/// 0 is none, 0.2 the most that Lottes gives. By the least error of three scales
/// (docs/results-over-time.md).
const LOBE: f32 = 0.125;

/// What sharpening changes at a texel with neighbours `north`, `west`, `east` and `south`.
fn sharpening(texel: vec4<f32>, north: vec4<f32>, west: vec4<f32>, east: vec4<f32>, south: vec4<f32>) -> vec3<f32> {
    let least = min(texel, min(min(north, south), min(west, east)));
    let most = max(texel, max(max(north, south), max(west, east)));
    // 0 beyond white, too: radiance without tone mapping stays as it is.
    let room = clamp(min(least.rgb, 1.0 - most.rgb) / max(most.rgb, vec3(1e-6)), vec3(0.0), vec3(1.0));
    // None at the edge of what a camera over another has drawn: premultiplied color must not exceed alpha.
    let lobe = -LOBE * sqrt(room) * select(0.0, 1.0, least.a >= 1.0);
    let sum = (north + south + west + east).rgb;
    return (texel.rgb + lobe * sum) / (1.0 + 4.0 * lobe) - texel.rgb;
}

fn texel(position: vec2<i32>) -> vec4<f32> {
    let last = vec2<i32>(textureDimensions(source_texture)) - 1;
    return textureLoad(source_texture, clamp(position, vec2(0), last), 0);
}

@fragment
fn upscale(in: FullscreenVertexOutput) -> @location(0) vec4<f32> {
    let size = vec2<f32>(textureDimensions(source_texture));
    let position = in.uv * size;
    let center = floor(position - 0.5) + 0.5;
    let fraction = position - center;

    // Weights of the cubic with tension ½ at −1, 0, 1 and 2; the middle two share one bilinear tap.
    let w0 = fraction * (-0.5 + fraction * (1.0 - 0.5 * fraction));
    let w1 = 1.0 + fraction * fraction * (-2.5 + 1.5 * fraction);
    let w2 = fraction * (0.5 + fraction * (2.0 - 1.5 * fraction));
    let w3 = fraction * fraction * (-0.5 + 0.5 * fraction);
    let w12 = w1 + w2;
    let tap0 = (center - 1.0) / size;
    let tap12 = (center + w2 / w12) / size;
    let tap3 = (center + 2.0) / size;

    var sum = vec4(0.0);
    sum += textureSampleLevel(source_texture, source_sampler, vec2(tap0.x, tap0.y), 0.0) * (w0.x * w0.y);
    sum += textureSampleLevel(source_texture, source_sampler, vec2(tap12.x, tap0.y), 0.0) * (w12.x * w0.y);
    sum += textureSampleLevel(source_texture, source_sampler, vec2(tap3.x, tap0.y), 0.0) * (w3.x * w0.y);
    sum += textureSampleLevel(source_texture, source_sampler, vec2(tap0.x, tap12.y), 0.0) * (w0.x * w12.y);
    sum += textureSampleLevel(source_texture, source_sampler, vec2(tap12.x, tap12.y), 0.0) * (w12.x * w12.y);
    sum += textureSampleLevel(source_texture, source_sampler, vec2(tap3.x, tap12.y), 0.0) * (w3.x * w12.y);
    sum += textureSampleLevel(source_texture, source_sampler, vec2(tap0.x, tap3.y), 0.0) * (w0.x * w3.y);
    sum += textureSampleLevel(source_texture, source_sampler, vec2(tap12.x, tap3.y), 0.0) * (w12.x * w3.y);
    sum += textureSampleLevel(source_texture, source_sampler, vec2(tap3.x, tap3.y), 0.0) * (w3.x * w3.y);

    let corner = vec2<i32>(center - 0.5);
    let a = texel(corner);
    let b = texel(corner + vec2(1, 0));
    let c = texel(corner + vec2(0, 1));
    let d = texel(corner + vec2(1, 1));
    // Alpha, too: a camera over another leaves the image under it where it has drawn nothing.
    let color = clamp(sum, min(min(a, b), min(c, d)), max(max(a, b), max(c, d)));

    let above = mix(
        sharpening(a, texel(corner + vec2(0, -1)), texel(corner + vec2(-1, 0)), b, c),
        sharpening(b, texel(corner + vec2(1, -1)), a, texel(corner + vec2(2, 0)), d),
        fraction.x,
    );
    let below = mix(
        sharpening(c, a, texel(corner + vec2(-1, 1)), d, texel(corner + vec2(0, 2))),
        sharpening(d, b, c, texel(corner + vec2(2, 1)), texel(corner + vec2(1, 2))),
        fraction.x,
    );
    return vec4(max(color.rgb + mix(above, below, fraction.y), vec3(0.0)), color.a);
}
