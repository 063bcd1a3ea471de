//! The work of each frame: light is not gathered again while nothing changes.
//!
//! A map is rendered when its light changes, or when something does that it can show, and then only
//! as soon as the app's limit of maps in a frame allows. After a mesh, a texture or a material is
//! added, all are rendered for a few more frames, since it may not be rendered in its first. A camera
//! gathers while anything changes or it moves, and at rest until its image has converged. Then only
//! the composite is left.
//!
//! | file | world | job |
//! |---|---|---|
//! | `changes` | main | where the scene changed |
//! | `queue` | none | which maps are rendered, of those that are out of date |
//! | `scene` | main | decides on the frame's work |
//! | `views` | render | decides the work of each GI camera: from which texels it samples, and whether it gathers |

mod changes;
mod queue;
mod scene;
mod views;

use bevy::app::{App, Plugin, PostUpdate};
use bevy::ecs::prelude::*;
use bevy::render::Render;
use bevy::render::extract_resource::ExtractResourcePlugin;

use super::schedule::{PrepareSystems, SceneSystems, supported_render_app};
use super::view::{GiFrame, GiRefresh};

pub(super) struct RefreshPlugin;

impl Plugin for RefreshPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<GiRefresh>()
            .init_resource::<GiFrame>()
            .register_type::<GiRefresh>()
            .add_plugins((
                ExtractResourcePlugin::<GiRefresh>::default(),
                ExtractResourcePlugin::<GiFrame>::default(),
            ))
            .add_systems(PostUpdate, scene::decide.in_set(SceneSystems::Refresh));
    }

    fn finish(&self, app: &mut App) {
        let Some(render_app) = supported_render_app(app) else { return };
        render_app.add_systems(Render, views::prepare.in_set(PrepareSystems::Views));
    }
}
