//! What the path tracer and cameras in free space need of an app's world.

use bevy::camera::{Exposure, Projection};
use bevy::ecs::entity::Entity;
use bevy::ecs::world::World;
use frugal_trace::light::Light;
use frugal_trace::scene::{SceneGeometry, SkyMap};
use serde::{Deserialize, Serialize};

/// A scene as a path tracer needs it, out of an app's world.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ExtractedScene {
    /// Triangles, materials and textures.
    pub geometry: SceneGeometry,
    /// Punctual lights.
    pub lights: Vec<Light>,
    /// Light of what surrounds it.
    pub sky: ExtractedSky,
    /// Exposure value at ISO 100 of the camera.
    pub exposure_ev100: f32,
    /// The camera's vertical field of view, degrees.
    pub vertical_fov_degrees: f32,
    /// Distance of the camera's near plane, metres.
    pub near: f32,
    /// Distance of the camera's far plane, metres.
    pub far: f32,
    /// What this cannot represent, as sentences.
    pub gaps: Vec<String>,
}

/// The sky of an extracted scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum ExtractedSky {
    /// None.
    Black,
    /// The same luminance in every direction, linear RGB, nits.
    Constant([f32; 3]),
    /// A map, and the nits that its value 1 stands for.
    Map(SkyMap, f32),
}

/// The scene that `camera` sees.
pub fn extract(world: &mut World, camera: Option<Entity>) -> ExtractedScene {
    let lens = camera.and_then(|camera| world.get::<Projection>(camera));
    let (fov, near, far) = match lens {
        Some(Projection::Perspective(lens)) => (lens.fov.to_degrees(), lens.near, lens.far),
        _ => (60.0, 0.1, 200.0),
    };
    let exposure = camera.and_then(|camera| world.get::<Exposure>(camera)).copied();
    ExtractedScene {
        geometry: SceneGeometry::default(),
        lights: Vec::new(),
        sky: ExtractedSky::Black,
        exposure_ev100: exposure.unwrap_or_default().ev100,
        vertical_fov_degrees: fov,
        near,
        far,
        gaps: vec!["its geometry and lights are not extracted".to_owned()],
    }
}
