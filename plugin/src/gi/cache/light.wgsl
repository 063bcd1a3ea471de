// Light at the points that `place.wgsl` chose, one thread per tile, as `gather/gather.wgsl` does for
// pixels. Then it is added to cells: one thread per tile.
//
// A cell collects what its anchor sees. Where the anchors around a sample see each other, its own is
// the nearest. Where not, there is a wall between them, or a corner, and rays find the nearest that
// sees the sample: what lies on the other side of a wall is in another cell.
//
// Last the irradiance of low-resolution pixels, from the cells around them: one thread per pixel.
//
// Between four cells light is interpolated; where a wall or a corner is between them, a ray finds the
// nearest that sees the pixel. What few samples say of a cell is completed by what those of the coarser
// cells around it say.

#import bevy_frugal_gi::gi::cache::grid::{
    LEVELS, LIGHTS, LINKS, SURFACE, Spot, USES, anchor_of, cell_size, corner_of, key_of, level_at, recorded_pixel, spot_of, square_of,
}
#import bevy_frugal_gi::gi::cache::table::{
    BLOCKED, KNOWN, LIGHT_UNIT, MOST_LIGHT, NOWHERE, SAMPLE, cells, count_rays, find, find_or_add, light_of, links_of, settings,
}
#import bevy_frugal_gi::gi::gather::gather::{gathered, plan, view}
#import bevy_frugal_gi::gi::trace::trace::{begin_trace, is_occluded}
#import bevy_frugal_gi::gi::view::noise::{mixed, random}
#import bevy_frugal_gi::gi::view::surface::{
    Shown, apparent_distance, image_size, representative, shown_at,
}
#ifdef SKY_RAYS
#import bevy_frugal_gi::gi::gather::gather::gathered_sky
#endif

@group(0) @binding(0) var g_buffer: texture_2d<u32>;
@group(0) @binding(1) var depth_buffer: texture_depth_2d;
// To light samples.
@group(0) @binding(5) var chosen: texture_2d<u32>;
@group(0) @binding(6) var lit: texture_storage_2d<rgba32float, write>;
// To store them.
@group(0) @binding(6) var records: texture_2d<u32>;
@group(0) @binding(7) var light: texture_2d<f32>;
// To show cells.
@group(0) @binding(6) var irradiance: texture_storage_2d<rgba16float, write>;

/// Samples that what coarser cells say counts for. Higher values: less noise, and softer shadows.
const PRIOR: f32 = 16.0;
/// Samples of finer cells from which on coarser ones beside a wall are not asked.
const ENOUGH: f32 = 4.0;

/// Whether two points see each other, relative to the grid's origin.
fn is_seen(one: vec3<f32>, other: vec3<f32>) -> bool {
    return !is_occluded(one + settings.origin, other + settings.origin);
}

/// Of the four squares around a spot the nearest, the second, the third or the farthest. `corner` is
/// the lowest of them.
fn nth_nearest(spot: Spot, corner: vec2<i32>, size: f32, rank: u32) -> vec2<i32> {
    let part = spot.at / size - 0.5 - vec2<f32>(corner);
    let nearest = vec2<i32>(vec2<u32>(part >= vec2(0.5)));
    // The one across the nearer border is the second.
    let along_x = abs(part.x - 0.5) < abs(part.y - 0.5);
    let second = select(vec2(0, 1), vec2(1, 0), along_x);
    let third = vec2(1, 1) - second;
    let flip = select(select(vec2(0, 0), second, rank == 1u), select(third, vec2(1, 1), rank == 3u), rank >= 2u);
    return corner + (nearest ^ flip);
}

/// What the pixel of a record shows.
fn recorded_place(record: vec2<u32>) -> Shown {
    return shown_at(recorded_pixel(record), g_buffer, depth_buffer, view.viewport, view.world_from_clip);
}

@compute @workgroup_size(8, 8)
fn light_samples(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    begin_trace(thread);
    if any(id.xy >= textureDimensions(lit)) {
        return;
    }
    let record = textureLoad(chosen, id.xy, 0).xy;
    if (record.y & LIGHTS) == 0u {
        return;
    }
    let place = recorded_place(record);
    // Neighbours have other sets, and each frame another.
    let which_set = mixed(id.x + id.y * 4096u + mixed(plan.sequence)) % plan.sets;
    var sum = gathered(which_set, id.xy, place.position, place.normal);
#ifdef SKY_RAYS
    sum += gathered_sky(which_set, id.xy, place.position, place.normal);
#endif
    textureStore(lit, id.xy, vec4(sum * (view.exposure * 0.31830987), 1.0));
}

