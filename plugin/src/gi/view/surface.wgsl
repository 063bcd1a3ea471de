// The surface in a texel of Bevy's deferred G-buffer, and its reflection.
#define_import_path bevy_frugal_gi::gi::view::surface

#import bevy_pbr::pbr_deferred_types::{DEFERRED_FLAGS_UNLIT_BIT, unpack_24bit_normal, unpack_flags, unpack_unorm4x8_}
#import bevy_pbr::utils::octahedral_decode

struct Surface {
    /// World space, metres.
    position: vec3<f32>,
    /// World space, unit length, on the visible side.
    normal: vec3<f32>,
}

/// Size of a view's image, pixels. `viewport`: of Bevy's `View`. The G-buffer may be larger: cameras
/// that share a target share its G-buffer, each with a viewport of its own.
fn image_size(viewport: vec4<f32>) -> vec2<u32> {
    return vec2<u32>(viewport.zw);
}

/// Where a view's G-buffer holds a pixel of its image.
fn in_g_buffer(pixel: vec2<u32>, viewport: vec4<f32>) -> vec2<u32> {
    return pixel + vec2<u32>(viewport.xy);
}

/// World position of a pixel's centre at `depth` (reverse z, 0 is infinitely far).
fn pixel_position(pixel: vec2<u32>, size: vec2<u32>, depth: f32, world_from_clip: mat4x4<f32>) -> vec3<f32> {
    let uv = (vec2<f32>(pixel) + 0.5) / vec2<f32>(size);
    let clip = vec4(uv * vec2(2.0, -2.0) + vec2(-1.0, 1.0), depth, 1.0);
    let world = world_from_clip * clip;
    return world.xyz / world.w;
}

/// Width of a pixel across the view at a distance from the eye, metres.
fn pixel_width(clip_from_view: mat4x4<f32>, height: u32, distance_to_eye: f32) -> f32 {
    // Orthographic projections have 1 in the last element.
    return 2.0 * mix(distance_to_eye, 1.0, clip_from_view[3][3]) / (clip_from_view[1][1] * f32(height));
}

/// The distance at which a lens of 45 degrees shows things as large as this view shows them at a
/// distance from the eye, metres: what tolerances grow with. A parallel projection shows them alike
/// at any distance, and a longer lens larger. A wider lens counts as one of 45 degrees.
fn apparent_distance(clip_from_view: mat4x4<f32>, distance_to_eye: f32) -> f32 {
    let lens = 2.4142136 / clip_from_view[1][1];
    return select(distance_to_eye * min(lens, 1.0), lens, clip_from_view[3][3] == 1.0);
}

fn surface_normal(texel: vec4<u32>) -> vec3<f32> {
    return octahedral_decode(unpack_24bit_normal(texel.a));
}

/// Directional albedo: the share of light from one direction, at `cosine` to the normal, that a
/// surface scatters over the hemisphere. By reciprocity this is also its reflectance towards that
/// direction under uniform incident light. 0 for unlit surfaces, whose G-buffer holds no base
/// colour.
///
/// LAMBERTIAN: diffuse reflection alone; metals scatter nothing. Else Bevy's materials: the diffuse
/// term (Burley 2012, "Physically Based Shading at Disney", 5.3) by a fit of ours, within 0.015
/// except in the last degrees; and the specular term (Karis 2014, "Physically Based Shading on
/// Mobile"; multiple scattering between facets as in Filament's 4.7.2), which smooth surfaces lack
/// here, since they mirror.
fn scattered_share(texel: vec4<u32>, cosine: f32) -> vec3<f32> {
    let color = unpack_unorm4x8_(texel.r);
    let properties = unpack_unorm4x8_(texel.b);
    let base_color = pow(color.rgb, vec3(2.2));
    let metallic = properties.g;
#ifdef LAMBERTIAN
    return base_color * (1.0 - metallic);
#else
    let roughness = color.a;
    let mu = clamp(cosine, 0.0, 1.0);
    let slope = roughness * roughness;
    let grazing = pow(1.0 - mu, 5.0);
    let diffuse = 0.9762 + 0.0508 * slope + 0.0392 * slope * (1.0 - mu) + (1.0236 * slope - 0.4988) * grazing;
    let at_normal = mix(vec3(0.16 * properties.r * properties.r), base_color, metallic);
    let r = roughness * vec4(-1.0, -0.0275, -0.572, 0.022) + vec4(1.0, 0.0425, 1.04, -0.04);
    let a = min(r.x * r.x, exp2(-9.28 * mu)) * r.x + r.y;
    // Below 2 % at normal incidence Bevy dims the grazing reflection, too, so that 0 has none.
    let at_grazing = saturate(dot(at_normal, vec3(50.0 * 0.33)));
    let fit = max(vec2(-1.04, 1.04) * a + r.zw, vec2(5e-5));
    // Multiple scattering between facets: the light leaves them in the end.
    let specular = (at_normal * fit.x + at_grazing * fit.y) * (1.0 + at_normal * (1.0 / (fit.x + fit.y) - 1.0));
    let scattered = base_color * (1.0 - metallic) * diffuse + specular * smoothstep(0.2, 0.4, roughness);
    return select(scattered, vec3(0.0), (unpack_flags(texel.a) & DEFERRED_FLAGS_UNLIT_BIT) != 0u);
#endif
}

/// What a pixel of a view's image shows.
struct Shown {
    /// Reverse z; 0 where there is no surface.
    depth: f32,
    /// World space, metres.
    position: vec3<f32>,
    /// World space, unit length, on the visible side.
    normal: vec3<f32>,
}

/// The surface in a pixel of a view with these matrices of Bevy's `View`.
fn shown_at(pixel: vec2<u32>, g_buffer: texture_2d<u32>, depth_buffer: texture_depth_2d, viewport: vec4<f32>, world_from_clip: mat4x4<f32>) -> Shown {
    let texel = in_g_buffer(pixel, viewport);
    let depth = textureLoad(depth_buffer, texel, 0);
    let position = pixel_position(pixel, image_size(viewport), max(depth, 1e-30), world_from_clip);
    return Shown(depth, position, surface_normal(textureLoad(g_buffer, texel, 0)));
}

fn read_surface(texel: vec4<u32>, pixel: vec2<u32>, size: vec2<u32>, depth: f32, world_from_clip: mat4x4<f32>) -> Surface {
    return Surface(pixel_position(pixel, size, depth, world_from_clip), surface_normal(texel));
}

/// Edge-stopping weight between two points of surfaces, 0 to 1: whether one lies in the other's
/// tangent plane, to within `tolerance` metres, and has a similar normal. `delta`: from one point
/// to the other, metres.
fn surface_affinity(delta: vec3<f32>, normal: vec3<f32>, other_normal: vec3<f32>, tolerance: f32) -> f32 {
    let off_plane = abs(dot(delta, normal)) / tolerance;
    let alike = max(dot(other_normal, normal), 0.0);
    return exp(-off_plane * off_plane) * pow(alike, 8.0);
}

/// Tolerance from the tangent plane, metres, at an apparent distance: it grows with the size of a
/// pixel.
fn plane_tolerance(apparent_distance: f32) -> f32 {
    return 0.02 * apparent_distance + 1e-6;
}

/// The pixel that represents a low-resolution pixel of `step` pixels.
fn representative(cell: vec2<u32>, step: vec2<u32>, size: vec2<u32>) -> vec2<u32> {
    return min(cell * step + step / 2u, size - 1u);
}
