//! The text of a scene file.

use std::fmt::Write;

use bevy::math::Vec3;

use super::tour::Key;

/// Distance of a path's look-at point from the camera, metres: any will do.
const LOOK_AT_DISTANCE: f32 = 5.0;

/// A light, in the units of a scene file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum LightData {
    Directional {
        direction: Vec3,
        illuminance: f32,
        color: [f32; 3],
    },
    Point {
        position: Vec3,
        luminous_power: f32,
        range: f32,
        color: [f32; 3],
    },
    /// Angles are half angles, degrees.
    Spot {
        position: Vec3,
        direction: Vec3,
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

fn vector(value: Vec3) -> String {
    numbers(value.to_array())
}

fn numbers(values: [f32; 3]) -> String {
    let [x, y, z] = values;
    format!("({x:?}, {y:?}, {z:?})")
}

impl LightData {
    fn to_ron(self) -> String {
        match self {
            Self::Directional { direction, illuminance, color } => format!(
                "Directional(direction: {}, illuminance: {illuminance:?}, color: {})",
                vector(direction),
                numbers(color)
            ),
            Self::Point { position, luminous_power, range, color } => format!(
                "Point(position: {}, luminous_power: {luminous_power:?}, range: {range:?}, color: {})",
                vector(position),
                numbers(color)
            ),
            Self::Spot {
                position,
                direction,
                luminous_power,
                range,
                inner_angle,
                outer_angle,
                color,
            } => format!(
                "Spot(position: {}, direction: {}, luminous_power: {luminous_power:?}, range: {range:?}, \
                 inner_angle: {inner_angle:?}, outer_angle: {outer_angle:?}, color: {})",
                vector(position),
                vector(direction),
                numbers(color)
            ),
        }
    }
}

impl SceneData {
    /// The file's text, for geometry in `glb` beside it.
    pub(super) fn to_ron(&self, glb: &str) -> String {
        let mut text = String::from("// Written by bevy_frugal_gi's SceneExportPlugin.\n(\n");
        let mut line = |line: String| {
            let _ = writeln!(text, "    {line}");
        };
        line(format!("geometry: Gltf({glb:?}),"));
        line("lights: [".into());
        self.lights.iter().for_each(|light| line(format!("    {},", light.to_ron())));
        line("],".into());
        if self.has_environment_map {
            line("// The app's environment map is not exported. Name an equirectangular image of it:".into());
            line("// environment: Map(\"sky.hdr\", nits),".into());
        }
        if self.ambient == [0.0; 3] {
            line("environment: None,".into());
        } else {
            line("// Ambient light of the app.".into());
            line(format!("environment: Constant({}),", numbers(self.ambient)));
        }
        line(format!("exposure_ev100: {:?},", self.exposure_ev100));
        line(format!(
            "camera: (vertical_fov: {:?}, near: {:?}, far: {:?}),",
            self.vertical_fov, self.near, self.far
        ));
        line("// Where cameras go: narrow it to where players get.".into());
        let (min, max) = self.bounds;
        line(format!("bounds: (min: {}, max: {}),", vector(min), vector(max)));
        line("paths: {".into());
        for (number, tour) in self.tours.iter().enumerate().filter(|(_, tour)| !tour.is_empty()) {
            let name = if number == 0 { "tour".into() } else { format!("camera-{}", number + 1) };
            line(format!("    {name:?}: ["));
            for key in tour {
                let look_at = key.position + LOOK_AT_DISTANCE * key.forward;
                line(format!(
                    "        (time: {:?}, position: {}, look_at: {}),",
                    key.seconds as f32,
                    vector(key.position),
                    vector(look_at)
                ));
            }
            line("    ],".into());
        }
        line("},".into());
        text.push_str(")\n");
        text
    }
}
