//! Decides which maps are rendered and whether light is gathered, from the changes of the scene.

use std::any::TypeId;

use bevy::camera::visibility::VisibleEntities;
use bevy::camera::{Camera, Projection};
use bevy::ecs::entity::EntityHashMap;
use bevy::ecs::prelude::*;
use bevy::ecs::query::QueryData;
use bevy::log::info_once;
use bevy::math::Vec3;
use bevy::mesh::Mesh3d;
use bevy::pbr::{MeshMaterial3d, StandardMaterial};
use bevy::transform::components::GlobalTransform;

use super::changes::{SceneReader, shift};
use super::extent::{BoundingSphere, MapExtent};
use super::map::{LightMap, MapAge, RsmView};
use super::queue::{Gate, MapRequest, due};
use super::views::MapsReweighted;
use crate::cut::Jumps;
use crate::gi::settings::{FrugalGi, GiLimits};
use crate::gi::trace::GiOccluders;
use crate::gi::view::{CameraCut, GiFrame, GiRefresh, MapChanges};
use crate::schedule::PipelinesBusy;

/// A map and its camera.
#[derive(QueryData)]
#[query_data(mutable)]
pub(super) struct DueMap {
    view: &'static RsmView,
    place: &'static GlobalTransform,
    projection: &'static Projection,
    map: &'static mut LightMap,
    camera: &'static mut Camera,
}

/// A GI camera.
type Viewer = (
    Entity,
    &'static Camera,
    &'static FrugalGi,
    &'static GlobalTransform,
    &'static VisibleEntities,
    Has<CameraCut>,
);

pub(super) fn decide(
    (mut frame, mut jumps): (ResMut<GiFrame>, ResMut<Jumps>),
    (policy, limits, reweighted): (Res<GiRefresh>, Res<GiLimits>, Res<MapsReweighted>),
    busy: Option<Res<PipelinesBusy>>,
    occluders: Res<GiOccluders>,
    cameras: Query<Viewer, Without<RsmView>>,
    mut places: Local<EntityHashMap<Vec3>>,
    other_materials: Query<(), (With<Mesh3d>, Without<MeshMaterial3d<StandardMaterial>>)>,
    mut scene: SceneReader,
    mut maps: Query<DueMap>,
) {
    let changes = scene.read();
    let are_active = |camera: &Camera, gi: &FrugalGi| camera.is_active && gi.vpl_count > 0;
    let mut before = std::mem::take(&mut *places);
    let mut has_cut = false;
    jumps.shifts.clear();
    for (entity, camera, gi, at, visible, cuts) in &cameras {
        has_cut |= cuts;
        if !are_active(camera, gi) {
            continue;
        }
        let now = at.translation();
        places.insert(entity, now);
        let Some(was) = before.remove(&entity).filter(|_| !cuts) else { continue };
        let seen = visible.get(TypeId::of::<Mesh3d>()).iter();
        let seen = seen.map(|mesh| changes.jumps.get(mesh).copied().unwrap_or(Some(Vec3::ZERO)));
        let found = shift(now - was, seen.flatten());
        jumps.shifts.extend(found.map(|by| (entity, by)));
    }
    let always = *policy == GiRefresh::EveryFrame || !other_materials.is_empty();
    if always && *policy != GiRefresh::EveryFrame {
        info_once!(
            "a mesh has no StandardMaterial: global illumination is refreshed in every frame, since its material may change by itself"
        );
    }
    let mut map_changes = MapChanges {
        changed: changes.any() || reweighted.0,
        arrived: changes.arrived,
        // The renderer reports pipelines one or two frames late: meshes that it left out are then
        // rendered again.
        missing: busy.is_some_and(|busy| busy.get()) || occluders.waiting() > 0,
        always,
        unfilled: false,
        // What belongs to another place is rendered anew at once.
        cut: has_cut || !jumps.shifts.is_empty(),
    };
    for DueMapReadOnlyItem { map: LightMap { age, .. }, .. } in &maps {
        map_changes.changed |= age.stale > 0;
        map_changes.unfilled |= !age.filled || age.urgent;
    }
    let periods = cameras
        .iter()
        .filter(|(_, camera, gi, ..)| are_active(camera, gi))
        .map(|(_, _, gi, ..)| gi.refresh_period.max(1));
    let mut next = frame.next(map_changes, periods.min().unwrap_or(1));
    let everywhere = changes.everywhere || always || next.arriving > 0;
    if map_changes.changed || map_changes.unfilled || everywhere {
        let mut maps: Vec<_> = maps.iter_mut().collect();
        maps.sort_by_key(|map| map.view.key());
        mark(&mut maps, &changes.spheres, everywhere);
        let gate = match next.maps {
            true if map_changes.cut => Gate::All,
            true => Gate::Most(limits.max_rsms_per_frame),
            false => Gate::Urgent,
        };
        (next.maps, next.waiting) = activate(&mut maps, gate);
    } else {
        next.maps = false;
    }
    next.relit = next.maps || reweighted.0;
    *frame = next;
}

/// Marks maps as stale that can show a change: all, or those that meet a sphere.
fn mark(maps: &mut [DueMapItem], spheres: &[BoundingSphere], everywhere: bool) {
    for DueMapItem { place, projection, map, .. } in maps {
        let is_hit = || {
            let extent = MapExtent::new(&place.compute_transform(), projection);
            spheres.iter().any(|sphere| extent.meets(sphere))
        };
        if map.age.stale == 0 && (everywhere || !spheres.is_empty() && is_hit()) {
            map.age.stale = 1;
        }
    }
}

/// Lets the maps that are due be rendered; their cameras were inactive. Whether there is any, and
/// how many wait although the gate is open.
fn activate(maps: &mut [DueMapItem], gate: Gate) -> (bool, u32) {
    let request = |DueMapItem { view, map, .. }: &DueMapItem| MapRequest {
        group: (view.light, view.camera),
        importance: map.importance,
        age: map.age,
    };
    let waiting: Vec<MapRequest> = maps.iter().map(request).collect();
    let (mut any, mut left) = (false, 0);
    for (DueMapItem { map, camera, .. }, is_due) in maps.iter_mut().zip(due(&waiting, gate)) {
        any |= is_due;
        if is_due {
            camera.is_active = true;
            map.age = MapAge::FRESH;
        } else if map.age.stale > 0 {
            map.age.stale = map.age.stale.saturating_add(1);
            left += u32::from(gate != Gate::Urgent);
        }
    }
    (any, left)
}
