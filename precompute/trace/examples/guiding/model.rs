//! Boxes and walls, of which scenes are made.

use frugal_trace::integrator::ReferenceScene;
use frugal_trace::light::{Light, Sky};
use frugal_trace::scene::{RayScene, SceneGeometry, SceneMaterial, SceneMesh};
use glam::{Vec2, Vec3};

/// A surface without gloss, a little yellow.
pub(crate) fn matte(albedo: f32) -> SceneMaterial {
    SceneMaterial {
        base_color: [albedo, albedo * 0.95, albedo * 0.9, 1.0],
        ..SceneMaterial::default()
    }
}

/// A black surface that shines.
pub(crate) fn lamp_of(nits: f32) -> SceneMaterial {
    SceneMaterial { emissive: [nits; 3], ..matte(0.0) }
}

/// Meshes as they are made: one for each material.
#[derive(Default)]
pub(crate) struct Model {
    geometry: SceneGeometry,
}

impl Model {
    /// What follows is of this material.
    pub(crate) fn material(&mut self, material: SceneMaterial) -> &mut Self {
        let index = self.geometry.materials.len();
        self.geometry.materials.push(material);
        self.geometry.meshes.push(SceneMesh { material: index, ..SceneMesh::default() });
        self
    }

    fn quad(&mut self, [a, b, c, d]: [Vec3; 4]) {
        let mesh = self.geometry.meshes.last_mut().expect("a material comes first");
        let first = mesh.positions.len() as u32;
        let normal = (c - a).cross(d - b).normalize();
        for corner in [a, b, c, d] {
            mesh.positions.push(corner);
            mesh.normals.push(normal);
            mesh.uvs.push(Vec2::ZERO);
            mesh.colors.push([1.0; 4]);
        }
        mesh.indices.extend([0, 1, 2, 0, 2, 3].map(|corner| first + corner));
    }

    /// A box seen from outside.
    pub(crate) fn solid(&mut self, min: [f32; 3], max: [f32; 3]) {
        self.faces(min.into(), max.into(), false);
    }

    /// A box seen from inside.
    pub(crate) fn inside(&mut self, min: [f32; 3], max: [f32; 3]) {
        self.faces(min.into(), max.into(), true);
    }

    fn faces(&mut self, min: Vec3, max: Vec3, inward: bool) {
        let (center, half) = (0.5 * (min + max), 0.5 * (max - min));
        for axis in Vec3::AXES.into_iter().flat_map(|axis| [axis, -axis]) {
            let up = if axis.y == 0.0 { Vec3::Y } else { Vec3::Z };
            let right = up.cross(axis) * if inward { -1.0 } else { 1.0 };
            let corner = |r: f32, u: f32| center + (axis + right * r + up * u) * half;
            self.quad([corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)]);
        }
    }

    /// A wall around `center`, `height` metres high, with radii below and above.
    pub(crate) fn wall(&mut self, center: Vec3, below: f32, above: f32, height: f32, sides: u32) {
        let at = |side: u32, radius: f32, y: f32| {
            let (sine, cosine) = (side as f32 / sides as f32 * std::f32::consts::TAU).sin_cos();
            center + Vec3::new(radius * sine, y * height, radius * cosine)
        };
        for side in 0..sides {
            self.quad([
                at(side, below, -0.5),
                at(side + 1, below, -0.5),
                at(side + 1, above, 0.5),
                at(side, above, 0.5),
            ]);
        }
    }

    /// A table and a cupboard for a room of 4 × 5 m.
    pub(crate) fn furniture(&mut self) {
        self.solid([1.4, 0.7, 0.8], [2.8, 0.75, 1.6]);
        for (x, z) in [(1.45, 0.85), (2.7, 0.85), (1.45, 1.5), (2.7, 1.5)] {
            self.solid([x, 0.0, z], [x + 0.05, 0.7, z + 0.05]);
        }
        self.solid([3.4, 0.0, 1.8], [3.99, 1.8, 3.0]);
    }

    /// The scene, under `lights` and `sky`.
    pub(crate) fn scene(self, lights: &[Light], sky: Sky) -> ReferenceScene {
        let rays = RayScene::from_geometry(&self.geometry);
        ReferenceScene::new(self.geometry.into(), rays.into(), lights, sky).expect("valid geometry")
    }
}
