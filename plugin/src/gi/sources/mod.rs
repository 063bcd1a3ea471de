//! Light that comes from no lamp: glowing surfaces, and the sky.
//!
//! | file | world | job |
//! |---|---|---|
//! | `emission` | none | what a material gives off, in nits |
//! | `surface` | none | a glowing surface as points |
//! | `emissive` | main | keeps the texels of everything that glows |
//! | `upload` | render | writes them into the store behind the maps' |
//! | `sky` | render | draws each GI camera's samples of its environment map |
//! | `ambient` | render | takes Bevy's diffuse environment light out where ours is |

mod ambient;
mod emission;
mod emissive;
mod sky;
mod surface;
mod upload;

use bevy::app::{App, PostUpdate};
use bevy::asset::AssetEventSystems;
use bevy::camera::visibility::VisibilitySystems;
use bevy::ecs::prelude::*;
use bevy::render::extract_resource::ExtractResourcePlugin;
use bevy::transform::TransformSystems;

use crate::knobs::KnobSystems;

pub(super) use ambient::{BlackCubes, take_out_diffuse};
pub use emissive::GiEmitters;
pub(super) use sky::{
    SET_BYTES, SKY_LIGHT_BYTES, SkyCamera, SkyPipelines, SkyPlan, SkyReading, SkySeen, SkySource,
    extract_sources,
};
pub(super) use sky::{prepare_cameras as prepare_skies, sample as sample_sky};
pub(super) use upload::upload_emitters;

/// In the main world's `PostUpdate`: [`GiEmitters`] is kept.
#[derive(SystemSet, Clone, Debug, PartialEq, Eq, Hash)]
pub(super) struct EmittersSystems;

pub(super) fn build(app: &mut App) {
    app.init_resource::<GiEmitters>()
        .init_resource::<emissive::Glow>()
        .add_plugins(ExtractResourcePlugin::<GiEmitters>::default())
        .add_systems(
            PostUpdate,
            // Need this frame's asset events: what begins to glow lights others in the same frame.
            emissive::update
                .in_set(EmittersSystems)
                .after(KnobSystems::Apply)
                .after(AssetEventSystems)
                .after(TransformSystems::Propagate)
                .after(VisibilitySystems::VisibilityPropagate),
        );
}
