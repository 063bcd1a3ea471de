//! The contents of a `*.scene.ron` file. [`load`](super::load()) reads and checks one.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use frugal_trace::light::Light;
use frugal_trace::scene::Bounds;
use serde::{Deserialize, Serialize};

use super::path::CameraPath;

/// A scene: geometry, lights, and camera space. Every field but the geometry has a default.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneDescription {
    /// The geometry.
    pub geometry: Geometry,
    /// The lights; none by default.
    #[serde(default)]
    pub lights: Vec<Light>,
    /// The environment; none by default.
    #[serde(default)]
    pub environment: Environment,
    /// Exposure value at ISO 100, in [−20, 30]: 12 by default, between a lit interior (6) and a
    /// sunny day (15).
    #[serde(default = "default_exposure")]
    pub exposure_ev100: f32,
    /// The lens of all cameras.
    #[serde(default)]
    pub camera: Camera,
    /// Camera space, the octree's root; by default the geometry's bounding box minus a margin, see
    /// [`camera_bounds`](super::LoadedScene::camera_bounds).
    #[serde(default)]
    pub bounds: Option<Bounds>,
    /// Camera paths by name; none by default.
    #[serde(default)]
    pub paths: BTreeMap<String, CameraPath>,
    /// The file of the description: paths in it are relative to that file's folder. Empty for a
    /// description made in code.
    #[serde(skip)]
    pub source: PathBuf,
}

/// A scene's geometry.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Geometry {
    /// A `.glb` or `.gltf` file, relative to the description.
    Gltf(String),
    /// A scene that comes with the tool: one of `BUILT_IN`.
    Procedural(String),
}

/// A scene's environment light and background.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Environment {
    /// Black.
    #[default]
    None,
    /// The same luminance in every direction, linear RGB, nits, each at least 0.
    Constant([f32; 3]),
    /// An equirectangular image, relative to the description, and the nits that its value 1 stands
    /// for, at least 0.
    Map(String, f32),
}

impl Environment {
    /// Whether any light comes from it.
    pub(crate) fn sends_light(&self) -> bool {
        match self {
            Self::None => false,
            Self::Constant(radiance) => *radiance != [0.0; 3],
            Self::Map(_, intensity) => *intensity > 0.0,
        }
    }
}

/// The lens of a scene's cameras.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Camera {
    /// Vertical field of view, degrees, in (0, 180); 60 by default.
    pub vertical_fov: f32,
    /// Distance of the near plane, metres, greater than 0; 0.1 by default.
    pub near: f32,
    /// Distance of the far plane, metres, greater than `near`; 200 by default.
    pub far: f32,
}

impl Default for Camera {
    fn default() -> Self {
        Self { vertical_fov: 60.0, near: 0.1, far: 200.0 }
    }
}

impl SceneDescription {
    /// A description of `geometry` with every default.
    pub fn new(geometry: Geometry) -> Self {
        Self {
            geometry,
            lights: Vec::new(),
            environment: Environment::default(),
            exposure_ev100: default_exposure(),
            camera: Camera::default(),
            bounds: None,
            paths: BTreeMap::new(),
            source: PathBuf::new(),
        }
    }

    /// Resolves the path of a file that the description names.
    pub fn resolve(&self, file: &str) -> PathBuf {
        self.source.parent().unwrap_or(Path::new("")).join(file)
    }
}

fn default_exposure() -> f32 {
    12.0
}

/// The scenes that come with the tool: the same files as in `assets/scenes`.
///
/// | name | purpose |
/// |---|---|
/// | `cornell` | colour bleeding and one-bounce light that can be compared with the literature |
/// | `courtyard` | the showcase: sun, shade, drapes, thin and finely textured objects, where every knob has an effect |
/// | `two_rooms` | light leaks: one room is lit, the other must stay black |
/// | `furnace` | energy conservation: the inside of a white sphere, with a closed-form solution |
/// | `hall` | dozens of lights: sixteen rooms with doorways between them |
pub(super) const BUILT_IN: [&str; 5] = ["cornell", "courtyard", "two_rooms", "furnace", "hall"];

/// The glTF file of the scene called `name`; `None` for a name that is not in [`BUILT_IN`].
pub(super) fn glb(name: &str) -> Option<&'static [u8]> {
    Some(match name {
        "cornell" => include_bytes!("../../../assets/scenes/cornell.glb"),
        "courtyard" => include_bytes!("../../../assets/scenes/courtyard.glb"),
        "two_rooms" => include_bytes!("../../../assets/scenes/two_rooms.glb"),
        "furnace" => include_bytes!("../../../assets/scenes/furnace.glb"),
        "hall" => include_bytes!("../../../assets/scenes/hall.glb"),
        _ => return None,
    })
}

#[cfg(test)]
#[path = "built_in_tests.rs"]
mod built_in_tests;
