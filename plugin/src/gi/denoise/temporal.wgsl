// Temporal accumulation, after a wider spatial filter where noise is left (SMOOTH).
//
// The wider filter is one step of an edge-avoiding à-trous wavelet (Dammertz et al. 2010), guided
// by standard errors (as Schied et al. 2017 are by variance): a difference beyond both results'
// standard errors is a shadow's edge and stays. Without noise nothing changes.
//
// The history is an exponential moving average (Yang et al. 2009, "Amortized Supersampling") of
// reprojected irradiance: VPLs are resampled for each pose of the camera and each direction of a
// light, and the difference between two sets would flicker. A reprojected point is accepted if it
// lies in this surface's tangent plane. No control flow depends on a uniform: software Vulkan
// drivers recompile a shader for each value of such a uniform.

#import bevy_render::view::View
#import bevy_frugal_gi::gi::view::noise::{luminance, pixel_noise}
#import bevy_frugal_gi::gi::view::surface::{apparent_distance, image_size, pixel_position, plane_tolerance, representative, shown_at, surface_affinity}
#import bevy_frugal_gi::gi::vpl::vpl::Plan

@group(0) @binding(0) var g_buffer: texture_2d<u32>;
@group(0) @binding(1) var depth_buffer: texture_depth_2d;
@group(0) @binding(2) var<uniform> view: View;
@group(0) @binding(3) var<storage, read> plan: Plan;
/// Irradiance and the standard error of its luminance.
@group(0) @binding(4) var filtered: texture_2d<f32>;
/// Irradiance and the distance of its surface from the eye, metres; in a parallel projection, from
/// the eye's plane.
@group(0) @binding(5) var history: texture_2d<f32>;
@group(0) @binding(6) var<uniform> reprojection: Reprojection;
@group(0) @binding(7) var accumulated: texture_storage_2d<rgba16float, write>;
/// Frames in the mean of each low-resolution pixel of the history.
@group(0) @binding(8) var history_lengths: texture_2d<f32>;
@group(0) @binding(9) var lengths: texture_storage_2d<r32float, write>;

/// The camera of the history.
struct Reprojection {
    clip_from_world: mat4x4<f32>,
    world_from_clip: mat4x4<f32>,
    /// World space, metres.
    eye: vec3<f32>,
    /// Least weight of the present where there is history, in (0, 1]: 1 for no reprojection.
    present_weight: f32,
    /// Ratio of exposures, present to history.
    exposure: f32,
    /// 1 for a parallel projection, else 0.
    is_parallel: f32,
    /// Size of the history's image and of its low-resolution pixels, in pixels: both may differ
    /// from now.
    size: vec2<u32>,
    cell: vec2<u32>,
    /// 1 at rest, else 0.
    is_at_rest: f32,
    /// Frames of rest.
    rested: f32,
}

/// What the history knows of a surface.
struct Found {
    /// Irradiance.
    light: vec3<f32>,
    /// Share of the surface that the history shows, 0 to 1.
    share: f32,
    /// Frames in its mean.
    length: f32,
}

/// Low-resolution pixels from one tap to the next: the width of the spatial filter's window, so
/// that taps share no samples.
const STEP: i32 = 4;
const REACH: i32 = 2;
/// Differences up to so many standard errors count as noise. Higher values: smoother, with softer
/// shadow edges.
const ERRORS: f32 = 2.0;

/// A cubic B-spline at integers, 1 in its middle.
fn spline(x: i32) -> f32 {
    return select(select(1.0, 0.6666667, abs(x) == 1), 0.1666667, abs(x) == 2);
}

/// The history of a surface, reprojected. At rest it is that of the pixel itself: kilometres from the
/// origin, rounded positions would shift it in each frame.
fn reprojected(own: vec2<u32>, position: vec3<f32>, normal: vec3<f32>, tolerance: f32) -> Found {
    let cells = textureDimensions(history);
    let clip = reprojection.clip_from_world * vec4(position, 1.0);
    let uv = clip.xy / max(clip.w, 1e-9) * vec2(0.5, -0.5) + 0.5;
    // Low-resolution pixels represent the pixels at `cell · reprojection.cell + reprojection.cell /
    // 2`.
    let cell = clamp((uv * vec2<f32>(reprojection.size) - 0.5 - vec2<f32>(reprojection.cell / 2u)) / vec2<f32>(reprojection.cell), vec2(-2.0), vec2<f32>(cells) + 2.0);
    // Motion below a hundredth of a low-resolution pixel is snapped, so that it does not blur.
    let nearest = round(cell);
    let moved = select(cell, nearest, abs(cell - nearest) < vec2(0.01));
    let rests = reprojection.is_at_rest > 0.0;
    let read = select(moved, vec2<f32>(own), rests);
    let corner = floor(read);
    let fraction = read - corner;
    var sum = vec4(0.0);
    var length = 0.0;
    for (var i = 0u; i < 4u; i++) {
        let offset = vec2(i & 1u, i >> 1u);
        let tap = vec2<i32>(corner) + vec2<i32>(offset);
        let inside = all(tap >= vec2(0)) && all(tap < vec2<i32>(cells)) && (clip.w > 0.0 || rests);
        let at = vec2<u32>(clamp(tap, vec2(0), vec2<i32>(cells) - 1));
        let shown = textureLoad(history, at, 0);
        let pixel = representative(at, reprojection.cell, reprojection.size);
        let far = pixel_position(pixel, reprojection.size, 0.5, reprojection.world_from_clip);
        let near = pixel_position(pixel, reprojection.size, 1.0, reprojection.world_from_clip);
        let along = normalize(far - select(reprojection.eye, near, reprojection.is_parallel > 0.0));
        let origin = select(reprojection.eye, near - along * dot(near - reprojection.eye, along), reprojection.is_parallel > 0.0);
        let there = origin + along * shown.a;
        // NaN compares false, and is not added.
        let valid = all(shown.rgb >= vec3(0.0)) && all(shown.rgb <= vec3(65504.0)) && shown.a > 0.0;
        // Half floats round the distance.
        let same = valid && inside && (rests || abs(dot(there - position, normal)) < max(tolerance, 2e-3 * shown.a));
        let close = select(1.0 - fraction, fraction, offset == vec2(1u));
        let weight = select(0.0, close.x * close.y, same);
        sum += select(vec4(0.0), vec4(shown.rgb, 1.0) * weight, same);
        let frames = textureLoad(history_lengths, at, 0).r;
        // NaN compares false here, too.
        length += weight * select(1.0, frames, frames >= 1.0 && frames <= 65504.0);
    }
    let least = max(sum.a, 1e-6);
    return Found(sum.rgb / least, sum.a, length / least);
}

