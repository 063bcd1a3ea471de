//! The text of a scene file.

use std::collections::BTreeMap;

use ron::ser::PrettyConfig;
use serde::Serialize;

use super::tour::Key;

/// Distance of a path's look-at point from the camera, metres: any will do.
const LOOK_AT_DISTANCE: f32 = 5.0;

/// A light, in the units of a scene file.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(super) enum LightData {
    Directional {
        direction: [f32; 3],
        illuminance: f32,
        color: [f32; 3],
    },
    Point {
        position: [f32; 3],
        luminous_power: f32,
        range: f32,
        color: [f32; 3],
    },
    /// Angles are half angles, degrees.
    Spot {
        position: [f32; 3],
        direction: [f32; 3],
        luminous_power: f32,
        range: f32,
        inner_angle: f32,
        outer_angle: f32,
        color: [f32; 3],
    },
}

/// The file, as the tool reads it.
#[derive(Serialize)]
pub(super) struct SceneFile {
    pub geometry: Geometry,
    pub lights: Vec<LightData>,
    pub environment: Environment,
    pub exposure_ev100: f32,
    pub camera: Lens,
    pub bounds: Bounds,
    pub paths: BTreeMap<String, Vec<PathKey>>,
    /// Whether the app has an environment map, which is not exported.
    #[serde(skip)]
    pub has_environment_map: bool,
}

#[derive(Serialize)]
pub(super) enum Geometry {
    /// A file beside this one.
    Gltf(String),
}

#[derive(Serialize)]
pub(super) enum Environment {
    None,
    /// Nits.
    Constant([f32; 3]),
}

#[derive(Serialize)]
pub(super) struct Lens {
    /// Degrees.
    pub vertical_fov: f32,
    pub near: f32,
    pub far: f32,
}

#[derive(Serialize)]
pub(super) struct Bounds {
    pub min: [f32; 3],
    pub max: [f32; 3],
}

#[derive(Serialize)]
pub(super) struct PathKey {
    time: f32,
    position: [f32; 3],
    look_at: [f32; 3],
}

impl PathKey {
    fn of(key: &Key) -> Self {
        let look_at = key.position + LOOK_AT_DISTANCE * key.forward;
        Self {
            time: key.seconds as f32,
            position: key.position.to_array(),
            look_at: look_at.to_array(),
        }
    }
}

/// The ways of cameras by name; the first one is the path `tour`.
pub(super) fn paths(tours: &[Vec<Key>]) -> BTreeMap<String, Vec<PathKey>> {
    let path = |(number, tour): (usize, &Vec<Key>)| {
        let name = if number == 0 { "tour".into() } else { format!("camera-{}", number + 1) };
        (name, tour.iter().map(PathKey::of).collect())
    };
    tours.iter().enumerate().filter(|(_, tour)| !tour.is_empty()).map(path).collect()
}

impl SceneFile {
    /// The file's text.
    ///
    /// # Errors
    /// None that is known: the serializer's own.
    pub(super) fn to_ron(&self) -> ron::Result<String> {
        let mut text = String::from(
            "// Written by bevy_frugal_gi's SceneExportPlugin.\n\
             // bounds: where cameras go; narrow it to where players get.\n\
             // environment: the app's ambient light.\n",
        );
        if self.has_environment_map {
            text.push_str(
                "// The app's environment map is not exported. Name an equirectangular image of it:\n\
                 // environment: Map(\"sky.hdr\", nits),\n",
            );
        }
        // Keys and lights take a line each.
        let layout = PrettyConfig::new().depth_limit(3).new_line("\n");
        text.push_str(&ron::ser::to_string_pretty(self, layout)?);
        text.push('\n');
        Ok(text)
    }
}
