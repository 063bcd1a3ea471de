//! Which meshes maps draw: those that cast shadows, each at the level of detail that GI cameras
//! see.
//!
//! Bevy's visibility takes a map's camera for any other. It would draw meshes that cast no shadow,
//! and choose levels of detail by the distance from the light.

use std::any::TypeId;

use bevy::camera::Camera;
use bevy::camera::primitives::Aabb;
use bevy::camera::visibility::{
    InheritedVisibility, NoCpuCulling, RenderLayers, SetViewVisibility, ViewVisibility,
    VisibilityRange, VisibleEntities,
};
use bevy::ecs::prelude::*;
use bevy::light::NotShadowCaster;
use bevy::mesh::Mesh3d;
use bevy::transform::components::GlobalTransform;

use super::RsmView;
use super::views::MapDelta;
use crate::gi::view::GiCameras;

/// Meshes with a [`VisibilityRange`] that maps draw, sorted.
#[derive(Resource, Default)]
pub(super) struct Levels(Vec<Entity>);

/// Chooses levels of detail; another choice is a change of the scene.
pub(super) fn choose_levels(
    mut levels: ResMut<Levels>,
    mut delta: ResMut<MapDelta>,
    cameras: GiCameras,
    meshes: Query<(Entity, &VisibilityRange, Option<&Aabb>, &GlobalTransform), With<Mesh3d>>,
) {
    if meshes.is_empty() && levels.0.is_empty() {
        return;
    }
    let shown = cameras.shown();
    let mut now: Vec<Entity> = meshes
        .iter()
        .filter(|(_, range, aabb, transform)| shown.has_level(range, *aabb, transform))
        .map(|(entity, ..)| entity)
        .collect();
    now.sort_unstable();
    if levels.0 != now {
        levels.0 = now;
        delta.moved = true;
    }
}

/// Corrects the lists of meshes that are visible to maps.
pub(super) fn correct_visibility(
    levels: Res<Levels>,
    mut maps: Query<(&Camera, &RenderLayers, &mut VisibleEntities), With<RsmView>>,
    shadowless: Query<(), With<NotShadowCaster>>,
    mut ranged: Query<
        (&InheritedVisibility, &mut ViewVisibility, Option<&RenderLayers>),
        (With<VisibilityRange>, Without<NotShadowCaster>, Without<NoCpuCulling>, Without<RsmView>),
    >,
) {
    if shadowless.is_empty() && ranged.is_empty() {
        return;
    }
    for (camera, map_layers, mut visible) in &mut maps {
        if !camera.is_active {
            continue;
        }
        let meshes = visible.get_mut(TypeId::of::<Mesh3d>());
        meshes.retain(|mesh| !shadowless.contains(*mesh) && !ranged.contains(*mesh));
        for level in &levels.0 {
            let Ok((inherited, mut view_visibility, layers)) = ranged.get_mut(*level) else {
                continue;
            };
            if inherited.get() && map_layers.intersects(layers.unwrap_or_default()) {
                view_visibility.set_visible();
                meshes.push(*level);
            }
        }
        // Bevy compares lists of two frames in order.
        meshes.sort_unstable();
    }
}
