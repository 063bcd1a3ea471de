//! Ray queries over a scene's triangles: closest and any hit, visibility of geometry from a camera,
//! inside tests.
//!
//! The tree is obvhs's compressed eight-wide one (Ylitie et al. 2017, "Efficient Incoherent Ray
//! Traversal on GPUs Through Compressed Wide BVHs"); the triangle test is ours (Möller and Trumbore
//! 1997) in double precision with a slightly widened triangle, because a ray through the seam of a
//! closed solid would make its inside look open.

use std::time::Duration;

use glam::{DVec3, Quat, Vec3};
use obvhs::BvhBuildParams;
use obvhs::cwbvh::{CwBvh, builder::build_cwbvh_from_tris};
use obvhs::ray::{Ray, RayHit};

use super::{SceneGeometry, Triangle};

/// Widening of triangles beyond their edges, in barycentric units.
const EDGE_TOLERANCE: f64 = 1e-6;
/// Triangles with a smaller area, m², have no defined side and are left out.
const LEAST_AREA: f64 = 1e-14;
/// Positions beyond this, metres, are left out: the tree's box arithmetic would overflow.
const GREATEST_COORDINATE: f32 = 1e15;
/// Greatest coordinate in the tree. The tree skips boxes that end less than 0.0001 of its units
/// ahead of a ray's origin, which in a small or finely modelled scene lets rays through walls: so
/// its unit is a fraction of a metre, chosen so that the scene just fits. A power of two:
/// coordinates are scaled without rounding.
const TREE_EXTENT: f32 = 16_777_216.0;
/// Least extent for scaling, metres: with a greater scale, far rays would overflow in the tree's
/// box arithmetic.
const LEAST_EXTENT: f32 = 1e-6;
/// Columns and rows of the ray grid over a camera's image.
const VIEW_GRID: (u32, u32) = (24, 14);
/// Number of rays over the sphere of directions.
const SPHERE_RAY_COUNT: u32 = 64;

/// The side of a triangle that a ray hits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// The side from which its corners are counter-clockwise.
    Front,
    /// The other side.
    Back,
}

/// A ray's hit on the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance along the ray in lengths of its direction: metres if that is a unit vector.
    pub distance: f32,
    /// The side of the triangle.
    pub side: Side,
    /// The triangle.
    pub triangle: Triangle,
    /// Barycentric weights of the triangle's corners at the hit; they sum to 1.
    pub weights: [f32; 3],
}

/// Triangles in a bounding volume hierarchy. Ignores alpha, unless a filter tests it: a cut-out
/// counts as solid.
#[derive(Debug)]
pub struct RayScene {
    triangles: Vec<Triangle>,
    /// The tree of triangles times `scale`; `None` without triangles.
    tree: Option<CwBvh>,
    /// The tree's units in a metre, a power of two.
    scale: f32,
}

impl RayScene {
    /// Builds the tree. Leaves out triangles without area, with corners that are not finite, or
    /// beyond the coordinate limit.
    pub fn new(triangles: impl IntoIterator<Item = Triangle>) -> Self {
        let triangles: Vec<Triangle> = triangles.into_iter().filter(is_usable).collect();
        let extent = triangles
            .iter()
            .flat_map(|triangle| triangle.corners)
            .map(|corner| corner.abs().max_element())
            .fold(0.0, f32::max);
        let scale = 2.0_f32.powi((TREE_EXTENT / extent.max(LEAST_EXTENT)).log2().floor() as i32);
        let boxes: Vec<obvhs::triangle::Triangle> = triangles
            .iter()
            .map(|triangle| {
                let [v0, v1, v2] =
                    triangle.corners.map(|corner| (corner * scale).to_array().into());
                obvhs::triangle::Triangle { v0, v1, v2 }
            })
            .collect();
        let tree = (!boxes.is_empty()).then(|| {
            build_cwbvh_from_tris(&boxes, BvhBuildParams::medium_build(), &mut Duration::default())
        });
        Self { triangles, tree, scale }
    }

    /// The tree of all triangles of `geometry`.
    pub fn from_geometry(geometry: &SceneGeometry) -> Self {
        Self::new(geometry.triangles())
    }

