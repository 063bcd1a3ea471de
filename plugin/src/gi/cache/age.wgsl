// Lets light of earlier frames fade where something changed, and drops cells that were not in view for
// long: one thread per slot of the table.

#import bevy_frugal_gi::gi::cache::table::{SAMPLE, cells, keys, settings, slots}
#import bevy_frugal_gi::gi::view::noise::mixed

/// Frames after which a cell that is not in view is dropped.
const FORGOTTEN: u32 = 1024u;
/// Samples of a cell at which older ones begin to count less.
const MOST: u32 = 4096u * SAMPLE;
/// While something changes, a cell forgets once in so many frames what its anchor sees.
const LINKS_PERIOD: u32 = 16u;

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
