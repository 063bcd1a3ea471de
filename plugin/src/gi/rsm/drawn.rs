//! Which meshes maps draw: those that cast shadows.
//!
//! Bevy's visibility takes a map's camera for any other, and would draw meshes that cast no shadow.

use std::any::TypeId;

use bevy::camera::Camera;
use bevy::camera::visibility::VisibleEntities;
use bevy::ecs::prelude::*;
use bevy::light::NotShadowCaster;
use bevy::mesh::Mesh3d;

use super::RsmView;

/// Takes meshes that cast no shadow out of the lists of what is visible to maps.
pub(super) fn leave_out_shadowless(
    mut maps: Query<(&Camera, &mut VisibleEntities), With<RsmView>>,
    shadowless: Query<(), With<NotShadowCaster>>,
) {
    for (_, mut visible) in maps.iter_mut().filter(|(camera, _)| camera.is_active) {
        let meshes = visible.get_mut(TypeId::of::<Mesh3d>());
        meshes.retain(|mesh| !shadowless.contains(*mesh));
    }
}
