// Writes the volume that Bevy samples: one thread per place. Its layout is that of
// `bevy_pbr::irradiance_volume`: three faces along the depth, their negatives below along the height.

#import bevy_frugal_gi::gi::forward::probe::{NEIGHBOURS, PLACES, Probe, Volume, key_of, neighbour, slot_of}

@group(0) @binding(0) var<uniform> volume: Volume;
@group(0) @binding(1) var<storage, read> probes: array<Probe>;
@group(0) @binding(2) var voxels: texture_storage_3d<rgba16float, write>;

/// Places over which light fades at the volume's border.
const FADE: f32 = 2.0;

fn store(id: vec3<u32>, face: u32, light: vec3<f32>) {
    let places = vec3<u32>(PLACES);
    let at = vec3(id.x, id.y + (face / 3u) * places.y, id.z + (face % 3u) * places.z);
    textureStore(voxels, at, vec4(light, 1.0));
}

/// Whether a slot holds light of a place.
fn holds(probe: Probe, place: vec3<i32>) -> bool {
    return probe.faces[1].w == key_of(place) && probe.faces[0].w > 0u;
}

@compute @workgroup_size(4, 4, 4)
fn fill(@builtin(global_invocation_id) id: vec3<u32>) {
    let place = volume.base + vec3<i32>(id);
    let own = probes[slot_of(place)];
    var light = array<vec3<f32>, 6>();
    var count = 0.0;
    if holds(own, place) {
        for (var face = 0u; face < 6u; face++) {
            light[face] = bitcast<vec3<f32>>(own.faces[face].xyz);
        }
        count = 1.0;
    } else if own.faces[1].w == key_of(place) {
        for (var k = 0u; k < NEIGHBOURS; k++) {
            let beside = place + neighbour(k);
            let within = beside - volume.base;
            if (own.faces[3].w & (1u << k)) == 0u || any(within < vec3(0)) || any(within >= PLACES) {
                continue;
            }
            let other = probes[slot_of(beside)];
            if holds(other, beside) {
                for (var face = 0u; face < 6u; face++) {
                    light[face] += bitcast<vec3<f32>>(other.faces[face].xyz);
                }
                count += 1.0;
            }
        }
    }
    let border = vec3<f32>(min(id, vec3<u32>(PLACES) - 1u - id));
    let shown = saturate((min(min(border.x, border.y), border.z) + 0.5) / FADE) * volume.exposure / max(count, 1.0);
    for (var face = 0u; face < 6u; face++) {
        store(id, face, min(light[face] * shown, vec3(65000.0)));
    }
}

@compute @workgroup_size(4, 4, 4)
fn blacken(@builtin(global_invocation_id) id: vec3<u32>) {
    for (var face = 0u; face < 6u; face++) {
        store(id, face, vec3(0.0));
    }
}
