//! What an app shows, as plain data for path tracing and ray queries.
//!
//! | module | job |
//! |---|---|
//! | `surface` | meshes where they are drawn, with their materials |
//! | `vertices` | a mesh's vertices, morphed, skinned and placed |
//! | `material` | `StandardMaterial` |
//! | `texture` | images as a shader reads them |
//! | `light`, `sky` | lights; environment light and background |

mod light;
mod material;
mod sky;
mod surface;
#[cfg(test)]
mod tests;
mod texture;
mod vertices;

use std::collections::{BTreeMap, BTreeSet};

use bevy::camera::visibility::RenderLayers;
use bevy::camera::{Exposure, Projection};
use bevy::ecs::entity::Entity;
use bevy::ecs::name::Name;
use bevy::ecs::world::World;
use frugal_trace::light::Light;
use frugal_trace::scene::{SceneGeometry, SkyMap};
use serde::{Deserialize, Serialize};

/// A lens without a perspective camera, as Bevy's default: degrees and metres.
const LENS: (f32, f32, f32) = (45.0, 0.1, 1000.0);
/// Greatest number of names in a line.
const NAMES_SHOWN: usize = 5;

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
    /// Whether the camera has an environment map that sends light, which global illumination gathers.
    /// `sky` may lack it, and may be ambient light, which nothing gathers.
    pub has_environment_map: bool,
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

/// Extracts what the main `world` shows to `camera`: its layers, lens, exposure and sky, or Bevy's
/// defaults without one. Transforms and visibility must be up to date, as after an update.
///
/// A scene is data, and not shaders: what it cannot hold is in [`gaps`](ExtractedScene::gaps).
pub fn extract(world: &mut World, camera: Option<Entity>) -> ExtractedScene {
    let mut gaps = Gaps::default();
    let exposure =
        camera.and_then(|camera| world.get::<Exposure>(camera)).copied().unwrap_or_default();
    let layers =
        camera.and_then(|camera| world.get::<RenderLayers>(camera)).cloned().unwrap_or_default();
    let (vertical_fov_degrees, near, far) = match camera
        .and_then(|camera| world.get::<Projection>(camera))
    {
        Some(Projection::Perspective(lens)) => (lens.fov.to_degrees(), lens.near, lens.far),
        Some(_) => {
            gaps.add("a camera without perspective is traced with Bevy's default lens", "camera");
            LENS
        }
        None => LENS,
    };
    let geometry = surface::geometry(world, &layers, exposure.exposure(), &mut gaps);
    let lights = light::lights(world, &layers, &mut gaps);
    let sky = sky::sky(world, camera, &mut gaps);
    ExtractedScene {
        geometry,
        lights,
        sky,
        has_environment_map: sky::has_environment_map(world, camera),
        exposure_ev100: exposure.ev100,
        vertical_fov_degrees,
        near,
        far,
        gaps: gaps.lines(),
    }
}

/// Gaps of an extraction: by what is missing, in which meshes, materials or lights.
#[derive(Debug, Default)]
struct Gaps(BTreeMap<&'static str, BTreeSet<String>>);

impl Gaps {
    /// Adds `name` to those with the gap `what`, a sentence without its end.
    fn add(&mut self, what: &'static str, name: impl Into<String>) {
        self.0.entry(what).or_default().insert(name.into());
    }

    /// One line per kind of gap.
    fn lines(self) -> Vec<String> {
        self.0.iter().filter_map(|(what, names)| gap_line(what, names)).collect()
    }
}

/// A gap in a line: `what` is missing, a sentence without its end, and the first of the `names` of those
/// that lack it. `None` without names.
pub fn gap_line(what: &str, names: &BTreeSet<String>) -> Option<String> {
    let shown: Vec<&str> = names.iter().take(NAMES_SHOWN).map(String::as_str).collect();
    let more = match names.len() - shown.len() {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    (!shown.is_empty()).then(|| format!("{what}: {}{more}", shown.join(", ")))
}

/// An entity's name, or its number.
fn name(world: &World, entity: Entity) -> String {
    world.get::<Name>(entity).map_or_else(|| entity.to_string(), |name| name.as_str().to_owned())
}
