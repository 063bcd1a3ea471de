// What precedes the light of a frame. First, light of earlier frames fades where something changed, and
// cells that were not in view for long are dropped: one thread per slot of the table.
//
// Then a pixel of each tile of the image is chosen, and what is sampled there: one thread per tile.
// Nothing is written that another thread reads, so that the decisions do not depend on their order.

#import bevy_render::view::View
#import bevy_frugal_gi::gi::cache::grid::{
    LEVELS, LIGHTS, LINKS, SURFACE, USES, cell_size, corner_of, key_of, level_at, spot_of, square_of,
}
#import bevy_frugal_gi::gi::cache::table::{BLOCKED, KNOWN, SAMPLE, cells, count_of, count_sample, find, keys, links_of, settings, slots}
#import bevy_frugal_gi::gi::view::noise::{mixed, random}
#import bevy_frugal_gi::gi::view::surface::{apparent_distance, image_size, shown_at}

@group(0) @binding(0) var g_buffer: texture_2d<u32>;
@group(0) @binding(1) var depth_buffer: texture_depth_2d;
@group(0) @binding(2) var<uniform> view: View;
@group(0) @binding(6) var records: texture_storage_2d<rg32uint, write>;

/// Frames after which a cell that is not in view is dropped.
const FORGOTTEN: u32 = 1024u;
/// Samples of a cell at which older ones begin to count less.
const MOST: u32 = 4096u * SAMPLE;
/// While something changes, a cell forgets once in so many frames what its anchor sees.
const LINKS_PERIOD: u32 = 16u;
/// Samples of a cell of the finest level after which no more are taken there. Higher values: less noise
/// at rest, and rays for longer.
const ENOUGH: u32 = 32u * SAMPLE;
/// Samples of the finest cell from which on coarser cells beside a wall need none.
const SOME: u32 = 8u * SAMPLE;

@compute @workgroup_size(64)
fn age_cells(@builtin(global_invocation_id) id: vec3<u32>) {
    let slot = id.x;
    if slot >= slots() {
        return;
    }
    let key = atomicLoad(&keys[slot]);
    if key == 0u {
        return;
    }
    let old = vec4(atomicLoad(&cells[slot].red), atomicLoad(&cells[slot].green), atomicLoad(&cells[slot].blue), atomicLoad(&cells[slot].count));
    // Three quarters.
    let faded = select(select(old, old / 2u, old.a > MOST), old - (old + 3u) / 4u, settings.fades > 0u);
    // What is left of less than a sixteenth of a sample is no light.
    let is_dropped = settings.frame - atomicLoad(&cells[slot].seen) > FORGOTTEN;
    let kept = select(faded, vec4(0u), is_dropped || faded.a < SAMPLE / 16u);
    let exposed = min(vec3<f32>(kept.rgb) * settings.exposure, vec3(4e9));
    let sums = select(kept.rgb, vec3<u32>(exposed), settings.exposure != 1.0);
    atomicStore(&cells[slot].red, sums.r);
    atomicStore(&cells[slot].green, sums.g);
    atomicStore(&cells[slot].blue, sums.b);
    atomicStore(&cells[slot].count, kept.a);
    let forgets_links = settings.fades > 0u && (mixed(key) + settings.frame) % LINKS_PERIOD == 0u;
    if is_dropped || forgets_links {
        atomicStore(&cells[slot].links, 0u);
    }
    if is_dropped {
        atomicStore(&keys[slot], 0u);
        atomicStore(&cells[slot].seen, 0u);
    }
}

@compute @workgroup_size(8, 8)
fn place_samples(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= settings.across || id.y >= settings.down {
        return;
    }
    // The R2 sequence (Roberts 2018), shifted in each tile.
    let seed = mixed(id.x + id.y * 65536u);
    let shift = vec2(random(seed), random(seed + 1u));
    let inside = fract(shift + f32(settings.frame & 4095u) * vec2(0.7548777, 0.5698403));
    let pixel = min(id.xy * settings.tile + vec2<u32>(inside * f32(settings.tile)), image_size(view.viewport) - 1u);
    let shown = shown_at(pixel, g_buffer, depth_buffer, view.viewport, view.world_from_clip);
    if shown.depth == 0.0 {
        textureStore(records, id.xy, vec4(0u));
        return;
    }
    let own = u32(level_at(apparent_distance(view.clip_from_view, distance(shown.position, view.world_position))));
    let spot = spot_of(shown.position - settings.origin, shown.normal);
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
