// The surface points that stand for what a camera sees, and what they could receive of a texel.
#define_import_path bevy_frugal_gi::gi::vpl::receivers

struct Receiver {
    /// World space, metres.
    position: vec3<f32>,
    /// Square of the radius that it stands for, m²; 0 for none.
    radius_squared: f32,
    /// World space, unit length.
    normal: vec3<f32>,
    /// Of the pixel that shows it, metres.
    pixel_width: f32,
}

/// Columns and rows of the grid over the picture, in whose cells they lie.
const COLUMNS: u32 = 8u;
const ROWS: u32 = 4u;
const RECEIVERS: u32 = COLUMNS * ROWS;

struct Receivers {
    /// Added to what any texel sends to the receivers, 1/m².
    floor: f32,
    points: array<Receiver, 32>,
}

/// What a receiver would get of light from a point of a surface if nothing stood between, 1/m².
fn from_point(receiver: Receiver, position: vec3<f32>, normal: vec3<f32>) -> f32 {
    let way = position - receiver.position;
    let square = clamp(dot(way, way), 1e-18, 1e30);
    let cosines = max(dot(receiver.normal, way), 0.0) * max(-dot(normal, way), 0.0) / square;
    return select(0.0, cosines / (square + receiver.radius_squared), receiver.radius_squared > 0.0);
}