/// Luminance change, 0 to 1: 0 where noise of size `noise` explains the difference, 1 where the
/// light itself changed.
fn luminance_change(is: f32, was: f32, noise: f32) -> f32 {
    return smoothstep(0.95, 0.995, max(abs(is - was) - noise, 0.0) / max(max(is, was), 1e-9));
}

/// At rest, `light` and a random part of the last bit of its half float. A mean over many frames
/// changes by less than that bit, and would stop short of the limit.
fn dithered(cell: vec2<u32>, light: vec3<f32>) -> vec3<f32> {
    let random = pixel_noise(cell, reprojection.rested) - 0.5;
    // 2^-14 is the least normal half float.
    let bit = exp2(floor(log2(max(light, vec3(6.1035156e-5)))) - 10.0);
    return max(light + bit * random * reprojection.is_at_rest, vec3(0.0));
}

@compute @workgroup_size(8, 8)
fn accumulate(@builtin(global_invocation_id) id: vec3<u32>) {
    let size = image_size(view.viewport);
    let cells = textureDimensions(filtered);
    if any(id.xy >= cells) {
        return;
    }
    let step = vec2(plan.cell_width, plan.cell_height);
    let pixel = representative(id.xy, step, size);
    let here = shown_at(pixel, g_buffer, depth_buffer, view.viewport, view.world_from_clip);
    let own = textureLoad(filtered, id.xy, 0);
    let position = here.position;
    let normal = here.normal;
    let tolerance = plane_tolerance(apparent_distance(view.clip_from_view, distance(position, view.world_position)));
    let light = luminance(own.rgb);
    var sum = own.rgb;
    var weights = 1.0;
    // The wider filter's mean luminance without regard to noise.
    var around = light;
    var around_weights = 1.0;
#ifdef SMOOTH
    for (var y = -REACH; y <= REACH; y++) {
        for (var x = -REACH; x <= REACH; x++) {
            let tap = vec2<i32>(id.xy) + vec2(x, y) * STEP;
            let inside = all(tap >= vec2(0)) && all(tap < vec2<i32>(cells)) && any(vec2(x, y) != vec2(0));
            let cell = vec2<u32>(clamp(tap, vec2(0), vec2<i32>(cells) - 1));
            let there = shown_at(representative(cell, step, size), g_buffer, depth_buffer, view.viewport, view.world_from_clip);
            let found = textureLoad(filtered, cell, 0);
            let alike = surface_affinity(there.position - position, normal, there.normal, tolerance);
            let difference = luminance(found.rgb) - light;
            let noise = ERRORS * ERRORS * (own.a * own.a + found.a * found.a);
            let explained = exp(-difference * difference / max(noise, 1e-12));
            let wide = select(0.0, spline(x) * spline(y) * alike, inside && there.depth > 0.0);
            let weight = wide * explained;
            let counts = weight > 0.0;
            sum += select(vec3(0.0), weight * found.rgb, counts);
            weights += select(0.0, weight, counts);
            around += wide * luminance(found.rgb);
            around_weights += wide;
        }
    }
#endif
    let present = sum / weights;
    let found = reprojected(id.xy, position, normal, tolerance);
    let before = found.light * reprojection.exposure;
    // History is rejected where luminance changes by 95 % or more, so that lights switch without
    // lag.
    let was = luminance(before);
    let changed = min(luminance_change(luminance(present), was, ERRORS * own.a), luminance_change(around / around_weights, was, ERRORS * own.a));
    // The mean of all frames that showed the surface, up to the longest history: otherwise the noise
    // of the first frame would stay for as long as a whole history does.
    // At rest nothing changes but the samples.
    let least_share = max(reprojection.present_weight, 1.0 / (found.length + 1.0));
    let share = mix(1.0, max(least_share, changed * (1.0 - reprojection.is_at_rest)), select(0.0, found.share, found.share > 0.01));
    // Not mix(): where nothing changes it would lose a bit of the half float in each frame, on devices
    // that truncate, and never win it back.
    let blended = before + (present - before) * share;
    let shown = dithered(id.xy, select(present, blended, share < 1.0));
    textureStore(lengths, id.xy, vec4(select(1.0, 1.0 / share, share > 0.0), 0.0, 0.0, 0.0));
    let delta = position - view.world_position;
    let away = min(select(length(delta), -dot(delta, view.world_from_view[2].xyz), view.clip_from_view[3][3] == 1.0), 60000.0);
    textureStore(accumulated, id.xy, vec4(select(vec3(0.0), shown, here.depth > 0.0), select(0.0, away, here.depth > 0.0)));
}
