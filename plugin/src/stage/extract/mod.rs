//! What an app shows, as plain data for path tracing and ray queries.
//!
//! | module | job |
//! |---|---|
//! | `surface` | meshes where they are drawn, with their materials |
//! | `vertices` | a mesh's vertices, morphed, skinned and placed |
//! | `material` | `StandardMaterial` |
//! | `texture` | images as a shader reads them |
//! | `light`, `sky` | lights; environment light and background |
//! | `scene` | the plain data |
//! | `gaps` | what cannot be represented, counted |

mod gaps;
mod light;
mod material;
mod scene;
mod sky;
mod surface;
#[cfg(test)]
mod tests;
mod texture;
mod vertices;

use bevy::camera::visibility::RenderLayers;
use bevy::camera::{Exposure, Projection};
use bevy::ecs::entity::Entity;
use bevy::ecs::world::World;
use gaps::Gaps;
pub use scene::{ExtractedScene, ExtractedSky};

/// A lens without a perspective camera, as Bevy's default: degrees and metres.
const LENS: (f32, f32, f32) = (45.0, 0.1, 1000.0);

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
        exposure_ev100: exposure.ev100,
        vertical_fov_degrees,
        near,
        far,
        gaps: gaps.lines(),
    }
}
