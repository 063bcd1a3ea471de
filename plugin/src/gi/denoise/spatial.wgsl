// Averages neighbouring low-resolution pixels, which used different VPLs and rays: an edge-stopping
// mean over a square window, along surfaces.
//
// The window is centred, and its outermost rows and columns have half weight: so every set of VPLs
// has the same weight, and the result is not shifted. Every workgroup first decodes the surfaces
// under its tile and the window's margin.

#import bevy_render::view::View
#import bevy_frugal_gi::gi::view::noise::luminance
#import bevy_frugal_gi::gi::view::surface::{apparent_distance, image_size, plane_tolerance, representative, shown_at, surface_affinity}
#import bevy_frugal_gi::gi::vpl::vpl::Plan

@group(0) @binding(0) var g_buffer: texture_2d<u32>;
@group(0) @binding(1) var depth_buffer: texture_depth_2d;
@group(0) @binding(2) var<uniform> view: View;
@group(0) @binding(3) var<storage, read> plan: Plan;
@group(0) @binding(4) var gathered: texture_2d<f32>;
@group(0) @binding(5) var filtered: texture_storage_2d<rgba16float, write>;

const GROUP: u32 = 8u;
const WINDOW: u32 = #{WINDOW}u;
const TILE: u32 = GROUP + WINDOW;

/// Position, and a flag: 1 where there is a surface, −1 where its irradiance is not finite, 0
/// without a surface.
var<workgroup> positions: array<vec4<f32>, TILE * TILE>;
var<workgroup> normals: array<vec3<f32>, TILE * TILE>;
var<workgroup> light: array<vec3<f32>, TILE * TILE>;

@compute @workgroup_size(GROUP, GROUP)
fn filter_spatially(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let size = image_size(view.viewport);
    let cells = textureDimensions(gathered);
    let corner = vec2<i32>(group.xy * GROUP) - i32(WINDOW / 2u);
    for (var i = lane; i < TILE * TILE; i += GROUP * GROUP) {
        let tap = corner + vec2<i32>(vec2(i % TILE, i / TILE));
        let inside = all(tap >= vec2(0)) && all(tap < vec2<i32>(cells));
        let cell = vec2<u32>(clamp(tap, vec2(0), vec2<i32>(cells) - 1));
        let pixel = representative(cell, vec2(plan.cell_width, plan.cell_height), size);
        let shown = shown_at(pixel, g_buffer, depth_buffer, view.viewport, view.world_from_clip);
        let found = textureLoad(gathered, cell, 0).rgb;
        // The largest half float. NaN compares false.
        let valid = all(found >= vec3(0.0)) && all(found <= vec3(65504.0));
        positions[i] = vec4(shown.position, select(0.0, select(-1.0, 1.0, valid), inside && shown.depth > 0.0));
        normals[i] = shown.normal;
        light[i] = select(vec3(0.0), found, valid);
    }
    workgroupBarrier();
    let center = (local.y + WINDOW / 2u) * TILE + local.x + WINDOW / 2u;
    let position = positions[center];
    let normal = normals[center];
    let tolerance = plane_tolerance(apparent_distance(view.clip_from_view, distance(position.xyz, view.world_position)));
    var sum = vec3(0.0);
    var weights = 0.0;
    var first = 0.0;
    var second = 0.0;
    let own = luminance(light[center]);
    for (var y = 0u; y <= WINDOW; y++) {
        for (var x = 0u; x <= WINDOW; x++) {
            let other = (local.y + y) * TILE + local.x + x;
            let there = positions[other];
            let share = select(1.0, 0.5, x == 0u || x == WINDOW) * select(1.0, 0.5, y == 0u || y == WINDOW);
            let weight = share * max(there.w, 0.0) * surface_affinity(there.xyz - position.xyz, normal, normals[other], tolerance);
            // A weight of 0 must not pass NaN.
            sum += select(vec3(0.0), weight * light[other], weight > 0.0);
            weights += weight;
            // Moments about the pixel's own value, which lose less precision.
            let away = select(0.0, luminance(light[other]) - own, weight > 0.0);
            first += weight * away;
            second += weight * away * away;
        }
    }
    if any(id.xy >= cells) {
        return;
    }
    // The pixel's own weight is 1, except without a surface. A pixel whose irradiance is not finite
    // gets its neighbours' mean. Then the standard error of this mean.
    let count = max(weights, 1e-12);
    let variance = max(second / count - (first / count) * (first / count), 0.0);
    let mean = sum / count;
    // Few values estimate their variance badly: the error of a single one is as large as the value
    // itself.
    let unknown = luminance(mean) / max(count * count * count, 1.0);
    let error = min(sqrt(variance / max(weights - 1.0, 1.0) + unknown * unknown), 65504.0);
    textureStore(filtered, id.xy, vec4(select(vec3(0.0), mean, position.w != 0.0), error));
}