    /// Number of triangles in the tree.
    pub fn triangle_count(&self) -> usize {
        self.triangles.len()
    }

    /// The first triangle that the ray hits in (0, `greatest_distance`], from either side. `None`
    /// also for a ray whose origin or direction is not finite, or whose direction is zero.
    /// Distances are in lengths of `direction`.
    pub fn closest(&self, origin: Vec3, direction: Vec3, greatest_distance: f32) -> Option<Hit> {
        self.closest_where(origin, direction, greatest_distance, |_| true)
    }

    /// [`closest`](Self::closest) among the hits that `accepts` accepts; the ray continues through
    /// the others. `accepts` is called in any order, also for hits that are not the closest.
    pub fn closest_where(
        &self,
        origin: Vec3,
        direction: Vec3,
        greatest_distance: f32,
        accepts: impl Fn(&Hit) -> bool,
    ) -> Option<Hit> {
        let (tree, ray) = self.ray(origin, direction, greatest_distance)?;
        let mut nearest = RayHit::none();
        tree.ray_traverse(ray, &mut nearest, |ray, id| {
            self.distance_where(tree, id, ray, &accepts)
        });
        if nearest.t > ray.tmax || !nearest.t.is_finite() {
            return None;
        }
        let id = nearest.primitive_id as usize;
        self.test(tree, id, &ray)
    }

    /// Whether the ray hits any triangle in (0, `greatest_distance`); arguments as for
    /// [`closest`](Self::closest).
    pub fn any(&self, origin: Vec3, direction: Vec3, greatest_distance: f32) -> bool {
        self.any_where(origin, direction, greatest_distance, |_| true)
    }

    /// [`any`](Self::any) among the hits that `accepts` accepts.
    pub fn any_where(
        &self,
        origin: Vec3,
        direction: Vec3,
        greatest_distance: f32,
        accepts: impl Fn(&Hit) -> bool,
    ) -> bool {
        self.ray(origin, direction, greatest_distance).is_some_and(|(tree, ray)| {
            !tree.ray_traverse_miss(ray, |ray, id| self.distance_where(tree, id, ray, &accepts))
        })
    }

    /// Whether a camera sees any triangle: at least one of a grid of 24 × 14 rays through its image
    /// hits one. Objects thinner than a grid cell may be missed. `vertical_fov` in radians,
    /// `aspect` is width ÷ height.
    pub fn sees_geometry(
        &self,
        position: Vec3,
        rotation: Quat,
        vertical_fov: f32,
        aspect: f32,
    ) -> bool {
        let (columns, rows) = VIEW_GRID;
        let half_height = (vertical_fov * 0.5).tan();
        (0..rows).any(|row| {
            (0..columns).any(|column| {
                let x = (column as f32 + 0.5) / columns as f32 * 2.0 - 1.0;
                let y = (row as f32 + 0.5) / rows as f32 * 2.0 - 1.0;
                self.any(
                    position,
                    rotation * Vec3::new(x * half_height * aspect, y * half_height, -1.0),
                    f32::INFINITY,
                )
            })
        })
    }

    /// Whether `position` is inside a solid, where a camera would see only back faces.
    ///
    /// Of 64 rays distributed uniformly over the sphere, at least 90 % must hit geometry and at
    /// least 70 % of those must hit a back face first. Inside a closed solid all do, except a few
    /// that hit solids that protrude into it. Behind a single sheet, such as a drape, at most about
    /// half do, however near it is; in a room whose walls face inward none do; outdoors most rays
    /// hit nothing. Only the winding of triangles counts, not whether their material is
    /// double-sided. A position enclosed on all sides by double sheets or a closed curtain, backs
    /// inward, is indistinguishable from the inside of a solid and counts as such.
    pub fn inside_geometry(&self, position: Vec3) -> bool {
        let (mut hits, mut backs) = (0_u32, 0_u32);
        for direction in sphere_directions(SPHERE_RAY_COUNT) {
            if let Some(hit) = self.closest(position, direction, f32::INFINITY) {
                hits += 1;
                backs += u32::from(hit.side == Side::Back);
            }
        }
        hits * 10 >= SPHERE_RAY_COUNT * 9 && backs * 10 >= hits * 7
    }

