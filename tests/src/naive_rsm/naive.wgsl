// Dachsbacher and Stamminger 2005, "Reflective Shadow Maps": a pixel sums a few hundred texels
// around its own projection into a light's map.
//
// One draw per light, added to the image. With CUBE the map has six faces and the samples lie on
// the sphere of directions around the light; the method as published has maps of one face only.

#import bevy_core_pipeline::fullscreen_vertex_shader::FullscreenVertexOutput
#import bevy_render::view::View
#import bevy_frugal_gi::gi::texels::texels::{Texel, texel_normal}
#import bevy_frugal_gi::gi::view::surface::{Surface, read_surface, scattered_share}

struct Face {
    clip_from_world: mat4x4<f32>,
    /// First texel in the store.
    texel_offset: u32,
}

struct Map {
    /// Of a cube map, ordered by viewing axis: +X, −X, +Y, −Y, +Z, −Z. Otherwise only the first is
    /// used.
    faces: array<Face, 6>,
    /// World space, metres.
    light_position: vec3<f32>,
    /// Texels along the side of a face.
    side: f32,
    /// Upper bound of the geometry term cosθ·cosθ′/d², 1/m².
    largest_geometry_term: f32,
}

@group(0) @binding(0) var g_buffer: texture_2d<u32>;
@group(0) @binding(1) var depth_buffer: texture_depth_2d;
@group(0) @binding(2) var<uniform> view: View;
@group(0) @binding(3) var<storage, read> texels: array<Texel>;
@group(0) @binding(4) var<uniform> pattern: array<vec4<f32>, #{SAMPLES}>;
@group(0) @binding(5) var<uniform> map: Map;

/// A texel and its weight, in texels.
struct Chosen {
    index: u32,
    count: f32,
}

/// Projection of a clip position onto a face, in texels from the upper left corner.
fn project_to_face(clip: vec4<f32>) -> vec2<f32> {
    // Points beside or behind the light have no projection; they are clamped to the border in their
    // direction.
    return (clip.xy / max(clip.w, 1e-4) * vec2(0.5, -0.5) + 0.5) * map.side;
}

fn index_of(face: u32, position: vec2<f32>) -> u32 {
    let texel = vec2<u32>(clamp(position, vec2(0.0), vec2(map.side - 1.0)));
    return map.faces[face].texel_offset + texel.y * u32(map.side) + texel.x;
}

#ifdef CUBE
/// Orthonormal basis whose third axis points from the light to the pixel.
fn frame_of(position: vec3<f32>) -> mat3x3<f32> {
    let from_light = position - map.light_position;
    let along = from_light * inverseSqrt(max(dot(from_light, from_light), 1e-24));
    let other = select(vec3(0.0, 1.0, 0.0), vec3(1.0, 0.0, 0.0), abs(along.y) > 0.9);
    let across = normalize(cross(other, along));
    return mat3x3(across, cross(along, across), along);
}

fn choose(sample: vec4<f32>, frame: mat3x3<f32>) -> Chosen {
    let direction = frame * sample.xyz;
    let size = abs(direction);
    let is_x = size.x >= size.y && size.x >= size.z;
    let is_y = size.y >= size.z;
    let along = select(select(direction.z, direction.y, is_y), direction.x, is_x);
    let face = select(select(4u, 2u, is_y), 0u, is_x) + select(0u, 1u, along < 0.0);
    let position = project_to_face(map.faces[face].clip_from_world * vec4(map.light_position + direction, 1.0));
    // A texel's solid angle is (2 ÷ side)² cos³θ, θ from the axis of its face.
    let cosine = max(abs(along), 0.5);
    return Chosen(index_of(face, position), sample.w * map.side * map.side * 0.25 / (cosine * cosine * cosine));
}
#else
fn frame_of(position: vec3<f32>) -> vec2<f32> {
    return clamp(project_to_face(map.faces[0].clip_from_world * vec4(position, 1.0)), vec2(0.0), vec2(map.side));
}

fn choose(sample: vec4<f32>, center: vec2<f32>) -> Chosen {
    let position = center + sample.xy * map.side;
    let is_on_map = all(position >= vec2(0.0)) && all(position < vec2(map.side));
    return Chosen(index_of(0u, position), select(0.0, sample.z * map.side * map.side, is_on_map));
}
#endif

/// Irradiance from one texel, without the factor 1/π of its cosine lobe, which the sum applies. Lux
/// · π.
fn from_texel(texel: Texel, surface: Surface) -> vec3<f32> {
    let to_texel = texel.position - surface.position;
    let inverse = 1.0 / clamp(dot(to_texel, to_texel), 1e-18, 1e38);
    let receiver = max(dot(surface.normal, to_texel), 0.0) * inverse;
    let emitter = max(-dot(texel_normal(texel), to_texel), 0.0) * inverse;
    return texel.flux * min(receiver * emitter, map.largest_geometry_term);
}

@fragment
fn naive_rsm(in: FullscreenVertexOutput) -> @location(0) vec4<f32> {
    let size = textureDimensions(g_buffer);
    let pixel = min(vec2<u32>(in.position.xy), size - 1u);
    let depth = textureLoad(depth_buffer, pixel, 0);
    if depth == 0.0 {
        return vec4(0.0);
    }
    let texel = textureLoad(g_buffer, pixel, 0);
    let surface = read_surface(texel, pixel, size, depth, view.world_from_clip);
    let frame = frame_of(surface.position);
    var sum = vec3(0.0);
    for (var i = 0u; i < #{SAMPLES}u; i++) {
        let chosen = choose(pattern[i], frame);
        sum += chosen.count * from_texel(texels[chosen.index], surface);
    }
    // The equation of the plugin's gather and composite.
    let received = min(sum * (view.exposure * 0.31830987), vec3(65000.0));
    return vec4(received * scattered_share(texel, 1.0) * 0.31830987, 0.0);
}