@compute @workgroup_size(8, 8)
fn store_samples(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    begin_trace(thread);
    if id.x >= settings.across || id.y >= settings.down {
        return;
    }
    let record = textureLoad(records, id.xy, 0).xy;
    if (record.y & SURFACE) == 0u {
        return;
    }
    let place = recorded_place(record);
    let own = u32(level_at(apparent_distance(view.clip_from_view, distance(place.position, view.world_position))));
    let spot = spot_of(place.position - settings.origin, place.normal);
    let lights = (record.y & LIGHTS) != 0u;
    let found = textureLoad(light, id.xy, 0).rgb;
    // NaN compares false.
    let valid = all(found >= vec3(0.0));
    let seed = mixed(id.x + id.y * 4096u + mixed(settings.frame));
    // Rounded up or down at random, so that the mean is exact.
    let rounding = vec3(random(seed), random(seed + 1u), random(seed + 2u));
    let units = vec3<u32>(min(select(vec3(0.0), found, valid), vec3(MOST_LIGHT)) * LIGHT_UNIT + rounding);
    var rays = 0u;
    for (var which = 0u; which < LEVELS; which++) {
        if (record.y & (USES << which)) == 0u {
            continue;
        }
        let level = own + which;
        let width = cell_size(level);
        let corner = corner_of(spot, width);
        var links = (record.y / LINKS) >> (2u * which);
        let corner_slot = find_or_add(key_of(spot, corner, level));
        if (links & KNOWN) == 0u {
            let lift = place.normal * (0.25 * width);
            let open = is_seen(anchor_of(spot, corner, width) + lift, anchor_of(spot, corner + vec2(1, 1), width) + lift)
                && is_seen(anchor_of(spot, corner + vec2(1, 0), width) + lift, anchor_of(spot, corner + vec2(0, 1), width) + lift);
            rays += 2u;
            links = select(KNOWN | BLOCKED, KNOWN, open);
            if corner_slot != NOWHERE {
                atomicOr(&cells[corner_slot].links, links);
            }
        }
        if corner_slot != NOWHERE {
            atomicMax(&cells[corner_slot].seen, settings.frame);
        }
        var square = square_of(spot, width);
        if lights && (links & BLOCKED) != 0u {
            let lift = place.normal * (0.25 * width);
            let lifted = place.position - settings.origin + lift;
            var is_found = false;
            for (var i = 0u; i < 4u && !is_found; i++) {
                square = nth_nearest(spot, corner, width, i);
                is_found = is_seen(lifted, anchor_of(spot, square, width) + lift);
                rays++;
            }
            if !is_found {
                continue;
            }
        }
        let slot = find_or_add(key_of(spot, square, level));
        if slot == NOWHERE {
            continue;
        }
        atomicMax(&cells[slot].seen, settings.frame);
        if lights && valid {
            atomicAdd(&cells[slot].red, units.r);
            atomicAdd(&cells[slot].green, units.g);
            atomicAdd(&cells[slot].blue, units.b);
            atomicAdd(&cells[slot].count, SAMPLE);
        }
    }
    count_rays(rays);
}

@compute @workgroup_size(8, 8)
fn resolve_cells(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    begin_trace(thread);
    if any(id.xy >= textureDimensions(irradiance)) {
        return;
    }
    let pixel = representative(id.xy, vec2(settings.cell_width, settings.cell_height), image_size(view.viewport));
    let here = shown_at(pixel, g_buffer, depth_buffer, view.viewport, view.world_from_clip);
    if here.depth == 0.0 {
        textureStore(irradiance, id.xy, vec4(0.0));
        return;
    }
    let position = here.position;
    let normal = here.normal;
    let level = level_at(apparent_distance(view.clip_from_view, distance(position, view.world_position)));
    let spot = spot_of(position - settings.origin, normal);
    var sums = array<vec4<f32>, LEVELS>();
    var known = 0.0;
    var rays = 0u;
    for (var which = 0u; which < LEVELS; which++) {
        let own = u32(level) + which;
        let width = cell_size(own);
        let corner = corner_of(spot, width);
        let first = find(key_of(spot, corner, own));
        let links = links_of(first);
        var sum = vec4(0.0);
        if links == KNOWN {
            let part = spot.at / width - 0.5 - vec2<f32>(corner);
            sum = light_of(first) * ((1.0 - part.x) * (1.0 - part.y));
            sum += light_of(find(key_of(spot, corner + vec2(1, 0), own))) * (part.x * (1.0 - part.y));
            sum += light_of(find(key_of(spot, corner + vec2(0, 1), own))) * ((1.0 - part.x) * part.y);
            sum += light_of(find(key_of(spot, corner + vec2(1, 1), own))) * (part.x * part.y);
        } else if (links & BLOCKED) != 0u || which + 1u == LEVELS {
            let lift = normal * (0.25 * width);
            for (var i = 0u; i < 4u && known < ENOUGH && sum.a == 0.0; i++) {
                let square = nth_nearest(spot, corner, width, i);
                let there = light_of(find(key_of(spot, square, own)));
                if there.a > 0.0 {
                    rays++;
                    if is_seen(position - settings.origin + lift, anchor_of(spot, square, width) + lift) {
                        sum = there;
                    }
                }
            }
        }
        sums[which] = sum;
        known += sum.a;
    }
    count_rays(rays);
    // From coarse to fine.
    var light = vec3(0.0);
    var coarser = vec3(0.0);
    var prior = 0.0;
    for (var k = LEVELS; k > 0u; k--) {
        let sum = sums[k - 1u];
        coarser = light;
        light = (sum.rgb + light * (PRIOR * prior)) / max(sum.a + PRIOR * prior, 1e-9);
        prior = select(prior, 1.0, sum.a > 0.0);
    }
    // The finest level fades before the next takes over.
    let has_coarser = known > sums[0].a;
    let shown = select(light, mix(light, coarser, fract(level)), has_coarser);
    textureStore(irradiance, id.xy, vec4(min(shown, vec3(65000.0)), prior));
}