    fn ray(&self, origin: Vec3, direction: Vec3, greatest_distance: f32) -> Option<(&CwBvh, Ray)> {
        let tree = self.tree.as_ref()?;
        let valid = origin.is_finite()
            && origin.abs().max_element() < GREATEST_COORDINATE
            && direction.is_finite();
        // The tree's slab test divides by the direction, which must be neither tiny nor huge.
        let length = direction.length_squared();
        let valid = valid && (1e-12..=1e12).contains(&length) && greatest_distance > 0.0;
        // The tree treats a negative zero as negative in its reciprocal and not in its octants, so
        // that the ray would miss boxes: makes zeros positive.
        let direction = direction + Vec3::ZERO;
        let origin = origin * self.scale;
        valid.then(|| {
            (
                tree,
                Ray::new(
                    origin.to_array().into(),
                    direction.to_array().into(),
                    0.0,
                    greatest_distance * self.scale,
                ),
            )
        })
    }

    /// Distance of an accepted hit in the tree's units, else infinity.
    #[inline]
    fn distance_where(
        &self,
        tree: &CwBvh,
        id: usize,
        ray: &Ray,
        accepts: &impl Fn(&Hit) -> bool,
    ) -> f32 {
        let met = self.test(tree, id, ray).filter(|hit| accepts(hit));
        met.map_or(f32::INFINITY, |hit| hit.distance * self.scale)
    }

    /// The hit, in metres, if the ray, which is in the tree's units, hits the triangle within its
    /// range. Inlined, so that it is only constructed for a filter that reads it.
    #[inline]
    fn test(&self, tree: &CwBvh, id: usize, ray: &Ray) -> Option<Hit> {
        let triangle = self.triangles[*tree.primitive_indices.get(id)? as usize];
        let [a, b, c] = triangle.corners.map(|corner| corner.as_dvec3());
        let metres = f64::from(self.scale.recip());
        let (origin, direction) = (
            DVec3::from(ray.origin.to_array().map(f64::from)) * metres,
            DVec3::from(ray.direction.to_array().map(f64::from)),
        );
        let (ab, ac) = (b - a, c - a);
        let determinant = -direction.dot(ab.cross(ac));
        let inverse = 1.0 / determinant;
        let offset = origin - a;
        let turned = offset.cross(direction);
        let (v, w) = (ac.dot(turned) * inverse, -ab.dot(turned) * inverse);
        let distance = offset.dot(ab.cross(ac)) * inverse;
        // A ray in the triangle's plane makes these infinite or NaN, and every comparison with NaN
        // is false.
        let within = v >= -EDGE_TOLERANCE && w >= -EDGE_TOLERANCE && v + w <= 1.0 + EDGE_TOLERANCE;
        let distance = distance as f32;
        (within && distance > ray.tmin && distance * self.scale <= ray.tmax).then_some(Hit {
            distance,
            side: if determinant > 0.0 { Side::Front } else { Side::Back },
            triangle,
            weights: [(1.0 - v - w) as f32, v as f32, w as f32],
        })
    }
}

fn is_usable(triangle: &Triangle) -> bool {
    let [a, b, c] = triangle.corners;
    let finite = [a, b, c]
        .iter()
        .all(|corner| corner.is_finite() && corner.abs().max_element() < GREATEST_COORDINATE);
    let area: DVec3 = (b.as_dvec3() - a.as_dvec3()).cross(c.as_dvec3() - a.as_dvec3());
    finite && area.length() * 0.5 > LEAST_AREA
}

/// `count` unit vectors distributed uniformly over the sphere: a Fibonacci spiral (Swinbank and
/// Purser 2006), points at the centres of equal-area bands.
pub fn sphere_directions(count: u32) -> impl Iterator<Item = Vec3> {
    let golden_angle = std::f32::consts::PI * (3.0 - 5.0_f32.sqrt());
    (0..count).map(move |i| {
        let y = 1.0 - (i as f32 + 0.5) / count as f32 * 2.0;
        let radius = (1.0 - y * y).max(0.0).sqrt();
        let angle = golden_angle * i as f32;
        Vec3::new(radius * angle.cos(), y, radius * angle.sin())
    })
}

#[cfg(test)]
#[path = "rays_tests.rs"]
mod tests;
