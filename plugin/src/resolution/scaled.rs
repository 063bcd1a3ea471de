//! The smaller size of a scaled camera, and textures of its own.
//!
//! Bevy shares main, depth and prepass textures among the cameras of a target, in the size of the
//! first. They would not fit a second camera of another size, and the app would end. So a scaled
//! camera has a target of its own while textures are prepared, under which Bevy also finds the real
//! one's attachment.

use bevy::camera::{ManualTextureViewHandle, NormalizedRenderTarget};
use bevy::prelude::*;
use bevy::render::camera::{ExtractedCamera, SortedCameras};
use bevy::render::view::{ExtractedView, ViewTargetAttachments};

use super::ResolutionScale;

/// The part of the target that a scaled camera fills; in the render world, on cameras whose image
/// is smaller than that in this frame.
#[derive(Component, Clone, Copy, Debug, PartialEq)]
pub struct ScaledView {
    /// Upper left corner, pixels of the target.
    pub position: UVec2,
    /// Width and height, pixels of the target.
    pub size: UVec2,
}

pub(super) fn shrink_views(
    mut commands: Commands,
    mut views: Query<(Entity, &mut ExtractedCamera, &mut ExtractedView, &ResolutionScale)>,
) {
    for (entity, mut camera, mut view, scale) in &mut views {
        let part = camera.viewport.as_ref().map_or_else(
            || Some(ScaledView { position: UVec2::ZERO, size: camera.physical_target_size? }),
            |viewport| {
                let (position, size) = (viewport.physical_position, viewport.physical_size);
                Some(ScaledView { position, size })
            },
        );
        let scaled = part.map(|part| scale.apply(part.size));
        match (part, scaled) {
            (Some(part), Some(scaled)) if scaled != part.size && part.size.min_element() > 0 => {
                // All of a texture of its own: no pass has to know of the viewport.
                camera.viewport = None;
                camera.physical_target_size = Some(scaled);
                camera.physical_viewport_size = Some(scaled);
                view.viewport = UVec4::new(0, 0, scaled.x, scaled.y);
                commands.entity(entity).insert(part);
            }
            _ => {
                commands.entity(entity).remove::<ScaledView>();
            }
        }
    }
}

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
