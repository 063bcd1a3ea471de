// What each pixel of a time-of-flight camera measures: for every path from the light at the eye
// back to the eye, its amplitude times cos φ and sin φ, where φ is the turns of the modulation over the
// path's length.
//
// The camera's VPLs are of one reflective shadow map, whose light is at the eye: each stands for the
// paths eye → VPL → pixel → eye. Every pixel sums all VPLs and traces a ray to each, where a gather
// would share a few rays among them.

#import bevy_render::view::View
#import bevy_frugal_gi::gi::trace::trace::{begin_trace, is_occluded, surface_offset}
#import bevy_frugal_gi::gi::view::noise::luminance
#import bevy_frugal_gi::gi::view::surface::{
    apparent_distance, image_size, in_g_buffer, pixel_position, pixel_width, scattered_share, surface_normal,
}
#import bevy_frugal_gi::gi::vpl::vpl::{Vpl, from_vpl}

// In a storage buffer, since control flow depends on it: software Vulkan drivers recompile a shader for
// each value of a uniform on which it does.
struct Sensor {
    /// Turns of the modulation in a metre of path.
    turns_per_metre: f32,
    /// Intensity of the light, candela.
    intensity: f32,
    /// Sets of VPLs, of which each alone carries the total flux.
    sets: u32,
    per_set: u32,
}

/// `pass.rs` reads it.
struct Phasors {
    /// Light that one surface scattered, nits.
    direct: vec2<f32>,
    /// Light that two surfaces scattered, nits.
    bounced: vec2<f32>,
    /// Distance of the surface from the eye, metres; 0 where there is none.
    distance: f32,
    padding: f32,
}

@group(0) @binding(0) var g_buffer: texture_2d<u32>;
@group(0) @binding(1) var depth_buffer: texture_depth_2d;
@group(0) @binding(2) var<uniform> view: View;
@group(0) @binding(3) var<storage, read> vpls: array<Vpl>;
@group(0) @binding(4) var<storage, read> sensor: Sensor;
@group(0) @binding(5) var<storage, read_write> pixels: array<Phasors>;

const INVERSE_PI: f32 = 0.31830987;

fn phasor(amplitude: f32, path: f32) -> vec2<f32> {
    // Sines are exact to few digits outside of half a turn.
    let turns = path * sensor.turns_per_metre;
    let angle = (turns - round(turns)) * 6.2831853;
    return amplitude * vec2(cos(angle), sin(angle));
}

/// Where rays leave a surface, or end at it. `width`: of what the point stands for, metres.
fn off_surface(position: vec3<f32>, normal: vec3<f32>, width: f32) -> vec3<f32> {
    let apparent = apparent_distance(view.clip_from_view, distance(position, view.world_position));
    return position + normal * surface_offset(position, apparent, width);
}

/// One thread for each pixel, row by row.
@compute @workgroup_size(64)
fn sum_phasors(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    begin_trace(thread);
    let size = image_size(view.viewport);
    let index = id.x;
    let pixel = vec2(index % size.x, index / size.x);
    if pixel.y >= size.y || index >= arrayLength(&pixels) {
        return;
    }
    let texel = in_g_buffer(pixel, view.viewport);
    let depth = textureLoad(depth_buffer, texel, 0);
    if depth == 0.0 {
        pixels[index] = Phasors(vec2(0.0), vec2(0.0), 0.0, 0.0);
        return;
    }
    let shown = textureLoad(g_buffer, texel, 0);
    let position = pixel_position(pixel, size, depth, view.world_from_clip);
    let normal = surface_normal(shown);
    let to_eye = view.world_position - position;
    let near = length(to_eye);
    let cosine = max(dot(normal, to_eye) / near, 0.0);
    let reflected = scattered_share(shown, cosine) * INVERSE_PI;

    let direct = luminance(reflected) * sensor.intensity * cosine / (near * near);
    let origin = off_surface(position, normal, pixel_width(view.clip_from_view, size.y, near));
    var bounced = vec2(0.0);
    for (var i = 0u; i < sensor.sets * sensor.per_set; i++) {
        let vpl = vpls[i];
        let light = luminance(reflected * from_vpl(vpl, position, normal)) * INVERSE_PI;
        if light > 0.0 {
            if !is_occluded(origin, off_surface(vpl.position, vpl.normal, vpl.texel_width)) {
                let path = distance(view.world_position, vpl.position) + distance(vpl.position, position) + near;
                bounced += phasor(light, path);
            }
        }
    }
    pixels[index] = Phasors(phasor(direct, 2.0 * near), bounced / f32(sensor.sets), near, 0.0);
}
