// Sums the irradiance from a camera's virtual point lights and its sky: one thread per
// low-resolution pixel and its set of VPLs (`irradiance.wgsl`). A workgroup's pixels have the same
// set, so that all its threads read the same VPL.

#import bevy_frugal_gi::gi::gather::settings::Gather
#import bevy_frugal_gi::gi::view::surface::{image_size, in_g_buffer, pixel_position, representative, surface_normal}
#import bevy_frugal_gi::gi::gather::irradiance::{gathered, plan, view}
#ifdef RAYS
#import bevy_frugal_gi::gi::trace::trace::begin_trace
#endif
#ifdef SKY_RAYS
#import bevy_frugal_gi::gi::gather::irradiance::gathered_sky
#endif

@group(0) @binding(0) var g_buffer: texture_2d<u32>;
@group(0) @binding(1) var depth_buffer: texture_depth_2d;
@group(0) @binding(4) var<uniform> gather: Gather;
@group(0) @binding(6) var irradiance: texture_storage_2d<rgba16float, write>;

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
    let size = image_size(view.viewport);
    let pixel = representative(cell, vec2(gather.cell_width, gather.cell_height), size);
    let texel = in_g_buffer(pixel, view.viewport);
    let depth = textureLoad(depth_buffer, texel, 0);
    if depth == 0.0 {
        textureStore(irradiance, cell, vec4(0.0));
        return;
    }
    let position = pixel_position(pixel, size, depth, view.world_from_clip);
    let normal = surface_normal(textureLoad(g_buffer, texel, 0));
    var light = gathered(which_set, cell, position, normal);
#ifdef SKY_RAYS
    light += gathered_sky(which_set, cell, position, normal);
#endif
    // Exposed before it is stored, so that half floats hold any scene; brighter values are white
    // anyway.
    let exposed = min(light * (view.exposure * 0.31830987), vec3(65000.0));
    textureStore(irradiance, cell, vec4(exposed, 1.0));
}
