// Joins the filter's results over a wider window where they are still noise: one step of an edge-avoiding à-trous wavelet (Dammertz et al. 2010),
// guided by how uncertain each result is (as Schied et al. 2017 are by variance).
//
// What differs by more than both results' standard errors explain is a shadow's edge and stays. Where nothing was noise nothing is changed.

#import bevy_render::view::View
#import bevy_frugal_gi::gi::gather::settings::Gather
#import bevy_frugal_gi::gi::surface::{pixel_position, plane_tolerance, representative, surface_affinity, surface_normal}

@group(0) @binding(0) var g_buffer: texture_2d<u32>;
@group(0) @binding(1) var depth_buffer: texture_depth_2d;
@group(0) @binding(2) var<uniform> view: View;
@group(0) @binding(3) var<uniform> gather: Gather;
/// Irradiance and the standard error of its luminance.
@group(0) @binding(4) var filtered: texture_2d<f32>;
@group(0) @binding(5) var smoothed: texture_storage_2d<rgba16float, write>;

/// Cells from one tap to the next: the width of the filter's window, whose results share nothing.
const STEP: i32 = 4;
const REACH: i32 = 2;
/// How many standard errors count as noise. Higher values: smoother, and shadows' edges are softer.
const ERRORS: f32 = 2.0;

fn luminance(light: vec3<f32>) -> f32 {
    // Rec. 709.
    return dot(light, vec3(0.2126, 0.7152, 0.0722));
}

/// A cubic B-spline at whole numbers, 1 in its middle.
fn spline(x: i32) -> f32 {
    return select(select(1.0, 0.6666667, abs(x) == 1), 0.1666667, abs(x) == 2);
}

@compute @workgroup_size(8, 8)
fn smooth_filtered(@builtin(global_invocation_id) id: vec3<u32>) {
    let size = textureDimensions(g_buffer);
    let cells = textureDimensions(filtered);
    if any(id.xy >= cells) {
        return;
    }
    let step = vec2(gather.cell_width, gather.cell_height);
    let pixel = representative(id.xy, step, size);
    let depth = textureLoad(depth_buffer, pixel, 0);
    let own = textureLoad(filtered, id.xy, 0);
    let position = pixel_position(pixel, size, max(depth, 1e-30), view.world_from_clip);
    let normal = surface_normal(textureLoad(g_buffer, pixel, 0));
    let tolerance = plane_tolerance(distance(position, view.world_position));
    let light = luminance(own.rgb);
    var sum = own.rgb;
    var weights = 1.0;
    for (var y = -REACH; y <= REACH; y++) {
        for (var x = -REACH; x <= REACH; x++) {
            let place = vec2<i32>(id.xy) + vec2(x, y) * STEP;
            let inside = all(place >= vec2(0)) && all(place < vec2<i32>(cells)) && any(vec2(x, y) != vec2(0));
            let cell = vec2<u32>(clamp(place, vec2(0), vec2<i32>(cells) - 1));
            let there = representative(cell, step, size);
            let there_depth = textureLoad(depth_buffer, there, 0);
            let way = pixel_position(there, size, max(there_depth, 1e-30), view.world_from_clip) - position;
            let found = textureLoad(filtered, cell, 0);
            let alike = surface_affinity(way, normal, surface_normal(textureLoad(g_buffer, there, 0)), tolerance);
            let difference = luminance(found.rgb) - light;
            let noise = ERRORS * ERRORS * (own.a * own.a + found.a * found.a);
            let explained = exp(-difference * difference / max(noise, 1e-12));
            let weight = spline(x) * spline(y) * alike * explained;
            let counts = inside && there_depth > 0.0 && weight > 0.0;
            sum += select(vec3(0.0), weight * found.rgb, counts);
            weights += select(0.0, weight, counts);
        }
    }
    textureStore(smoothed, id.xy, vec4(sum / weights, 1.0));
}
