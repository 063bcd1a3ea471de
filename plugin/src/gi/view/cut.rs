//! Camera cuts: an app announces that a camera's next frame does not continue its last.

use bevy::app::App;
use bevy::ecs::entity::EntityHashSet;
use bevy::ecs::prelude::*;
use bevy::prelude::ReflectDefault;
use bevy::reflect::Reflect;
use bevy::render::{ExtractSchedule, MainWorld, RenderApp};

/// Marks a camera whose next frame is a cut: a teleport, another scene. Its history is dropped, and
/// its VPLs are resampled regardless of [`refresh_period`](super::FrugalGi::refresh_period).
/// Removed as soon as that frame is extracted.
///
/// Other cuts are detected without it: from one frame to the next the camera moves by more than 1 m
/// and faster than 300 m/s, or turns by more than 30° and faster than 900° a second.
#[derive(Component, Reflect, Clone, Copy, Debug, Default, PartialEq, Eq)]
#[reflect(Component, Default, Clone, PartialEq)]
pub struct CameraCut;

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
