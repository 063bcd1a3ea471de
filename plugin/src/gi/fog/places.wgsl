// Light at the grid's places, for fog: one thread per place.

#import bevy_frugal_gi::gi::forward::probe::{PLACES, lit, volume}
#import bevy_frugal_gi::gi::view::noise::luminance

/// Mean radiance from all directions, and above it along the height the mean of luminance times the
/// direction to where it comes from; both exposed. Alpha: 1 where light is known, else 0.
@group(0) @binding(2) var light: texture_storage_3d<rgba16float, write>;

/// The largest value to be stored.
const MOST: f32 = 65000.0;

@compute @workgroup_size(4, 4, 4)
fn fill(@builtin(global_invocation_id) id: vec3<u32>) {
    let found = lit(volume.base + vec3<i32>(id));
    let known = select(0.0, 1.0, found.count > 0.0);
    let share = volume.exposure / max(found.count, 1.0);
    var sum = vec3(0.0);
    for (var face = 0u; face < 6u; face++) {
        sum += found.faces[face];
    }
    // A face is the integral of radiance times cosine, over π: two opposite ones differ by that of
    // radiance times direction. The sum of all weighs directions by 1 to 1.7, 1.5 in the mean.
    var flow = vec3(0.0);
    for (var axis = 0u; axis < 3u; axis++) {
        flow[axis] = luminance(found.faces[axis] - found.faces[axis + 3u]) * 0.25;
    }
    textureStore(light, id, vec4(min(sum * (share / 6.0), vec3(MOST)), known));
    textureStore(light, id + vec3(0u, u32(PLACES.y), 0u), vec4(clamp(flow * share, vec3(-MOST), vec3(MOST)), known));
}
