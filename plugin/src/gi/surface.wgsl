// What a texel of Bevy's deferred G-buffer says of the surface there.
#define_import_path bevy_frugal_gi::gi::surface

#import bevy_pbr::pbr_deferred_types::{unpack_24bit_normal, unpack_unorm4x8_}
#import bevy_pbr::utils::octahedral_decode

struct Surface {
    /// World space, metres.
    position: vec3<f32>,
    /// World space, unit length, on the side that was seen.
    normal: vec3<f32>,
    /// Share of light scattered diffusely, 0 to 1.
    albedo: vec3<f32>,
}

/// World position of a pixel's centre at `depth` (reverse z, 0 is infinitely far).
fn pixel_position(pixel: vec2<u32>, size: vec2<u32>, depth: f32, world_from_clip: mat4x4<f32>) -> vec3<f32> {
    let uv = (vec2<f32>(pixel) + 0.5) / vec2<f32>(size);
    let clip = vec4(uv * vec2(2.0, -2.0) + vec2(-1.0, 1.0), depth, 1.0);
    let world = world_from_clip * clip;
    return world.xyz / world.w;
}

fn surface_normal(texel: vec4<u32>) -> vec3<f32> {
    return octahedral_decode(unpack_24bit_normal(texel.a));
}

/// Metals scatter nothing diffusely; unlit surfaces have no base colour here.
fn surface_albedo(texel: vec4<u32>) -> vec3<f32> {
    let base_color = pow(unpack_unorm4x8_(texel.r).rgb, vec3(2.2));
    let metallic = unpack_unorm4x8_(texel.b).g;
    return base_color * (1.0 - metallic);
}

fn read_surface(texel: vec4<u32>, pixel: vec2<u32>, size: vec2<u32>, depth: f32, world_from_clip: mat4x4<f32>) -> Surface {
    return Surface(pixel_position(pixel, size, depth, world_from_clip), surface_normal(texel), surface_albedo(texel));
}

/// How much what was found at one point of a surface says of another, 0 to 1: whether it lies in the other's tangent plane, to within
/// `tolerance` metres, and faces the same way.
fn surface_affinity(way: vec3<f32>, normal: vec3<f32>, other_normal: vec3<f32>, tolerance: f32) -> f32 {
    let off_plane = abs(dot(way, normal)) / tolerance;
    let alike = max(dot(other_normal, normal), 0.0);
    return exp(-off_plane * off_plane) * pow(alike, 8.0);
}

/// What counts as in a plane, metres, at a distance from the eye: it grows as pixels do.
fn plane_tolerance(distance_to_eye: f32) -> f32 {
    return 0.02 * distance_to_eye + 1e-6;
}

/// The pixel that stands for a cell of several.
fn representative(cell: vec2<u32>, step: vec2<u32>, size: vec2<u32>) -> vec2<u32> {
    return min(cell * step + step / 2u, size - 1u);
}
