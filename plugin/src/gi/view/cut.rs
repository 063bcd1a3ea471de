//! Camera cuts that an app announced, in the render world.

use bevy::app::App;
use bevy::ecs::entity::EntityHashSet;
use bevy::ecs::prelude::*;
use bevy::render::{ExtractSchedule, MainWorld, RenderApp};

use crate::cut::CameraCut;

/// Cameras with a cut in this frame, by main-world entity. A resource of the render world.
#[derive(Resource, Default)]
pub(in crate::gi) struct CutCameras(pub EntityHashSet);

pub(super) fn build(app: &mut App) {
    app.register_type::<CameraCut>();
    if let Some(render_app) = app.get_sub_app_mut(RenderApp) {
        render_app.init_resource::<CutCameras>().add_systems(ExtractSchedule, extract_cuts);
    }
}

fn extract_cuts(
    mut cuts: ResMut<CutCameras>,
    mut main_world: ResMut<MainWorld>,
    mut marked: Local<Option<QueryState<Entity, With<CameraCut>>>>,
) {
    let marked = marked.get_or_insert_with(|| main_world.query_filtered());
    cuts.0.clear();
    cuts.0.extend(marked.iter(&main_world));
    for camera in &cuts.0 {
        main_world.entity_mut(*camera).remove::<CameraCut>();
    }
}
