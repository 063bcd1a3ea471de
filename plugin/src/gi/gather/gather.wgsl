// Sums the irradiance from a camera's virtual point lights and its sky at a point, from one set of
// each; and at low-resolution pixels, with one thread per pixel. A workgroup's pixels have the same
// set, so that all its threads read the same VPL.
//
// With visibility (RAYS), the set is split into as many strata (`vpl/vpl.wgsl`) as there are rays: one
// VPL is sampled per stratum by luminance and the guess of its visibility, and one ray accepts or rejects
// the stratum's sum. The hue is the stratum's: the sampled VPL's would be unbiased in each channel, but
// speckle every wall in the colours of its lights.
#define_import_path bevy_frugal_gi::gi::gather::gather

#import bevy_render::view::View
#import bevy_frugal_gi::gi::view::surface::{
    apparent_distance, image_size, pixel_width, representative, shown_at,
}
#import bevy_frugal_gi::gi::vpl::vpl::{Plan, Vpl, from_vpl}
#ifdef RAYS
#import bevy_frugal_gi::gi::view::noise::pixel_noise
#import bevy_frugal_gi::gi::vpl::vpl::{empty_stratum, update_stratum, weight_of}
#import bevy_frugal_gi::gi::trace::trace::{begin_trace, is_occluded, is_open, surface_offset}
#endif
#ifdef SKY_RAYS
#import bevy_frugal_gi::gi::sky::sky::{SKY_STRIDE, SkyLight}
#endif

@group(0) @binding(0) var g_buffer: texture_2d<u32>;
@group(0) @binding(1) var depth_buffer: texture_depth_2d;
@group(0) @binding(2) var<uniform> view: View;
@group(0) @binding(3) var<storage, read> vpls: array<Vpl>;
@group(0) @binding(4) var<storage, read> plan: Plan;
@group(0) @binding(5) var irradiance: texture_storage_2d<rgba16float, write>;
#ifdef SKY_RAYS
// `cache/light.wgsl`, which imports this, has 6.
@group(0) @binding(7) var<storage, read> sky_samples: array<SkyLight>;
#endif

#ifdef RAYS
/// Origin of a pixel's rays.
fn departure(position: vec3<f32>, normal: vec3<f32>) -> vec3<f32> {
    let eye = distance(position, view.world_position);
    let width = pixel_width(view.clip_from_view, image_size(view.viewport).y, eye);
    return position + normal * surface_offset(position, apparent_distance(view.clip_from_view, eye), width);
}

fn gathered(which_set: u32, seed: vec2<u32>, position: vec3<f32>, normal: vec3<f32>) -> vec3<f32> {
    let origin = departure(position, normal);
    let first = which_set * plan.per_set;
    let end_of_set = first + plan.per_set;
    // Fixed while something changes.
    let noise = pixel_noise(seed, f32(plan.sequence));
    var sum = vec3(0.0);
    var sum_sampled = vec3(0.0);
    var all = 0.0;
    var free = 0.0;
    for (var which = 0u; which < #{RAYS}u; which++) {
        var stratum = empty_stratum(fract(noise + f32(which) * 0.618034));
        for (var i = first + which; i < end_of_set; i += #{RAYS}u) {
            stratum = update_stratum(stratum, i, from_vpl(vpls[i], position, normal) * vpls[i].visibility);
        }
        all += stratum.total;
        if stratum.total > 0.0 {
            let vpl = vpls[stratum.sampled];
            let end = vpl.position + vpl.normal * surface_offset(vpl.position, apparent_distance(view.clip_from_view, distance(vpl.position, view.world_position)), vpl.texel_width);
            if !is_occluded(origin, end) {
                sum += stratum.sent / vpl.visibility;
                sum_sampled += vpl.flux * (stratum.total / max(weight_of(vpl.flux) * vpl.visibility, 1e-35));
                free += stratum.total;
            }
        }
    }
    let occluded = 1.0 - free / max(all, 1e-35);
    return mix(sum, sum_sampled, min(2.0 * occluded, 1.0));
}
#else
fn gathered(which_set: u32, seed: vec2<u32>, position: vec3<f32>, normal: vec3<f32>) -> vec3<f32> {
    let first = which_set * plan.per_set;
    let end_of_set = first + plan.per_set;
    var sum = vec3(0.0);
    for (var i = first; i < end_of_set; i++) {
        sum += from_vpl(vpls[i], position, normal);
    }
    return sum;
}
#endif

#ifdef SKY_RAYS
/// The same for the sky. Its samples have strata of their own: where the sky is bright and
/// occluded, a shared ray would nearly always be spent on it.
fn gathered_sky(which_set: u32, seed: vec2<u32>, position: vec3<f32>, normal: vec3<f32>) -> vec3<f32> {
    let origin = departure(position, normal);
    let first = which_set * SKY_STRIDE;
    let end_of_set = first + plan.sky_samples;
    let noise = pixel_noise(seed.yx, f32(plan.sequence));
    var sum = vec3(0.0);
    for (var which = 0u; which < #{SKY_RAYS}u; which++) {
        var stratum = empty_stratum(fract(noise + f32(which) * 0.618034));
        for (var i = first + which; i < end_of_set; i += #{SKY_RAYS}u) {
            stratum = update_stratum(stratum, i, sky_samples[i].light * max(dot(normal, sky_samples[i].direction), 0.0));
        }
        if stratum.total > 0.0 {
            if is_open(origin, sky_samples[stratum.sampled].direction) {
                sum += stratum.sent;
            }
        }
    }
    return sum;
}
#endif

/// Least side of the denoiser's window over rays, in low-resolution pixels.
const RAY_WINDOW: u32 = 4u;

/// What a pixel's random number is drawn by: its workgroup and set, so that a workgroup's rays stay together
/// and wait less for the longest. The window of the filter then has as many numbers as sets; where that is
/// fewer than its pixels, each pixel has its own.
fn noise_place(cell: vec2<u32>, group: vec2<u32>) -> vec2<u32> {
    return select(cell, group * plan.interleave + cell % plan.interleave, plan.interleave >= RAY_WINDOW);
}

@compute @workgroup_size(8, 8)
fn gather_vpls(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
#ifdef RAYS
    begin_trace(thread);
#endif
    let which_set = group.z;
    let cell = id.xy * plan.interleave + vec2(which_set % plan.interleave, which_set / plan.interleave);
    if any(cell >= textureDimensions(irradiance)) {
        return;
    }
    let pixel = representative(cell, vec2(plan.cell_width, plan.cell_height), image_size(view.viewport));
    let shown = shown_at(pixel, g_buffer, depth_buffer, view.viewport, view.world_from_clip);
    if shown.depth == 0.0 {
        textureStore(irradiance, cell, vec4(0.0));
        return;
    }
    let seed = noise_place(cell, group.xy);
    var light = gathered(which_set, seed, shown.position, shown.normal);
#ifdef SKY_RAYS
    light += gathered_sky(which_set, seed, shown.position, shown.normal);
#endif
    // Exposed before it is stored, so that half floats hold any scene; brighter values are white
    // anyway.
    let exposed = min(light * (view.exposure * 0.31830987), vec3(65000.0));
    textureStore(irradiance, cell, vec4(exposed, 1.0));
}
