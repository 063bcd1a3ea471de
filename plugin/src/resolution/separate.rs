//! Textures of its own for every scaled camera.
//!
//! Bevy shares main, depth and prepass textures among the cameras of a target, in the size of the
//! first. A second camera of another size would not fit them, which ends the app. So a scaled
//! camera has another target while textures are prepared, under which the real one's attachment is
//! found, too.

use bevy::camera::{
    ClearColorConfig, ManualTextureViewHandle, MsaaWriteback, NormalizedRenderTarget,
};
use bevy::color::Color;
use bevy::ecs::prelude::*;
use bevy::render::camera::{ExtractedCamera, SortedCameras};
use bevy::render::view::ViewTargetAttachments;

use super::scaled::ScaledView;

/// A target that only `camera` has: a handle from the upper end, where apps have none.
fn own_target(camera: Entity) -> NormalizedRenderTarget {
    NormalizedRenderTarget::TextureView(ManualTextureViewHandle(u32::MAX - camera.index_u32()))
}

/// Whether another camera draws on the same target before `camera`.
pub(super) fn is_over_another(camera: Entity, sorted: &SortedCameras) -> bool {
    let Some(place) = sorted.0.iter().position(|other| other.entity == camera) else {
        return false;
    };
    let target = &sorted.0[place].target;
    target.is_some() && sorted.0[..place].iter().any(|other| other.target == *target)
}

pub(super) fn separate_targets(
    sorted: Res<SortedCameras>,
    mut attachments: ResMut<ViewTargetAttachments>,
    mut cameras: Query<(Entity, &mut ExtractedCamera, Has<ScaledView>)>,
) {
    let is_scaled = |entity: Entity| matches!(cameras.get(entity), Ok((_, _, true)));
    // In most apps there is nothing to do.
    let with_scaled: Vec<NormalizedRenderTarget> = sorted
        .0
        .iter()
        .filter(|camera| is_scaled(camera.entity))
        .filter_map(|camera| camera.target.clone())
        .collect();
    if with_scaled.is_empty() {
        return;
    }
    for (entity, mut camera, is_scaled) in &mut cameras {
        let Some(target) = camera.target.clone() else { continue };
        if !with_scaled.contains(&target) {
            continue;
        }
        if is_over_another(entity, &sorted) {
            // The image of the cameras before it may be in other textures: it starts from nothing
            // and is blended over the target.
            if matches!(camera.clear_color, ClearColorConfig::None) {
                camera.clear_color = ClearColorConfig::Custom(Color::NONE);
            }
            camera.msaa_writeback = MsaaWriteback::Off;
        }
        if is_scaled {
            let own = own_target(entity);
            if let Some(attachment) = attachments.get(&target).cloned() {
                attachments.insert(own.clone(), attachment);
            }
            camera.target = Some(own);
        }
    }
}

/// Gives every scaled camera its real target back, by which windows are presented.
pub(super) fn rejoin_targets(
    sorted: Res<SortedCameras>,
    mut cameras: Query<(Entity, &mut ExtractedCamera), With<ScaledView>>,
) {
    for (entity, mut camera) in &mut cameras {
        if let Some(known) = sorted.0.iter().find(|known| known.entity == entity) {
            camera.target = known.target.clone();
        }
    }
}
