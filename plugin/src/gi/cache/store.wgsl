// Adds the samples' light to their cells: one thread per tile.
//
// A cell collects what its anchor sees. Where the anchors around a sample see each other, its own is
// the nearest. Where not, there is a wall between them, or a corner, and rays find the nearest that
// sees the sample: what lies on the other side of a wall is in another cell.

#import bevy_render::view::View
#import bevy_frugal_gi::gi::cache::grid::{LEVELS, Spot, anchor_of, cell_size, corner_of, key_of, level_at, spot_of, square_of}
#import bevy_frugal_gi::gi::cache::record::{LIGHTS, LINKS, SURFACE, USES, recorded_pixel}
#import bevy_frugal_gi::gi::cache::sight::{is_seen, nth_nearest}
#import bevy_frugal_gi::gi::cache::table::{BLOCKED, KNOWN, LIGHT_UNIT, MOST_LIGHT, NOWHERE, SAMPLE, cells, count_rays, find_or_add, settings}
#import bevy_frugal_gi::gi::trace::trace::begin_trace
#import bevy_frugal_gi::gi::view::noise::{mixed, random}
#import bevy_frugal_gi::gi::view::surface::{apparent_distance, image_size, in_g_buffer, pixel_position, surface_normal}

@group(0) @binding(0) var g_buffer: texture_2d<u32>;
@group(0) @binding(1) var depth_buffer: texture_depth_2d;
@group(0) @binding(2) var<uniform> view: View;
@group(0) @binding(6) var records: texture_2d<u32>;
@group(0) @binding(7) var light: texture_2d<f32>;

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
    let size = image_size(view.viewport);
    let pixel = recorded_pixel(record);
    let texel = in_g_buffer(pixel, view.viewport);
    let position = pixel_position(pixel, size, textureLoad(depth_buffer, texel, 0), view.world_from_clip);
    let normal = surface_normal(textureLoad(g_buffer, texel, 0));
    let own = u32(level_at(apparent_distance(view.clip_from_view, distance(position, view.world_position))));
    let spot = spot_of(position - settings.origin, normal);
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
            let lift = normal * (0.25 * width);
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
            let lift = normal * (0.25 * width);
            let place = position - settings.origin + lift;
            var is_found = false;
            for (var i = 0u; i < 4u && !is_found; i++) {
                square = nth_nearest(spot, corner, width, i);
                is_found = is_seen(place, anchor_of(spot, square, width) + lift);
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
