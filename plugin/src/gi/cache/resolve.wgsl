// Irradiance of low-resolution pixels from the cells around them: one thread per pixel.
//
// Between four cells light is interpolated; where a wall or a corner is between them, a ray finds the
// nearest that sees the pixel. What few samples say of a cell is completed by what those of the coarser
// cells around it say.

#import bevy_render::view::View
#import bevy_frugal_gi::gi::cache::grid::{LEVELS, anchor_of, cell_size, corner_of, key_of, level_at, spot_of}
#import bevy_frugal_gi::gi::cache::sight::{is_seen, nth_nearest}
#import bevy_frugal_gi::gi::cache::table::{BLOCKED, KNOWN, count_rays, find, light_of, links_of, settings}
#import bevy_frugal_gi::gi::trace::trace::begin_trace
#import bevy_frugal_gi::gi::view::surface::{apparent_distance, image_size, in_g_buffer, pixel_position, representative, surface_normal}

@group(0) @binding(0) var g_buffer: texture_2d<u32>;
@group(0) @binding(1) var depth_buffer: texture_depth_2d;
@group(0) @binding(2) var<uniform> view: View;
@group(0) @binding(6) var irradiance: texture_storage_2d<rgba16float, write>;

/// Samples that what coarser cells say counts for. Higher values: less noise, and softer shadows.
const PRIOR: f32 = 16.0;
/// Samples of finer cells from which on coarser ones beside a wall are not asked.
const ENOUGH: f32 = 4.0;

@compute @workgroup_size(8, 8)
fn resolve_cells(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    begin_trace(thread);
    if any(id.xy >= textureDimensions(irradiance)) {
        return;
    }
    let size = image_size(view.viewport);
    let pixel = representative(id.xy, vec2(settings.cell_width, settings.cell_height), size);
    let texel = in_g_buffer(pixel, view.viewport);
    let depth = textureLoad(depth_buffer, texel, 0);
    if depth == 0.0 {
        textureStore(irradiance, id.xy, vec4(0.0));
        return;
    }
    let position = pixel_position(pixel, size, depth, view.world_from_clip);
    let normal = surface_normal(textureLoad(g_buffer, texel, 0));
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
