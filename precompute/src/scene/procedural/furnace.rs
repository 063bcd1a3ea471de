//! The inside of a closed white sphere. With albedo ρ and a point light of Φ lumens at its centre,
//! the wall's direct illuminance is Φ ÷ 4πr² and every bounce adds ρ times the one before,
//! uniformly: a test of energy conservation without a reference image.

use crate::scene::builder::MeshBuilder;
use crate::scene::{SceneGeometry, SceneMaterial};
use glam::Vec3;

/// Reflectance of the wall.
const ALBEDO: f32 = 0.8;
/// Metres.
const RADIUS: f32 = 2.0;

pub(super) fn build() -> SceneGeometry {
    let mut builder = MeshBuilder::new();
    // Four splits: 5,120 triangles.
    builder.tint([ALBEDO; 3]).icosphere(Vec3::ZERO, RADIUS, 4, true);
    SceneGeometry {
        meshes: vec![builder.finish(0)],
        // No specular reflection, so that the wall is a Lambertian reflector.
        materials: vec![SceneMaterial { reflectance: 0.0, ..SceneMaterial::default() }],
        ..SceneGeometry::default()
    }
}
