// Importance points: surface points that stand for all visible surfaces (or, for bounces, for all
// patches), and the geometry term between them and a texel.
#define_import_path bevy_frugal_gi::gi::vpl::importance

struct ImportancePoint {
    /// World space, metres.
    position: vec3<f32>,
    /// Squared radius of the disk that it stands for, m²; 0 where there is no surface.
    radius_squared: f32,
    /// World space, unit length.
    normal: vec3<f32>,
    /// Width of its pixel, metres.
    pixel_width: f32,
}

/// Columns and rows of the grid over the image, with one point in each rectangle.
const COLUMNS: u32 = 8u;
const ROWS: u32 = 4u;
const IMPORTANCE_POINTS: u32 = COLUMNS * ROWS;

struct ImportancePoints {
    /// Defensive-sampling term: added to the importance of every texel, 1/m².
    defensive_term: f32,
    points: array<ImportancePoint, IMPORTANCE_POINTS>,
}

/// Importance of a surface point to an importance point: their unoccluded geometry term, 1/m².
fn importance_of(point: ImportancePoint, position: vec3<f32>, normal: vec3<f32>) -> f32 {
    let to_point = position - point.position;
    let square = clamp(dot(to_point, to_point), 1e-18, 1e30);
    let cosines = max(dot(point.normal, to_point), 0.0) * max(-dot(normal, to_point), 0.0) / square;
    return select(0.0, cosines / (square + point.radius_squared), point.radius_squared > 0.0);
}
