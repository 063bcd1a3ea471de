// Upsamples irradiance along surfaces and adds each pixel's reflection of it: joint bilateral
// upsampling (Kopf et al. 2007) by distance from the pixel's tangent plane and by normal.

#import bevy_core_pipeline::fullscreen_vertex_shader::FullscreenVertexOutput
#import bevy_render::view::View
#import bevy_frugal_gi::gi::view::surface::{
    pixel_position, plane_tolerance, representative, scattered_share, surface_affinity, surface_normal,
}

@group(0) @binding(0) var g_buffer: texture_2d<u32>;
@group(0) @binding(1) var depth_buffer: texture_depth_2d;
@group(0) @binding(2) var<uniform> view: View;
@group(0) @binding(3) var irradiance: texture_2d<f32>;

const CELL: vec2<u32> = vec2(#{CELL_WIDTH}u, #{CELL_HEIGHT}u);

fn upsample(pixel: vec2<u32>, size: vec2<u32>, position: vec3<f32>, normal: vec3<f32>) -> vec3<f32> {
    let cells = textureDimensions(irradiance);
    // Low-resolution pixels are centred at `cell * CELL + CELL / 2`.
    let coordinates = (vec2<f32>(pixel) - vec2<f32>(CELL / 2u)) / vec2<f32>(CELL);
    let corner = floor(coordinates);
    let along = coordinates - corner;
    let tolerance = plane_tolerance(distance(position, view.world_position));
    var sum = vec3(0.0);
    var weights = 0.0;
    for (var i = 0u; i < 4u; i++) {
        let offset = vec2(i & 1u, i >> 1u);
        let cell = vec2<u32>(clamp(vec2<i32>(corner) + vec2<i32>(offset), vec2(0), vec2<i32>(cells) - 1));
        let other = representative(cell, CELL, size);
        let depth = textureLoad(depth_buffer, other, 0);
        let away = pixel_position(other, size, max(depth, 1e-30), view.world_from_clip) - position;
        let shared_plane = surface_affinity(away, normal, surface_normal(textureLoad(g_buffer, other, 0)), tolerance);
        let near = select(1.0 - along, along, offset == vec2(1u));
        // The small constants select the nearest low-resolution pixel where none lies on this
        // surface; those of the sky have weight 0.
        let weight = select(0.0, near.x * near.y * (shared_plane + 1e-4) + 1e-7, depth > 0.0);
        sum += weight * textureLoad(irradiance, cell, 0).rgb;
        weights += weight;
    }
    return sum / max(weights, 1e-12);
}

@fragment
fn composite(in: FullscreenVertexOutput) -> @location(0) vec4<f32> {
    let size = textureDimensions(g_buffer);
    let pixel = min(vec2<u32>(in.position.xy), size - 1u);
    let depth = textureLoad(depth_buffer, pixel, 0);
    if depth == 0.0 {
        return vec4(0.0);
    }
    let texel = textureLoad(g_buffer, pixel, 0);
    let position = pixel_position(pixel, size, depth, view.world_from_clip);
    let normal = surface_normal(texel);
#ifdef FULL_RESOLUTION
    let received = textureLoad(irradiance, pixel, 0).rgb;
#else
    let received = upsample(pixel, size, position, normal);
#endif
    // In a parallel projection the eye is infinitely far away.
    let toward_eye = normalize(mix(view.world_position - position, view.world_from_view[2].xyz, vec3(view.clip_from_view[3].w)));
    return vec4(received * scattered_share(texel, dot(normal, toward_eye)) * 0.31830987, 0.0);
}
