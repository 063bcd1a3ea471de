// Importance of each stratum of the sky to the visible surfaces: one workgroup for each four
// neighbouring strata, one thread for each importance point.
//
// Every stratum's importance includes visibility, which bounced light has by tiles alone
// (`vpl/weigh.wgsl`). Indoors nearly all of the sky is occluded, and nearly all samples without
// visibility would be wasted; and the sky has few strata, so that a few thousand rays suffice. They take
// no holes of alpha masks (SOLID): importance is a guess.
#define SOLID

#import bevy_render::view::View
#import bevy_frugal_gi::gi::sky::sky::{SKY_STRATA_PER_RAY, SkyLight}
#import bevy_frugal_gi::gi::vpl::vpl::{COLUMNS, IMPORTANCE_POINTS, importance_pixel}
#import bevy_frugal_gi::gi::view::surface::{apparent_distance, image_size, pixel_width, shown_at}
#import bevy_frugal_gi::gi::trace::trace::{begin_trace, is_open, surface_offset}

@group(0) @binding(0) var g_buffer: texture_2d<u32>;
@group(0) @binding(1) var depth_buffer: texture_depth_2d;
@group(0) @binding(2) var<uniform> view: View;
@group(0) @binding(3) var<storage, read> strata: array<SkyLight>;
@group(0) @binding(4) var<storage, read_write> importance: array<f32>;

var<workgroup> cosines: array<vec4<f32>, IMPORTANCE_POINTS>;

@compute @workgroup_size(IMPORTANCE_POINTS)
fn weigh_sky(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    begin_trace(lane);
    let size = image_size(view.viewport);
    let shown = shown_at(importance_pixel(lane, size), g_buffer, depth_buffer, view.viewport, view.world_from_clip);
    let position = shown.position;
    let normal = shown.normal;

    let first = group.x * SKY_STRATA_PER_RAY;
    var own = vec4(0.0);
    for (var i = 0u; i < SKY_STRATA_PER_RAY; i++) {
        own[i] = max(dot(normal, strata[first + i].direction), 0.0);
    }
    // Neighbouring points trace their rays to different strata of the four.
    let direction = strata[first + (lane + lane / COLUMNS) % SKY_STRATA_PER_RAY].direction;
    let eye = distance(position, view.world_position);
    let origin = position + normal * surface_offset(position, apparent_distance(view.clip_from_view, eye), pixel_width(view.clip_from_view, size.y, eye));
    let reaches = shown.depth > 0.0 && dot(normal, direction) > 0.0 && is_open(origin, direction);
    cosines[lane] = select(vec4(0.0), own, reaches);
    workgroupBarrier();
    if lane < SKY_STRATA_PER_RAY {
        var sum = 0.0;
        for (var i = 0u; i < IMPORTANCE_POINTS; i++) {
            sum += cosines[i][lane];
        }
        importance[first + lane] = sum;
    }
}
