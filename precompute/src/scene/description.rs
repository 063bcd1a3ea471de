//! The contents of a `*.scene.ron` file. [`load`](super::load::load) reads and checks one.

use super::{Bounds, CameraPath};
use glam::Vec3;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Default margin of the camera bounds, as a share of the geometry's extent at each side: walls are
/// seldom thinner.
const DEFAULT_BOUNDS_MARGIN: f32 = 0.1;

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
    /// Camera space; by default the geometry's bounding box minus a margin, see
    /// [`camera_bounds`](Self::camera_bounds).
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
    /// Procedural: one of `NAMES` in `scene/procedural`.
    Procedural(String),
}

/// A light. Colours are linear RGB that scale the light, each at least 0; quantities are
/// photometric.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Light {
    /// Parallel light, such as the sun's.
    Directional {
        /// Direction in which the light travels, not zero; need not be a unit vector.
        #[serde(with = "triple")]
        direction: Vec3,
        /// Illuminance of a surface that faces the light, lux, at least 0.
        illuminance: f32,
        /// Colour; white by default.
        #[serde(default = "white")]
        color: [f32; 3],
    },
    /// A point light.
    Point {
        /// Metres.
        #[serde(with = "triple")]
        position: Vec3,
        /// Luminous power, lumens, at least 0.
        luminous_power: f32,
        /// Range, metres, greater than 0: there is no light beyond it; 30 by default.
        #[serde(default = "default_range")]
        range: f32,
        /// Colour; white by default.
        #[serde(default = "white")]
        color: [f32; 3],
    },
    /// A spot light.
    Spot {
        /// Metres.
        #[serde(with = "triple")]
        position: Vec3,
        /// The axis of the cone, not zero; need not be a unit vector.
        #[serde(with = "triple")]
        direction: Vec3,
        /// Luminous power, lumens, at least 0. As in Bevy, that of a point light without the cone:
        /// the cone masks the light and does not concentrate it, so that the intensity on the axis
        /// is power ÷ 4π candela.
        luminous_power: f32,
        /// Range, metres, greater than 0: there is no light beyond it; 30 by default.
        #[serde(default = "default_range")]
        range: f32,
        /// Half angle of the cone that is fully lit, degrees, in [0, `outer_angle`]; 30 by default.
        #[serde(default = "default_inner_angle")]
        inner_angle: f32,
        /// Half angle at which the light ends, degrees, in (0, 90]; 45 by default.
        #[serde(default = "default_outer_angle")]
        outer_angle: f32,
        /// Colour; white by default.
        #[serde(default = "white")]
        color: [f32; 3],
    },
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

    /// The camera space: [`bounds`](Self::bounds), else the geometry's bounding box minus a tenth
    /// of its extent at each side. Without geometry a cubic metre around the origin.
    pub fn camera_bounds(&self, geometry: Option<Bounds>) -> Bounds {
        let fallback = Bounds { min: Vec3::splat(-0.5), max: Vec3::splat(0.5) };
        self.bounds.unwrap_or_else(|| {
            geometry.map_or(fallback, |bounds| bounds.shrunk(DEFAULT_BOUNDS_MARGIN))
        })
    }
}

fn default_exposure() -> f32 {
    12.0
}

fn white() -> [f32; 3] {
    [1.0; 3]
}

fn default_range() -> f32 {
    30.0
}

fn default_inner_angle() -> f32 {
    30.0
}

fn default_outer_angle() -> f32 {
    45.0
}

/// A vector written as `(x, y, z)`: Bevy's own form depends on its enabled features.
pub(super) mod triple {
    use glam::Vec3;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(crate) fn serialize<S: Serializer>(
        vector: &Vec3,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        vector.to_array().serialize(serializer)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Vec3, D::Error> {
        <[f32; 3]>::deserialize(deserializer).map(Vec3::from_array)
    }
}
