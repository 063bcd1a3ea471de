//! Emissive surfaces as a source of light.
//!
//! | file | world | job |
//! |---|---|---|
//! | `emission` | none | what a material emits, in nits |
//! | `surface` | none | an emissive surface as points |
//! | `emitters` | main | keeps the texels of all emissive surfaces |
//! | `upload` | render | writes them into the store behind the maps' |

mod emission;
mod emitters;
mod surface;
mod upload;

use bevy::app::{App, Plugin, PostUpdate};
use bevy::asset::AssetEventSystems;
use bevy::camera::visibility::VisibilitySystems;
use bevy::ecs::prelude::*;
use bevy::render::Render;
use bevy::render::extract_resource::ExtractResourcePlugin;
use bevy::transform::TransformSystems;

use super::schedule::{PrepareSystems, SceneSystems, supported_render_app};
pub use emitters::GiEmitters;

pub(super) struct EmissivePlugin;

impl Plugin for EmissivePlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<GiEmitters>()
            .init_resource::<emitters::EmissiveState>()
            .add_plugins(ExtractResourcePlugin::<GiEmitters>::default())
            .add_systems(
                PostUpdate,
                // After this frame's asset events and transforms: a surface that becomes emissive
                // lights others in the same frame.
                (emitters::update, emitters::note_presence.run_if(resource_changed::<GiEmitters>))
                    .chain()
                    .in_set(SceneSystems::Emissive)
                    .after(AssetEventSystems)
                    .after(TransformSystems::Propagate)
                    .after(VisibilitySystems::VisibilityPropagate),
            );
    }

    fn finish(&self, app: &mut App) {
        let Some(render_app) = supported_render_app(app) else { return };
        render_app.add_systems(
            Render,
            (
                upload::reserve.in_set(PrepareSystems::Reserve),
                upload::upload.in_set(PrepareSystems::Emissive),
            ),
        );
    }
}
