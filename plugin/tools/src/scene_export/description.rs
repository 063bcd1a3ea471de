//! The text of a scene file.

use std::collections::BTreeMap;

use bevy::math::Vec3;
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

/// A scene, but for its geometry.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct SceneData {
    pub lights: Vec<LightData>,
    /// Nits.
    pub ambient: [f32; 3],
    /// Whether the app has an environment map, which is not exported.
    pub has_environment_map: bool,
    pub exposure_ev100: f32,
    /// Degrees.
    pub vertical_fov: f32,
    pub near: f32,
    pub far: f32,
    pub bounds: (Vec3, Vec3),
    /// The first one is the path `tour`.
    pub tours: Vec<Vec<Key>>,
}

/// The file, as the tool reads it.
#[derive(Serialize)]
struct SceneFile<'a> {
    geometry: Geometry<'a>,
    lights: &'a [LightData],
    environment: Environment,
    exposure_ev100: f32,
    camera: Lens,
    bounds: Bounds,
    paths: BTreeMap<String, Vec<PathKey>>,
}

#[derive(Serialize)]
enum Geometry<'a> {
    Gltf(&'a str),
}

#[derive(Serialize)]
enum Environment {
    None,
    Constant([f32; 3]),
}

#[derive(Serialize)]
struct Lens {
    vertical_fov: f32,
    near: f32,
    far: f32,
}

#[derive(Serialize)]
struct Bounds {
    min: [f32; 3],
    max: [f32; 3],
}

#[derive(Serialize)]
struct PathKey {
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

impl SceneData {
    /// The file's text, for geometry in `glb` beside it.
    ///
    /// # Errors
    /// None that is known: the serializer's own.
    pub(super) fn to_ron(&self, glb: &str) -> ron::Result<String> {
        let path = |(number, tour): (usize, &Vec<Key>)| {
            let name = if number == 0 { "tour".into() } else { format!("camera-{}", number + 1) };
            (name, tour.iter().map(PathKey::of).collect())
        };
        let tours = self.tours.iter().enumerate().filter(|(_, tour)| !tour.is_empty());
        let file = SceneFile {
            geometry: Geometry::Gltf(glb),
            lights: &self.lights,
            environment: match self.ambient {
                [0.0, 0.0, 0.0] => Environment::None,
                ambient => Environment::Constant(ambient),
            },
            exposure_ev100: self.exposure_ev100,
            camera: Lens { vertical_fov: self.vertical_fov, near: self.near, far: self.far },
            bounds: Bounds { min: self.bounds.0.to_array(), max: self.bounds.1.to_array() },
            paths: tours.map(path).collect(),
        };
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
        text.push_str(&ron::ser::to_string_pretty(&file, layout)?);
        text.push('\n');
        Ok(text)
    }
}
