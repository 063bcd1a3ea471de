// Upscales a camera's image to its target: a Catmull-Rom filter in nine bilinear taps, clamped to the
// range of the four nearest texels so that edges do not ring.
#define_import_path bevy_frugal_gi::resolution::upscale

#import bevy_core_pipeline::fullscreen_vertex_shader::FullscreenVertexOutput

@group(0) @binding(0) var source_texture: texture_2d<f32>;
@group(0) @binding(1) var source_sampler: sampler;

// The texture at `position`, in texels: the middle of the first is at 0.5.
fn catmull_rom(source: texture_2d<f32>, bilinear: sampler, position: vec2<f32>) -> vec4<f32> {
    let size = vec2<f32>(textureDimensions(source));
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
    sum += textureSampleLevel(source, bilinear, vec2(tap0.x, tap0.y), 0.0) * (w0.x * w0.y);
    sum += textureSampleLevel(source, bilinear, vec2(tap12.x, tap0.y), 0.0) * (w12.x * w0.y);
    sum += textureSampleLevel(source, bilinear, vec2(tap3.x, tap0.y), 0.0) * (w3.x * w0.y);
    sum += textureSampleLevel(source, bilinear, vec2(tap0.x, tap12.y), 0.0) * (w0.x * w12.y);
    sum += textureSampleLevel(source, bilinear, vec2(tap12.x, tap12.y), 0.0) * (w12.x * w12.y);
    sum += textureSampleLevel(source, bilinear, vec2(tap3.x, tap12.y), 0.0) * (w3.x * w12.y);
    sum += textureSampleLevel(source, bilinear, vec2(tap0.x, tap3.y), 0.0) * (w0.x * w3.y);
    sum += textureSampleLevel(source, bilinear, vec2(tap12.x, tap3.y), 0.0) * (w12.x * w3.y);
    sum += textureSampleLevel(source, bilinear, vec2(tap3.x, tap3.y), 0.0) * (w3.x * w3.y);

    let last = vec2<i32>(size) - 1;
    let corner = vec2<i32>(center - 0.5);
    let a = textureLoad(source, clamp(corner, vec2(0), last), 0);
    let b = textureLoad(source, clamp(corner + vec2(1, 0), vec2(0), last), 0);
    let c = textureLoad(source, clamp(corner + vec2(0, 1), vec2(0), last), 0);
    let d = textureLoad(source, clamp(corner + vec2(1, 1), vec2(0), last), 0);
    // Alpha, too: a camera over another leaves the image under it where it has drawn nothing.
    return clamp(sum, min(min(a, b), min(c, d)), max(max(a, b), max(c, d)));
}

@fragment
fn upscale(in: FullscreenVertexOutput) -> @location(0) vec4<f32> {
    let size = vec2<f32>(textureDimensions(source_texture));
    return catmull_rom(source_texture, source_sampler, in.uv * size);
}
