//! Points evenly distributed on a surface, each for a piece of it: plain Rust, no renderer.
//!
//! Laid out once in the mesh's own space, evenly by area and in Morton order (neighbours in space
//! are neighbours in the list): the same surface keeps its points while it or anything else moves.

use bevy::math::{Affine3A, DVec3, Mat3A, Vec3, VectorSpace};

/// Triangles beyond this, metres, are left out: their areas, and tests of their boxes, would leave
/// the range of a float.
pub(in crate::gi) const MAX_COORDINATE: f32 = 1e15;

/// A point on a triangle of a mesh.
#[derive(Clone, Copy, Debug)]
pub(in crate::gi) struct TrianglePoint {
    /// The triangle's index.
    pub triangle: usize,
    /// Barycentric weights of its second and third corner.
    pub weights: [f32; 2],
}

/// Interpolates an attribute of a triangle's corners. Barycentric weights: of the second and third.
pub(super) fn interpolated<V: VectorSpace<Scalar = f32>>(
    [a, b, c]: [V; 3],
    [second, third]: [f32; 2],
) -> V {
    a + (b - a) * second + (c - a) * third
}

/// A point of a surface, in the mesh's own space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::gi) struct SurfacePoint<S> {
    pub position: Vec3,
    /// Unit length.
    pub normal: Vec3,
    /// Material or colour there.
    pub sample: S,
}

/// Points of a surface, in Morton order.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::gi) struct SurfacePoints<S> {
    pub points: Vec<SurfacePoint<S>>,
    /// Area of each point's piece, in the mesh's own space, m².
    pub area: f64,
}

impl<S> SurfacePoints<S> {
    /// `count` points on `triangles`; `None` where these have no area. `sample` evaluates the
    /// material at each.
    pub(crate) fn new(
        triangles: &[[Vec3; 3]],
        count: usize,
        sample: impl Fn(TrianglePoint) -> S,
    ) -> Option<Self> {
        let mut total = 0.0;
        let cumulative: Vec<f64> = triangles
            .iter()
            .map(|triangle| {
                let own = area_vector(triangle).length();
                total += if is_in_range(triangle) && own.is_finite() { own } else { 0.0 };
                total
            })
            .collect();
        if total <= 0.0 || count == 0 {
            return None;
        }
        let mut points: Vec<SurfacePoint<S>> = (0..count)
            .filter_map(|index| {
                let target = (index as f64 + 0.5) / count as f64 * total;
                let triangle =
                    cumulative.partition_point(|sum| *sum <= target).min(triangles.len() - 1);
                let before = triangle.checked_sub(1).map_or(0.0, |before| cumulative[before]);
                // The position within the triangle's share is one coordinate, multiples of the
                // golden ratio the other: evenly distributed, however many points a triangle has.
                let along = ((target - before) / (cumulative[triangle] - before)).clamp(0.0, 1.0);
                let across = (index as f64 * 0.618_033_988_749_895).fract();
                // Uniform over the triangle: Turk 1990, "Generating Random Points in Triangles".
                let root = along.sqrt();
                let weights = [(root * (1.0 - across)) as f32, (root * across) as f32];
                let normal = area_vector(&triangles[triangle]).try_normalize()?.as_vec3();
                let position = interpolated(triangles[triangle], weights);
                Some(SurfacePoint {
                    position,
                    normal,
                    sample: sample(TrianglePoint { triangle, weights }),
                })
            })
            .collect();
        sort_by_position(&mut points);
        Some(Self { points, area: total / count as f64 })
    }
}

/// Normal × area, m².
fn area_vector([a, b, c]: &[Vec3; 3]) -> DVec3 {
    0.5 * (*b - *a).as_dvec3().cross((*c - *a).as_dvec3())
}

/// Whether all corners are finite and within [`MAX_COORDINATE`].
pub(in crate::gi) fn is_in_range(triangle: &[Vec3; 3]) -> bool {
    triangle.iter().all(|corner| corner.is_finite() && corner.abs().max_element() < MAX_COORDINATE)
}

/// The cofactor matrix, which transforms normal × area from the mesh to the world. A mirrored mesh
/// keeps the side from which its triangles run counter-clockwise.
pub(in crate::gi) fn area_matrix(affine: &Affine3A) -> Mat3A {
    let Mat3A { x_axis, y_axis, z_axis } = affine.matrix3;
    Mat3A::from_cols(y_axis.cross(z_axis), z_axis.cross(x_axis), x_axis.cross(y_axis))
}

/// Orders points along a Morton curve through the box around them.
fn sort_by_position<S>(points: &mut [SurfacePoint<S>]) {
    let least = points.iter().fold(Vec3::INFINITY, |least, point| least.min(point.position));
    let most = points.iter().fold(Vec3::NEG_INFINITY, |most, point| most.max(point.position));
    let size = (most - least).max_element().max(f32::MIN_POSITIVE);
    let spread = |value: f32| {
        let bits = (value / size * 1023.0) as u32;
        (0..10).map(|bit| (bits >> bit & 1) << (3 * bit)).sum::<u32>()
    };
    points.sort_by_cached_key(|point| {
        let Vec3 { x, y, z } = point.position - least;
        spread(x) | spread(y) << 1 | spread(z) << 2
    });
}
