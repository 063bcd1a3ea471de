// The grid of the cache: from a point of a surface to cells, at sizes that double from level to level.
//
// A surface is seen along the axis that its normal is nearest to: its cells are squares of the two other
// axes, and layers of the axis. All points of a plane lie in the same layer of a square, however steep
// it is, since the layer is that of the plane at the square's middle, the anchor. Surfaces that face
// other ways have other cells.
#define_import_path bevy_frugal_gi::gi::cache::grid

#import bevy_frugal_gi::gi::view::noise::mixed

/// Side of the smallest cells, metres. No round number: walls and floors are at those, and would lie on
/// the border of two layers.
const SMALLEST: f32 = 0.0437;
/// Side of a cell at an apparent distance of 1 m, metres: 0.9 degrees. Higher values: softer indirect
/// shadows, and fewer cells to light.
const ANGLE: f32 = 0.0157;
/// Levels that a point is stored at: its own, and coarser ones for as long as few samples are known.
const LEVELS: u32 = 4u;
const MOST_LEVELS: f32 = 24.0;

/// A point of a surface, as the grid sees it.
struct Spot {
    /// Along the two axes of the squares, and along the axis that it is seen along, metres.
    at: vec2<f32>,
    height: f32,
    /// Slope of the surface: height over each of the two axes.
    slope: vec2<f32>,
    /// Which way it faces.
    class_bits: u32,
}

/// A cell's place in the table.
struct Key {
    /// Where to look first.
    slot: u32,
    /// Stands for the cell, and is never 0.
    check: u32,
}

/// Level of a surface at an apparent distance, with a fraction.
fn level_at(apparent_distance: f32) -> f32 {
    return clamp(log2(max(apparent_distance, 1e-6) * (ANGLE / SMALLEST)), 0.0, MOST_LEVELS);
}

fn cell_size(level: u32) -> f32 {
    return SMALLEST * exp2(f32(level));
}

/// 0, 1 or 2 for a slope.
fn third(slope: f32) -> u32 {
    return u32(slope > -0.4) + u32(slope > 0.4);
}

/// `position` is relative to the grid's origin.
fn spot_of(position: vec3<f32>, normal: vec3<f32>) -> Spot {
    // Slopes of 45 degrees are common, and lie beside the border, not on it.
    let size = abs(normal) * vec3(1.0, 1.13, 1.06);
    let along_y = size.y >= max(size.x, size.z);
    let along_x = !along_y && size.x >= size.z;
    var point = position;
    var facing = normal;
    if along_y {
        point = position.xzy;
        facing = normal.xzy;
    } else if along_x {
        point = position.yzx;
        facing = normal.yzx;
    }
    let axis = select(select(2u, 0u, along_x), 1u, along_y);
    let slope = clamp(-facing.xy / select(min(facing.z, -0.1), max(facing.z, 0.1), facing.z > 0.0), vec2(-2.0), vec2(2.0));
    let class_bits = ((axis * 2u + u32(facing.z > 0.0)) * 3u + third(slope.x)) * 3u + third(slope.y);
    return Spot(point.xy, point.z, slope, class_bits);
}

/// The square that holds a point, of side `size`.
fn square_of(spot: Spot, size: f32) -> vec2<i32> {
    return vec2<i32>(clamp(floor(spot.at / size), vec2(-1e9), vec2(1e9)));
}

/// The lowest of the four squares whose middles lie around a point.
fn corner_of(spot: Spot, size: f32) -> vec2<i32> {
    return vec2<i32>(clamp(floor(spot.at / size - 0.5), vec2(-1e9), vec2(1e9)));
}

/// Height of the spot's plane in the middle of a square.
fn anchor_height(spot: Spot, square: vec2<i32>, size: f32) -> f32 {
    return spot.height + dot(spot.slope, (vec2<f32>(square) + 0.5) * size - spot.at);
}

/// That middle, relative to the grid's origin.
fn anchor_of(spot: Spot, square: vec2<i32>, size: f32) -> vec3<f32> {
    let point = vec3((vec2<f32>(square) + 0.5) * size, anchor_height(spot, square, size));
    let axis = spot.class_bits / 18u;
    return select(select(point, point.zxy, axis == 0u), point.xzy, axis == 1u);
}

fn key_of(spot: Spot, square: vec2<i32>, level: u32) -> Key {
    let size = cell_size(level);
    // Off the borders, for heights that are 0.
    let layer = i32(clamp(floor(anchor_height(spot, square, size) / size + 0.37), -1e9, 1e9));
    let words = vec4(bitcast<u32>(square.x), bitcast<u32>(square.y), bitcast<u32>(layer), spot.class_bits * 32u + level);
    let slot = mixed(words.x ^ mixed(words.y ^ mixed(words.z ^ mixed(words.w))));
    let check = mixed(words.w + mixed(words.z + mixed(words.y + mixed(words.x + 1u))));
    return Key(slot, max(check, 1u));
}

// What is sampled in a tile: a texel of two words. The first has the pixel, x in its lower half. The
// second has these bits.

/// There is a surface.
const SURFACE: u32 = 1u;
/// It is lit in this frame.
const LIGHTS: u32 = 2u;
/// Levels that it is stored at: a bit each, of the finest first.
const USES: u32 = 16u;
/// What is known of the four cells around it: two bits for each level (see `table.wgsl`).
const LINKS: u32 = 256u;

fn recorded_pixel(record: vec2<u32>) -> vec2<u32> {
    return vec2(record.x & 0xffffu, record.x >> 16u);
}
