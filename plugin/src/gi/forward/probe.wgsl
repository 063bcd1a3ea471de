// A place of the grid around a camera, and the light that is kept there.
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
