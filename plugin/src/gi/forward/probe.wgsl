// A place of the grid around a camera, and the light that is kept there. Then what writes the volume
// that Bevy samples: one thread per place. Its layout is that of `bevy_pbr::irradiance_volume`: three
// faces along the depth, their negatives below along the height.
#define_import_path bevy_frugal_gi::gi::forward::probe

/// Places along each axis, and along the height: powers of two.
const ACROSS: i32 = 32;
const UPWARDS: i32 = 16;
const PLACES: vec3<i32> = vec3(ACROSS, UPWARDS, ACROSS);

/// Six faces: towards +x, +y, +z, −x, −y, −z. The first three words of each are irradiance ÷ π of a
/// surface that faces so, nits, as floats. The fourth words of the faces, in this order: samples; the
/// place's key; neighbours looked at so far; a bit for each neighbour that lies outside of the solid
/// that this place is in; unused.
struct Probe {
    faces: array<vec4<u32>, 6>,
}

struct Volume {
    /// The place with the least coordinates, in steps from the world's origin.
    base: vec3<i32>,
    /// A step, metres.
    spacing: f32,
    exposure: f32,
    /// Of the slots, those from `first` on in steps of `stride` are lit.
    first: u32,
    stride: u32,
    /// Most samples that a mean is of.
    most: u32,
    /// Another in each frame.
    seed: u32,
    /// Another each time that all slots had their turn.
    round: u32,
}

/// Neighbours of a place.
const NEIGHBOURS: u32 = 26u;

/// Places keep their slot while the grid moves.
fn slot_of(place: vec3<i32>) -> u32 {
    let inside = place & (PLACES - 1);
    return u32(inside.x + PLACES.x * (inside.y + PLACES.y * inside.z));
}

/// The place of the grid that a slot is for.
fn place_of(slot: u32, base: vec3<i32>) -> vec3<i32> {
    let index = i32(slot);
    let inside = vec3(index % PLACES.x, (index / PLACES.x) % PLACES.y, index / (PLACES.x * PLACES.y));
    return base + ((inside - base) & (PLACES - 1));
}

/// Tells the places of one slot apart; never 0.
fn key_of(place: vec3<i32>) -> u32 {
    let block = vec3<u32>((place >> firstTrailingBit(vec3<u32>(PLACES))) & vec3(1023));
    return ((block.x * 1024u + block.y) * 1024u + block.z) * 2u + 1u;
}

/// A neighbour's offset, in steps.
fn neighbour(index: u32) -> vec3<i32> {
    // Without the place itself.
    let of_27 = i32(index + u32(index >= 13u));
    return vec3(of_27 % 3, (of_27 / 3) % 3, of_27 / 9) - 1;
}

@group(0) @binding(0) var<uniform> volume: Volume;
@group(0) @binding(1) var<storage, read> probes: array<Probe>;
@group(0) @binding(2) var voxels: texture_storage_3d<rgba16float, write>;

/// Places over which light fades at the volume's border.
const FADE: f32 = 2.0;

fn store(id: vec3<u32>, face: u32, light: vec3<f32>) {
    let places = vec3<u32>(PLACES);
    let at = vec3(id.x, id.y + (face / 3u) * places.y, id.z + (face % 3u) * places.z);
    textureStore(voxels, at, vec4(light, 1.0));
}

/// Whether a slot holds light of a place.
fn holds(probe: Probe, place: vec3<i32>) -> bool {
    return probe.faces[1].w == key_of(place) && probe.faces[0].w > 0u;
}

/// Light of a place.
struct Lit {
    /// As `Probe` has it, times `count`.
    faces: array<vec3<f32>, 6>,
    /// Places whose light this is: itself or, inside a solid, its neighbours outside. 0 where none is
    /// known.
    count: f32,
}

fn lit(place: vec3<i32>) -> Lit {
    let own = probes[slot_of(place)];
    var light = array<vec3<f32>, 6>();
    var count = 0.0;
    if holds(own, place) {
        for (var face = 0u; face < 6u; face++) {
            light[face] = bitcast<vec3<f32>>(own.faces[face].xyz);
        }
        count = 1.0;
    } else if own.faces[1].w == key_of(place) {
        for (var k = 0u; k < NEIGHBOURS; k++) {
            let beside = place + neighbour(k);
            let within = beside - volume.base;
            if (own.faces[3].w & (1u << k)) == 0u || any(within < vec3(0)) || any(within >= PLACES) {
                continue;
            }
            let other = probes[slot_of(beside)];
            if holds(other, beside) {
                for (var face = 0u; face < 6u; face++) {
                    light[face] += bitcast<vec3<f32>>(other.faces[face].xyz);
                }
                count += 1.0;
            }
        }
    }
    return Lit(light, count);
}

@compute @workgroup_size(4, 4, 4)
fn fill(@builtin(global_invocation_id) id: vec3<u32>) {
    let found = lit(volume.base + vec3<i32>(id));
    let border = vec3<f32>(min(id, vec3<u32>(PLACES) - 1u - id));
    let shown = saturate((min(min(border.x, border.y), border.z) + 0.5) / FADE) * volume.exposure / max(found.count, 1.0);
    for (var face = 0u; face < 6u; face++) {
        store(id, face, min(found.faces[face] * shown, vec3(65000.0)));
    }
}

@compute @workgroup_size(4, 4, 4)
fn blacken(@builtin(global_invocation_id) id: vec3<u32>) {
    for (var face = 0u; face < 6u; face++) {
        store(id, face, vec3(0.0));
    }
}
