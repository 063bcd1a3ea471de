//! A scene out of an app's world.

use frugal_trace::light::Light;
use frugal_trace::scene::{SceneGeometry, SkyMap};
use serde::{Deserialize, Serialize};

/// The environment: light from all directions, and background.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub enum ExtractedSky {
    /// None.
    #[default]
    Black,
    /// The same luminance from all directions, linear RGB, nits.
    Constant([f32; 3]),
    /// A map, and the nits that its value 1 stands for.
    Map(SkyMap, f32),
}

/// What an app shows to a camera.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ExtractedScene {
    /// Triangles in world space with their materials.
    pub geometry: SceneGeometry,
    /// Lights.
    pub lights: Vec<Light>,
    /// Environment.
    pub sky: ExtractedSky,
    /// Exposure value at ISO 100.
    pub exposure_ev100: f32,
    /// Vertical field of view, degrees.
    pub vertical_fov_degrees: f32,
    /// Distance of the near plane, metres.
    pub near: f32,
    /// Distance of the far plane, metres.
    pub far: f32,
    /// What is shown and not represented here, or not as it is shown: one line per kind, with the
    /// names of those concerned.
    pub gaps: Vec<String>,
}
