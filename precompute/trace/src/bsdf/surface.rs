//! The surface at a ray's hit.

use glam::{DVec3, Vec3};

use crate::scene::{AlphaMode, Hit, SceneGeometry, SceneMaterial, Side};

/// Offset of ray origins above a surface, in single-precision steps at the greatest coordinate. The
/// only rounding to single precision is that of the origin: half a step on each axis.
const ORIGIN_OFFSET_STEPS: f64 = 4.0;
/// Least offset, for coordinates near 0, metres.
const LEAST_ORIGIN_OFFSET: f64 = 1e-9;

/// A surface point, seen from one side.
pub(crate) struct Surface<'a> {
    /// World space, metres.
    pub(crate) position: DVec3,
    /// Geometric normal on the side of the hit, unit length.
    pub(crate) geometric_normal: DVec3,
    /// Interpolated (shading) normal, unit length; in the hemisphere of the geometric normal.
    pub(crate) normal: DVec3,
    /// Linear RGB: material × vertex colour × texture.
    pub(crate) base_color: DVec3,
    /// In [0, 1]: material × texture.
    pub(crate) metallic: f64,
    /// In [0, 1]: material × texture.
    pub(crate) perceptual_roughness: f64,
    /// Emission, nits: material × texture.
    pub(crate) emission: DVec3,
    /// The material.
    pub(crate) material: &'a SceneMaterial,
}

impl<'a> Surface<'a> {
    /// The surface at `hit`; the geometry must be [valid](SceneGeometry::validate).
    pub(crate) fn new(geometry: &'a SceneGeometry, hit: &Hit) -> Self {
        let corners = hit.triangle.corners.map(|corner| corner.as_dvec3());
        let mesh = &geometry.meshes[hit.triangle.mesh];
        let weights = hit.exact_weights();
        let sign = if hit.side == Side::Front { 1.0 } else { -1.0 };
        let geometric_normal =
            (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize_or(DVec3::Y) * sign;
        let corner_normals = geometry.corners(hit).map(|corner| mesh.normals[corner].as_dvec3());
        let [a, b, c] = corner_normals;
        let normal = a * weights[0] + b * weights[1] + c * weights[2];
        let normal = normal.normalize_or_zero() * sign;
        // A shading normal on the far side of its triangle, or an invalid one, would leak light. A
        // normal that only faces away from the viewer, as at the outline of a faceted sphere, is
        // kept, as in Bevy.
        let normal = if normal.is_finite() && normal.dot(geometric_normal) > 0.0 {
            normal
        } else {
            geometric_normal
        };
        let [red, green, blue, _] = geometry.base_color(hit);
        let (metallic, perceptual_roughness) = geometry.metallic_roughness(hit);
        Self {
            // Relative to the first corner, so that rounding of the weights keeps the point in the
            // triangle's plane.
            position: corners[0]
                + (corners[1] - corners[0]) * weights[1]
                + (corners[2] - corners[0]) * weights[2],
            geometric_normal,
            normal,
            base_color: DVec3::new(red, green, blue),
            metallic,
            perceptual_roughness,
            emission: geometry.emission(hit),
            material: geometry.material(hit),
        }
    }

    /// Origin of rays that leave the surface: offset along the geometric normal on the side of the
    /// hit.
    pub(crate) fn ray_origin(&self) -> Vec3 {
        let step = self.position.abs().max_element() * f64::from(f32::EPSILON);
        (self.position + self.geometric_normal * (ORIGIN_OFFSET_STEPS * step + LEAST_ORIGIN_OFFSET))
            .as_vec3()
    }
}

/// Whether the alpha mask cuts out the point of `hit`.
pub(crate) fn is_cut_out(geometry: &SceneGeometry, hit: &Hit) -> bool {
    match geometry.material(hit).alpha {
        AlphaMode::Opaque => false,
        AlphaMode::Mask(cutoff) => geometry.base_color(hit)[3] < f64::from(cutoff),
    }
}
