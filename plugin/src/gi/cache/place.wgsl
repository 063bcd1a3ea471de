// Chooses a pixel of each tile of the image, and decides what is sampled there: one thread per tile.
// Nothing is written that another thread reads, so that the decisions do not depend on their order.

#import bevy_render::view::View
#import bevy_frugal_gi::gi::cache::grid::{LEVELS, cell_size, corner_of, key_of, level_at, spot_of, square_of}
#import bevy_frugal_gi::gi::cache::table::{BLOCKED, KNOWN, SAMPLE, count_of, count_sample, find, links_of, settings}
#import bevy_frugal_gi::gi::cache::record::{LIGHTS, LINKS, SURFACE, USES}
#import bevy_frugal_gi::gi::view::noise::{mixed, random}
#import bevy_frugal_gi::gi::view::surface::{apparent_distance, image_size, in_g_buffer, pixel_position, surface_normal}

@group(0) @binding(0) var g_buffer: texture_2d<u32>;
@group(0) @binding(1) var depth_buffer: texture_depth_2d;
@group(0) @binding(2) var<uniform> view: View;
@group(0) @binding(6) var records: texture_storage_2d<rg32uint, write>;

/// Samples of a cell of the finest level after which no more are taken there. Higher values: less noise
/// at rest, and rays for longer.
const ENOUGH: u32 = 32u * SAMPLE;
/// Samples of the finest cell from which on coarser cells beside a wall need none.
const SOME: u32 = 8u * SAMPLE;

@compute @workgroup_size(8, 8)
fn place_samples(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= settings.across || id.y >= settings.down {
        return;
    }
    let size = image_size(view.viewport);
    // The R2 sequence (Roberts 2018), shifted in each tile.
    let seed = mixed(id.x + id.y * 65536u);
    let shift = vec2(random(seed), random(seed + 1u));
    let inside = fract(shift + f32(settings.frame & 4095u) * vec2(0.7548777, 0.5698403));
    let pixel = min(id.xy * settings.tile + vec2<u32>(inside * f32(settings.tile)), size - 1u);
    let texel = in_g_buffer(pixel, view.viewport);
    let depth = textureLoad(depth_buffer, texel, 0);
    if depth == 0.0 {
        textureStore(records, id.xy, vec4(0u));
        return;
    }
    let position = pixel_position(pixel, size, depth, view.world_from_clip);
    let normal = surface_normal(textureLoad(g_buffer, texel, 0));
    let own = u32(level_at(apparent_distance(view.clip_from_view, distance(position, view.world_position))));
    let spot = spot_of(position - settings.origin, normal);
    var flags = SURFACE;
    var finest = 0u;
    var is_settled = false;
    var coarser_is_known = true;
    for (var k = LEVELS; k > 0u; k--) {
        let which = k - 1u;
        let level = own + which;
        let count = count_of(find(key_of(spot, square_of(spot, cell_size(level)), level)));
        let links = links_of(find(key_of(spot, corner_of(spot, cell_size(level)), level)));
        // Coarse cells first: after a cut, few rays light all that is in view.
        if coarser_is_known {
            flags |= USES << which;
        }
        flags |= (links * LINKS) << (2u * which);
        coarser_is_known = (links & KNOWN) != 0u;
        // Beside a wall the nearest cell may be that of the other side.
        is_settled = is_settled || links == KNOWN && count >= (ENOUGH << (2u * which));
        finest = count;
    }
    // Beside a wall a sample needs a ray to find its cell.
    for (var which = 1u; which < LEVELS && finest >= SOME; which++) {
        if (flags & ((BLOCKED * LINKS) << (2u * which))) != 0u {
            flags &= ~(USES << which);
        }
    }
    if !is_settled {
        flags |= LIGHTS;
        count_sample();
    }
    textureStore(records, id.xy, vec4(pixel.x | (pixel.y << 16u), flags, 0u, 0u));
}
