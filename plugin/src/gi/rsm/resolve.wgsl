// Resolves a light's G-buffer into texels of reflected flux: Dachsbacher and Stamminger 2005,
// "Reflective Shadow Maps", section 3.1, in photometric units.
//
// One pipeline for lights with parallel rays (PARALLEL) and one for those with a position. No
// control flow depends on a uniform: software Vulkan drivers recompile a shader for each value of
// such a uniform.

#import bevy_render::view::View
#import bevy_frugal_gi::gi::texels::texels::{Texel, pack_normal}
#import bevy_frugal_gi::gi::view::surface::{read_surface, scattered_share}

struct Light {
    /// Parallel: lux. Otherwise candela. Linear RGB.
    intensity: vec3<f32>,
    /// Parallel: world area that a texel covers across the rays (m²). Otherwise: solid angle of a
    /// texel in the middle of the view (sr).
    texel_area_or_solid_angle: f32,
    /// World space, metres; unused for parallel light.
    position: vec3<f32>,
    /// 1/m².
    inverse_range_squared: f32,
    /// World space, unit length.
    direction: vec3<f32>,
    /// Spot: attenuation is saturate(cos · scale + offset)². Point: 0 and 1.
    cone_scale: f32,
    cone_offset: f32,
    /// First texel of this map in the store.
    texel_offset: u32,
    resolution: u32,
    /// Parallel: share of half the map's width and height over which light fades towards its
    /// border.
    fade: vec2<f32>,
}

@group(0) @binding(0) var g_buffer: texture_2d<u32>;
@group(0) @binding(1) var depth_buffer: texture_depth_2d;
@group(0) @binding(2) var<uniform> view: View;
@group(0) @binding(3) var<uniform> light: Light;
@group(0) @binding(4) var<storage, read_write> texels: array<Texel>;

/// Bound below the largest finite f32, with headroom for sums. NaN compares false with everything.
const LARGEST: f32 = 1e30;

fn is_valid(value: vec3<f32>) -> bool {
    return all(abs(value) < vec3(LARGEST));
}

@compute @workgroup_size(8, 8)
fn resolve(@builtin(global_invocation_id) id: vec3<u32>) {
    let size = textureDimensions(g_buffer);
    if any(id.xy >= size) {
        return;
    }
    let depth = textureLoad(depth_buffer, id.xy, 0);
    let shown = textureLoad(g_buffer, id.xy, 0);
    let surface = read_surface(shown, id.xy, size, depth, view.world_from_clip);

#ifdef PARALLEL
    let to_border = 1.0 - abs((vec2<f32>(id.xy) + 0.5) / vec2<f32>(size) * 2.0 - 1.0);
    let faded = saturate(to_border / max(light.fade, vec2(1e-6)));
    let light_flux = light.intensity * (light.texel_area_or_solid_angle * faded.x * faded.y);
    let across = light.texel_area_or_solid_angle;
    let cosine = -dot(surface.normal, light.direction);
#else
    let ray = surface.position - light.position;
    let distance_squared = max(dot(ray, ray), 1e-12);
    let axis = view.world_from_view[2].xyz;
    // The solid angle of a texel off the axis falls with cos³: cos² for the distance to the image
    // plane, cos for its tilt.
    let cos_axis = max(-dot(ray, axis) * inverseSqrt(distance_squared), 0.0);
    let cos_cone = dot(ray, light.direction) * inverseSqrt(distance_squared);
    let cone = saturate(cos_cone * light.cone_scale + light.cone_offset);
    let range_term = distance_squared * light.inverse_range_squared;
    let window = saturate(1.0 - range_term * range_term);
    let solid_angle = light.texel_area_or_solid_angle * cos_axis * cos_axis * cos_axis;
    let light_flux = light.intensity * (solid_angle * cone * cone * window * window);
    let across = solid_angle * distance_squared;
    let cosine = -dot(surface.normal, ray) * inverseSqrt(distance_squared);
#endif

    let flux = light_flux * scattered_share(shown, cosine);
    let lit = depth > 0.0 && is_valid(surface.position) && is_valid(surface.normal) && is_valid(flux);
    var texel: Texel;
    texel.position = select(vec3(0.0), surface.position, lit);
    texel.packed_normal = pack_normal(select(vec3(0.0, 1.0, 0.0), surface.normal, lit));
    // Bounded: at grazing incidence a texel covers any length of surface, and a normal map may turn
    // the normal away.
    texel.area = select(0.0, across / max(cosine, 0.1), lit);
    texel.flux = select(vec3(0.0), flux, lit);
    texels[light.texel_offset + id.y * size.x + id.x] = texel;
}
