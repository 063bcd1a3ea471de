// Upsamples irradiance along surfaces and adds each pixel's reflection of it: joint bilateral
// upsampling (Kopf et al. 2007) by distance from the pixel's tangent plane and by normal. Then dims
// it as Bevy dims what it lights itself: by ambient occlusion and by distance fog.

#import bevy_core_pipeline::fullscreen_vertex_shader::FullscreenVertexOutput
#import bevy_pbr::pbr_deferred_types::{DEFERRED_FLAGS_FOG_ENABLED_BIT, unpack_flags, unpack_unorm4x8_}
#ifdef SCREEN_OCCLUSION
#import bevy_pbr::ssao_utils::ssao_multibounce
#endif
#import bevy_render::view::View
#import bevy_frugal_gi::gi::view::surface::{
    apparent_distance, image_size, pixel_position, plane_tolerance, representative, scattered_share, shown_at, surface_affinity, surface_normal,
}

@group(0) @binding(0) var g_buffer: texture_2d<u32>;
@group(0) @binding(1) var depth_buffer: texture_depth_2d;
@group(0) @binding(2) var<uniform> view: View;
@group(0) @binding(3) var irradiance: texture_2d<f32>;
#ifdef DISTANCE_FOG
@group(0) @binding(4) var<uniform> fog: Fog;
#endif
#ifdef SCREEN_OCCLUSION
@group(0) @binding(5) var screen_occlusion: texture_2d<f32>;
#endif

const CELL: vec2<u32> = vec2(#{CELL_WIDTH}u, #{CELL_HEIGHT}u);

fn upsample(pixel: vec2<u32>, size: vec2<u32>, position: vec3<f32>, normal: vec3<f32>) -> vec3<f32> {
    let cells = textureDimensions(irradiance);
    // Low-resolution pixels are centred at `cell * CELL + CELL / 2`.
    let coordinates = (vec2<f32>(pixel) - vec2<f32>(CELL / 2u)) / vec2<f32>(CELL);
    let corner = floor(coordinates);
    let along = coordinates - corner;
    let tolerance = plane_tolerance(apparent_distance(view.clip_from_view, distance(position, view.world_position)));
    var sum = vec3(0.0);
    var weights = 0.0;
    for (var i = 0u; i < 4u; i++) {
        let offset = vec2(i & 1u, i >> 1u);
        let cell = vec2<u32>(clamp(vec2<i32>(corner) + vec2<i32>(offset), vec2(0), vec2<i32>(cells) - 1));
        let other = shown_at(representative(cell, CELL, size), g_buffer, depth_buffer, view.viewport, view.world_from_clip);
        let shared_plane = surface_affinity(other.position - position, normal, other.normal, tolerance);
        let near = select(1.0 - along, along, offset == vec2(1u));
        let received = textureLoad(irradiance, cell, 0);
        // The small constants select the nearest low-resolution pixel where none lies on this
        // surface; those of the sky, and those whose light is not known yet, have weight 0.
        let weight = select(0.0, near.x * near.y * (shared_plane + 1e-4) + 1e-7, other.depth > 0.0 && received.a != 0.0);
        sum += weight * received.rgb;
        weights += weight;
    }
    return sum / max(weights, 1e-12);
}

#ifdef DISTANCE_FOG
/// Bevy's `GpuFog`.
struct Fog {
    color: vec4<f32>,
    directional_light_color: vec4<f32>,
    /// Linear: start and end, metres. Exponential: density in x, 1/m. Atmospheric: extinction of
    /// each channel, 1/m.
    be: vec3<f32>,
    directional_light_exponent: f32,
    bi: vec3<f32>,
    mode: u32,
}

/// Share of a surface's light that distance fog lets through: the factor of `input_color` in
/// `bevy_pbr::fog`. The fog's own light is already in the image.
fn through_fog(distance_to_eye: f32) -> vec3<f32> {
    let linear = 1.0 - clamp((fog.be.y - distance_to_eye) / (fog.be.y - fog.be.x), 0.0, 1.0);
    let depth = distance_to_eye * fog.be;
    var fogged = vec3(linear);
    fogged = select(fogged, vec3(1.0 - exp(-depth.x)), fog.mode == 2u);
    fogged = select(fogged, vec3(1.0 - exp(-depth.x * depth.x)), fog.mode == 3u);
    fogged = select(fogged, 1.0 - exp(-depth), fog.mode == 4u);
    return select(vec3(1.0), 1.0 - fogged * fog.color.a, fog.mode > 0u);
}
#endif

/// Share of indirect light that the material's occlusion texture leaves, and, where it is less,
/// the screen's ambient occlusion.
fn unoccluded(texel: vec4<u32>, pixel: vec2<u32>) -> vec3<f32> {
    let material = vec3(unpack_unorm4x8_(texel.b).b);
#ifdef SCREEN_OCCLUSION
    let base_color = pow(unpack_unorm4x8_(texel.r).rgb, vec3(2.2));
    return min(material, ssao_multibounce(textureLoad(screen_occlusion, pixel, 0).r, base_color));
#else
    return material;
#endif
}

@fragment
fn composite(in: FullscreenVertexOutput) -> @location(0) vec4<f32> {
    let size = image_size(view.viewport);
    let at = vec2<u32>(in.position.xy);
    let pixel = min(at - min(vec2<u32>(view.viewport.xy), at), size - 1u);
    let depth = textureLoad(depth_buffer, at, 0);
    if depth == 0.0 {
        return vec4(vec3(0.0), 1.0);
    }
    let texel = textureLoad(g_buffer, at, 0);
    let position = pixel_position(pixel, size, depth, view.world_from_clip);
    let normal = surface_normal(texel);
#ifdef FULL_RESOLUTION
    let received = textureLoad(irradiance, pixel, 0).rgb;
#else
    let received = upsample(pixel, size, position, normal);
#endif
    // In a parallel projection the eye is infinitely far away.
    let toward_eye = normalize(mix(view.world_position - position, view.world_from_view[2].xyz, vec3(view.clip_from_view[3].w)));
    var shown = received * unoccluded(texel, pixel) * scattered_share(texel, dot(normal, toward_eye)) * 0.31830987;
#ifdef DISTANCE_FOG
    let has_fog = (unpack_flags(texel.a) & DEFERRED_FLAGS_FOG_ENABLED_BIT) != 0u;
    shown *= select(vec3(1.0), through_fog(distance(position, view.world_position)), has_fog);
#endif
    // Alpha counts where the image shows indirect light alone.
    return vec4(shown, 1.0);
}
