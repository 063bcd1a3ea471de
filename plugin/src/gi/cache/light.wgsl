// Light at the points that `place.wgsl` chose: one thread per tile, as `gather/gather.wgsl` does for
// pixels.

#import bevy_frugal_gi::gi::cache::record::{LIGHTS, recorded_pixel}
#import bevy_frugal_gi::gi::gather::irradiance::{gathered, plan, view}
#import bevy_frugal_gi::gi::trace::trace::begin_trace
#import bevy_frugal_gi::gi::view::noise::mixed
#import bevy_frugal_gi::gi::view::surface::{image_size, in_g_buffer, pixel_position, surface_normal}
#ifdef SKY_RAYS
#import bevy_frugal_gi::gi::gather::irradiance::gathered_sky
#endif

@group(0) @binding(0) var g_buffer: texture_2d<u32>;
@group(0) @binding(1) var depth_buffer: texture_depth_2d;
@group(0) @binding(4) var records: texture_2d<u32>;
@group(0) @binding(6) var light: texture_storage_2d<rgba32float, write>;

@compute @workgroup_size(8, 8)
fn light_samples(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    begin_trace(thread);
    if any(id.xy >= textureDimensions(light)) {
        return;
    }
    let record = textureLoad(records, id.xy, 0).xy;
    if (record.y & LIGHTS) == 0u {
        return;
    }
    let size = image_size(view.viewport);
    let pixel = recorded_pixel(record);
    let texel = in_g_buffer(pixel, view.viewport);
    let position = pixel_position(pixel, size, textureLoad(depth_buffer, texel, 0), view.world_from_clip);
    let normal = surface_normal(textureLoad(g_buffer, texel, 0));
    // Neighbours have other sets, and each frame another.
    let which_set = mixed(id.x + id.y * 4096u + mixed(plan.sequence)) % plan.sets;
    var sum = gathered(which_set, id.xy, position, normal);
#ifdef SKY_RAYS
    sum += gathered_sky(which_set, id.xy, position, normal);
#endif
    textureStore(light, id.xy, vec4(sum * (view.exposure * 0.31830987), 1.0));
}
