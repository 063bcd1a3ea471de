//! The smaller size of a scaled camera's view.

use bevy::ecs::prelude::*;
use bevy::math::{UVec2, UVec4};
use bevy::render::camera::ExtractedCamera;
use bevy::render::view::ExtractedView;

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
