// Lights places of the grid: one thread per place, as `gather/gather.wgsl` does for pixels, but from
// all sides.
//
// A place takes one set of VPLs at a time, in strata. In each stratum one VPL is sampled by the light
// that it sends, whatever a surface faces, and one ray says whether it arrives. With SKY, the same for
// a set of the sky's samples, which is added to what the VPLs left.

#import bevy_frugal_gi::gi::forward::probe::{NEIGHBOURS, PLACES, Probe, Volume, key_of, neighbour, place_of}
#import bevy_frugal_gi::gi::trace::trace::begin_trace
#import bevy_frugal_gi::gi::view::noise::random
#import bevy_frugal_gi::gi::vpl::vpl::{Plan, empty_stratum, update_stratum, weight_of}
#ifdef SKY
#import bevy_frugal_gi::gi::sky::sky::{SKY_STRIDE, SkyLight}
#import bevy_frugal_gi::gi::trace::trace::is_open
#else
#import bevy_render::view::View
#import bevy_frugal_gi::gi::trace::trace::{is_occluded, leaves_solid, surface_offset}
#import bevy_frugal_gi::gi::view::surface::apparent_distance
#import bevy_frugal_gi::gi::vpl::vpl::Vpl
#endif

@group(0) @binding(0) var<uniform> volume: Volume;
@group(0) @binding(1) var<storage, read_write> probes: array<Probe>;
@group(0) @binding(3) var<storage, read> plan: Plan;
#ifdef SKY
@group(0) @binding(2) var<storage, read> sky_samples: array<SkyLight>;
#else
@group(0) @binding(2) var<storage, read> vpls: array<Vpl>;
@group(0) @binding(4) var<uniform> view: View;
#endif

/// Rays to VPLs, or to the sky, of a place in a frame.
const RAYS: u32 = 4u;
/// Neighbours that a place looks at in a frame.
const LOOKS: u32 = 2u;

/// A place's middle, metres.
fn middle_of(place: vec3<i32>) -> vec3<f32> {
    return (vec3<f32>(place) + 0.5) * volume.spacing;
}

/// Light that arrived, by the face that it falls on.
var<private> arrived: array<vec3<f32>, 6>;

/// `toward`: to the light, unit length.
fn arrive(light: vec3<f32>, toward: vec3<f32>) {
    let ahead = max(toward, vec3(0.0));
    let behind = max(-toward, vec3(0.0));
    arrived[0] += light * ahead.x;
    arrived[1] += light * ahead.y;
    arrived[2] += light * ahead.z;
    arrived[3] += light * behind.x;
    arrived[4] += light * behind.y;
    arrived[5] += light * behind.z;
}

#ifdef SKY
fn gather(position: vec3<f32>, which: u32, noise: f32) {
    let first = (which % plan.sets) * SKY_STRIDE;
    let end = first + plan.sky_samples;
    for (var k = 0u; k < RAYS; k++) {
        var stratum = empty_stratum(fract(noise + f32(k) * 0.618034));
        for (var i = first + k; i < end; i += RAYS) {
            stratum = update_stratum(stratum, i, sky_samples[i].light);
        }
        if stratum.total > 0.0 {
            let sample = sky_samples[stratum.sampled];
            if is_open(position, sample.direction) {
                arrive(sample.light * (stratum.total / max(weight_of(sample.light), 1e-35)), sample.direction);
            }
        }
    }
}
#else
/// What a surface at a position receives that faces the VPL: see `from_vpl`.
fn sent(vpl: Vpl, position: vec3<f32>) -> vec3<f32> {
    let to_light = vpl.position - position;
    let inverse = 1.0 / clamp(dot(to_light, to_light), 1e-18, 1e38);
    let emitter = max(-dot(vpl.normal, to_light), 0.0) * inverse * sqrt(inverse);
    return vpl.flux * min(emitter, vpl.largest_geometry_term);
}

fn gather(position: vec3<f32>, which: u32, noise: f32) {
    let first = (which % plan.sets) * plan.per_set;
    let end = first + plan.per_set;
    for (var k = 0u; k < RAYS; k++) {
        var stratum = empty_stratum(fract(noise + f32(k) * 0.618034));
        for (var i = first + k; i < end; i += RAYS) {
            stratum = update_stratum(stratum, i, sent(vpls[i], position));
        }
        if stratum.total > 0.0 {
            let vpl = vpls[stratum.sampled];
            let away = apparent_distance(view.clip_from_view, distance(vpl.position, view.world_position));
            let start = vpl.position + vpl.normal * surface_offset(vpl.position, away, vpl.texel_width);
            if !is_occluded(position, start) {
                let light = sent(vpl, position);
                let to_light = vpl.position - position;
                let toward = to_light * inverseSqrt(max(dot(to_light, to_light), 1e-30));
                arrive(light * (stratum.total / max(weight_of(light), 1e-35)), toward);
            }
        }
    }
}
#endif

@compute @workgroup_size(64)
fn light_probes(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    begin_trace(thread);
    let slot = id.x * volume.stride + volume.first;
    if slot >= u32(PLACES.x * PLACES.y * PLACES.z) {
        return;
    }
    let place = place_of(slot, volume.base);
    let position = middle_of(place);
    let key = key_of(place);
    let noise = random(slot * 64u + volume.seed * 1540483477u);
    // Word by word: what rays do not need would take registers from them.
    let is_new = probes[slot].faces[1].w != key;
#ifdef SKY
    let samples = probes[slot].faces[0].w;
    if is_new || probes[slot].faces[3].w != 0u || samples == 0u {
        return;
    }
    let kept = 1.0;
#else
    let before = select(probes[slot].faces[0].w, 0u, is_new);
    var looked = select(probes[slot].faces[2].w, 0u, is_new);
    var outside = select(probes[slot].faces[3].w, 0u, is_new);
    for (var k = 0u; k < LOOKS; k++) {
        let which = looked % NEIGHBOURS;
        let is_outside = leaves_solid(position, middle_of(place + neighbour(which)));
        outside = (outside & ~(1u << which)) | (u32(is_outside) << which);
        looked++;
    }
    let samples = select(min(before, volume.most - 1u) + 1u, 0u, outside != 0u);
    probes[slot].faces[0].w = samples;
    probes[slot].faces[1].w = key;
    probes[slot].faces[2].w = looked;
    probes[slot].faces[3].w = outside;
    if samples == 0u {
        return;
    }
    let kept = 1.0 - 1.0 / f32(samples);
#endif
    // One set after another, each place from another one on.
    gather(position, slot * 7u + slot / 37u + volume.round, noise);
    // Light and sky come as π times illuminance; a texel is illuminance ÷ π.
    let share = 0.10132118 / f32(samples);
    for (var face = 0u; face < 6u; face++) {
        // NaN compares false.
        let found = select(vec3(0.0), min(arrived[face], vec3(1e30)), arrived[face] >= vec3(0.0));
        let old = probes[slot].faces[face];
        probes[slot].faces[face] = vec4(bitcast<vec3<u32>>(bitcast<vec3<f32>>(old.xyz) * kept + found * share), old.w);
    }
}
