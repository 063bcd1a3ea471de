// The table of cells. What it holds does not depend on the order in which threads come: keys are
// exchanged, and light is added as whole numbers.
#define_import_path bevy_frugal_gi::gi::cache::table

#import bevy_frugal_gi::gi::cache::grid::Key

/// Samples are counted in parts, so that few remain a number when light changes and older ones fade.
const SAMPLE: u32 = 256u;
/// Light of one sample in a cell: units of exposed irradiance, and the most that counts, so that sums of
/// as many samples as a cell has stay below 2^32.
const LIGHT_UNIT: f32 = 4096.0;
const MOST_LIGHT: f32 = 64.0;
/// Slots that a key may lie in.
const REACH: u32 = 16u;
/// No slot.
const NOWHERE: u32 = 0xffffffffu;

/// A square of surface.
struct Cell {
    /// Sum of its samples' exposed irradiance, in units.
    red: atomic<u32>,
    green: atomic<u32>,
    blue: atomic<u32>,
    /// Its samples, in parts.
    count: atomic<u32>,
    /// Whether the four squares from this one upwards see each other: KNOWN, and BLOCKED where not.
    links: atomic<u32>,
    /// Frame in which it was last in view.
    seen: atomic<u32>,
}

const KNOWN: u32 = 1u;
const BLOCKED: u32 = 2u;

struct Settings {
    /// Of the grid, world space, metres.
    origin: vec3<f32>,
    /// Frames since the cache began.
    frame: u32,
    /// Side of a tile, in pixels, and tiles along both axes: one sample each.
    tile: u32,
    across: u32,
    down: u32,
    /// Width and height of a low-resolution pixel, in pixels.
    cell_width: u32,
    cell_height: u32,
    /// What light of earlier frames is multiplied by where exposure changes.
    exposure: f32,
    /// 1 while light or meshes change.
    fades: u32,
    padding: u32,
}

@group(0) @binding(3) var<storage, read_write> keys: array<atomic<u32>>;
@group(0) @binding(4) var<storage, read_write> cells: array<Cell>;
@group(0) @binding(5) var<storage, read> settings: Settings;

/// Slots of the table. Behind them are the counters.
fn slots() -> u32 {
    return arrayLength(&cells);
}

/// Counts rays that find cells, for diagnostics.
fn count_rays(rays: u32) {
    if rays > 0u {
        atomicAdd(&keys[slots()], rays);
    }
}

/// Counts a place that is lit, for diagnostics.
fn count_sample() {
    atomicAdd(&keys[slots() + 1u], 1u);
}

/// The slot of a key, or NOWHERE.
fn find(key: Key) -> u32 {
    let mask = slots() - 1u;
    for (var i = 0u; i < REACH; i++) {
        let slot = (key.slot + i) & mask;
        if atomicLoad(&keys[slot]) == key.check {
            return slot;
        }
    }
    return NOWHERE;
}

/// The same, of a key that is put there if it is new; NOWHERE where the table is full.
fn find_or_add(key: Key) -> u32 {
    // Slots become empty again: all are searched before an empty one is taken.
    let found = find(key);
    if found != NOWHERE {
        return found;
    }
    let mask = slots() - 1u;
    for (var i = 0u; i < REACH; i++) {
        let slot = (key.slot + i) & mask;
        loop {
            let taken = atomicCompareExchangeWeak(&keys[slot], 0u, key.check);
            if taken.exchanged || taken.old_value == key.check {
                return slot;
            }
            // A weak exchange may fail without a reason.
            if taken.old_value != 0u {
                break;
            }
        }
    }
    return NOWHERE;
}

/// Samples of a slot, in parts.
fn count_of(slot: u32) -> u32 {
    if slot == NOWHERE {
        return 0u;
    }
    return atomicLoad(&cells[slot].count);
}

/// Sum of light and number of samples of a slot.
fn light_of(slot: u32) -> vec4<f32> {
    if slot == NOWHERE {
        return vec4(0.0);
    }
    let sums = vec3(atomicLoad(&cells[slot].red), atomicLoad(&cells[slot].green), atomicLoad(&cells[slot].blue));
    return vec4(vec3<f32>(sums) / LIGHT_UNIT, f32(atomicLoad(&cells[slot].count)) / f32(SAMPLE));
}

/// Whether the squares from a slot upwards see each other.
fn links_of(slot: u32) -> u32 {
    if slot == NOWHERE {
        return 0u;
    }
    return atomicLoad(&cells[slot].links);
}
