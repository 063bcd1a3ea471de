//! Curved sheets, and spot lights at them.

use frugal_trace::integrator::ReferenceScene;
use frugal_trace::light::{Light, Sky};
use frugal_trace::scene::{RayScene, SceneGeometry, SceneMaterial, SceneMesh};
use glam::Vec3;

/// A sheet of `columns` × `rows` cells with smooth normals, which is where `at` puts (s, t) in [0, 1]².
pub(crate) fn sheet([columns, rows]: [u32; 2], at: impl Fn(f32, f32) -> Vec3) -> SceneMesh {
    let mut mesh = SceneMesh::default();
    for (row, column) in (0..=rows).flat_map(|row| (0..=columns).map(move |column| (row, column))) {
        let (s, t) = (column as f32 / columns as f32, row as f32 / rows as f32);
        let slope = |ds: f32, dt: f32| at(s + ds, t + dt) - at(s - ds, t - dt);
        mesh.positions.push(at(s, t));
        mesh.normals.push(slope(1e-3, 0.0).cross(slope(0.0, 1e-3)).normalize_or_zero());
        if row < rows && column < columns {
            let first = row * (columns + 1) + column;
            let corners = [0, 1, columns + 2, 0, columns + 2, columns + 1];
            mesh.indices.extend(corners.map(|corner| first + corner));
        }
    }
    mesh
}

/// A spot light from a place at another, half of whose angle is `degrees`.
pub(crate) fn spot(from: [f32; 3], to: [f32; 3], degrees: f32) -> Light {
    let (position, to) = (Vec3::from(from), Vec3::from(to));
    Light::Spot {
        position,
        direction: to - position,
        luminous_power: 1e4,
        range: 1e3,
        inner_angle: degrees * 0.9,
        outer_angle: degrees,
        color: [1.0; 3],
    }
}

/// A scene of meshes, each with its material.
pub(crate) fn scene(parts: Vec<(SceneMaterial, SceneMesh)>, lights: &[Light]) -> ReferenceScene {
    let mut geometry = SceneGeometry::default();
    for (material, mesh) in parts {
        geometry.meshes.push(SceneMesh { material: geometry.materials.len(), ..mesh });
        geometry.materials.push(material);
    }
    let rays = RayScene::from_geometry(&geometry);
    ReferenceScene::new(geometry.into(), rays.into(), lights, Sky::Black).expect("valid geometry")
}
