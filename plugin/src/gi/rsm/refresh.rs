//! Decides which maps are rendered and whether light is gathered, from the changes of the scene: maps
//! that are out of date, as many as the app allows.

use std::any::TypeId;

use bevy::camera::Camera;
use bevy::camera::primitives::{Frustum, Sphere};
use bevy::camera::visibility::VisibleEntities;
use bevy::ecs::entity::EntityHashMap;
use bevy::ecs::prelude::*;
use bevy::ecs::query::QueryData;
use bevy::log::info_once;
use bevy::math::Vec3;
use bevy::mesh::Mesh3d;
use bevy::pbr::{MeshMaterial3d, StandardMaterial};
use bevy::transform::components::GlobalTransform;

use super::changes::{SceneReader, shift};
use super::map::{LightMap, MapAge, MapPlace, RsmView};
use super::views::MapsReweighted;
use crate::cut::Jumps;
use crate::gi::settings::GiLimits;
use crate::gi::trace::GiOccluders;
use crate::gi::view::{ActiveGi, CameraCut, GiFrame, GiRefresh, MapChanges};
use crate::schedule::PipelinesBusy;

/// A map and its camera.
#[derive(QueryData)]
#[query_data(mutable)]
pub(super) struct DueMap {
    entity: Entity,
    place: &'static MapPlace,
    view: &'static RsmView,
    frustum: &'static Frustum,
    map: &'static mut LightMap,
    camera: &'static mut Camera,
}

/// A GI camera.
type Viewer = (
    Entity,
    &'static Camera,
    &'static ActiveGi,
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
    mut commands: Commands,
) {
    let changes = scene.read();
    let are_active = |camera: &Camera, gi: &ActiveGi| camera.is_active && gi.vpl_count > 0;
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
    let is_due = next.maps;
    if map_changes.changed || map_changes.unfilled || everywhere {
        let mut maps: Vec<_> = maps.iter_mut().collect();
        maps.sort_by_key(|map| *map.view);
        mark(&mut maps, &changes.spheres, everywhere);
        let gate = match next.maps {
            true if map_changes.cut => Gate::All,
            true => Gate::Most(limits.max_rsms_per_frame),
            false => Gate::Urgent,
        };
        (next.maps, next.waiting) = activate(&mut maps, gate, &mut commands);
    } else {
        next.maps = false;
    }
    // Where no light has a map, emission, the sky or what occludes them may have changed.
    next.relit = next.maps || reweighted.0 || is_due && maps.is_empty();
    *frame = next;
}

/// Marks maps as stale that can show a change: all, or those that meet a sphere.
fn mark(maps: &mut [DueMapItem], spheres: &[Sphere], everywhere: bool) {
    for DueMapItem { frustum, map, .. } in maps {
        let is_hit = || spheres.iter().any(|sphere| frustum.intersects_sphere(sphere, true));
        if map.age.stale == 0 && (everywhere || is_hit()) {
            map.age.stale = 1;
        }
    }
}

/// Lets the maps that are due be rendered; their cameras were inactive. Whether there is any, and
/// how many wait although the gate is open.
fn activate(maps: &mut [DueMapItem], gate: Gate, commands: &mut Commands) -> (bool, u32) {
    let request = |DueMapItem { view, map, .. }: &DueMapItem| MapRequest {
        group: (view.light, view.camera),
        importance: map.importance,
        age: map.age,
    };
    let waiting: Vec<MapRequest> = maps.iter().map(request).collect();
    let (mut any, mut left) = (false, 0);
    for (DueMapItem { entity, place, map, camera, .. }, is_due) in
        maps.iter_mut().zip(due(&waiting, gate))
    {
        any |= is_due;
        if is_due {
            camera.is_active = true;
            commands.entity(*entity).insert(place.0);
            map.age = MapAge::FRESH;
        } else if map.age.stale > 0 {
            map.age.stale = map.age.stale.saturating_add(1);
            left += u32::from(gate != Gate::Urgent);
        }
    }
    (any, left)
}

/// A map that may be rendered.
#[derive(Clone, Copy, Debug, PartialEq)]
struct MapRequest {
    /// Light, and camera that the map serves: such maps are rendered in the same frame, since
    /// cascades cover each other.
    group: (Entity, Option<Entity>),
    /// Its light's, above 0.
    importance: f32,
    age: MapAge,
}

/// When maps may be rendered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Gate {
    /// Only urgent ones.
    Urgent,
    /// Up to so many maps, but at least those of one light.
    Most(usize),
    /// All that are stale: at a camera cut, so that what follows does not depend on what was
    /// rendered before.
    All,
}

/// Of maps sorted by group: whether each is rendered. First come maps whose texels are not there
/// yet, then those that matter most or have waited longest.
fn due(maps: &[MapRequest], gate: Gate) -> Vec<bool> {
    let mut groups: Vec<(&[MapRequest], usize)> = Vec::new();
    let mut first = 0;
    for group in maps.chunk_by(|a, b| a.group == b.group) {
        if group.iter().any(|map| map.age.stale > 0) {
            groups.push((group, first));
        }
        first += group.len();
    }
    let rank = |(group, _): &(&[MapRequest], usize)| {
        let any = |is: fn(&MapAge) -> bool| group.iter().any(|map| is(&map.age));
        let waited = group.iter().map(|map| map.age.stale).max().unwrap_or(0) as f32;
        let importance = group.iter().map(|map| map.importance).fold(0.0, f32::max);
        (any(|age| age.urgent), any(|age| !age.filled), importance * waited)
    };
    groups.sort_by(|a, b| {
        let (a, b) = (rank(a), rank(b));
        (b.0, b.1).cmp(&(a.0, a.1)).then(b.2.total_cmp(&a.2))
    });
    let mut is_due = vec![false; maps.len()];
    let mut count = 0;
    for (group, first) in groups {
        // Of a point light, only the faces that changed.
        let stale = group.iter().filter(|map| map.age.stale > 0).count();
        let is_urgent = group.iter().any(|map| map.age.urgent);
        let fits = match gate {
            Gate::Urgent => false,
            Gate::Most(most) => count == 0 || count + stale <= most,
            Gate::All => true,
        };
        if fits || is_urgent {
            count += stale;
            for (offset, map) in group.iter().enumerate() {
                is_due[first + offset] = map.age.stale > 0;
            }
        }
    }
    is_due
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map(light: u32, importance: f32, age: MapAge) -> MapRequest {
        let group = (Entity::from_raw_u32(light).expect("an entity"), None);
        MapRequest { group, importance, age }
    }

    const FRESH: MapAge = MapAge::FRESH;
    const STALE: MapAge = MapAge { stale: 1, ..FRESH };
    const EMPTY: MapAge = MapAge::NEW;

    #[test]
    fn nothing_is_rendered_that_is_up_to_date() {
        let maps = [map(0, 1.0, FRESH), map(1, 1.0, FRESH)];
        for gate in [Gate::Urgent, Gate::Most(24), Gate::All] {
            assert_eq!(due(&maps, gate), [false; 2]);
        }
        assert_eq!(due(&[], Gate::All), [] as [bool; 0]);
    }

    #[test]
    fn only_faces_that_changed_are_rendered() {
        let maps = [map(0, 1.0, FRESH), map(0, 1.0, STALE), map(0, 1.0, FRESH), map(1, 9.0, STALE)];
        assert_eq!(due(&maps, Gate::Most(24)), [false, true, false, true]);
    }

    #[test]
    fn all_maps_of_a_light_wait_for_room_together() {
        let maps: Vec<_> =
            (0..4).flat_map(|light| [map(light, 4.0 - light as f32, STALE); 6]).collect();
        let lights =
            |gate| -> Vec<bool> { due(&maps, gate).chunks(6).map(|faces| faces[0]).collect() };
        assert_eq!(lights(Gate::Most(12)), [true, true, false, false]);
        assert_eq!(lights(Gate::Most(17)), [true, true, false, false]);
        assert_eq!(lights(Gate::Most(1)), [true, false, false, false], "something goes on");
        assert_eq!(lights(Gate::Urgent), [false; 4]);
        assert_eq!(lights(Gate::All), [true; 4]);
    }

    #[test]
    fn empty_maps_come_first_then_importance_times_waiting() {
        let waited = |stale| MapAge { stale, ..STALE };
        let maps = [
            map(0, 100.0, waited(1)),
            map(1, 1.0, EMPTY),
            map(2, 10.0, waited(11)),
            map(3, 2.0, waited(60)),
        ];
        let order = |count: usize| due(&maps, Gate::Most(count));
        assert_eq!(order(1), [false, true, false, false]);
        assert_eq!(order(2), [false, true, false, true]);
        assert_eq!(order(3), [false, true, true, true]);
    }

    #[test]
    fn nothing_waits_for_ever() {
        let mut maps: Vec<_> = (0..40).map(|light| map(light, 1.0 + light as f32, STALE)).collect();
        let mut rendered = vec![0; maps.len()];
        for _ in 0..400 {
            let due = due(&maps, Gate::Most(4));
            for ((map, due), rendered) in maps.iter_mut().zip(due).zip(&mut rendered) {
                map.age.stale = if due { 1 } else { map.age.stale + 1 };
                *rendered += u32::from(due);
            }
        }
        assert!(rendered.iter().all(|count| *count > 0), "{rendered:?}");
    }

    #[test]
    fn urgent_maps_are_rendered_through_a_closed_gate() {
        let maps = [map(0, 1.0, MapAge { urgent: true, ..STALE }), map(1, 9.0, STALE)];
        assert_eq!(due(&maps, Gate::Urgent), [true, false]);
        assert_eq!(due(&maps, Gate::Most(1)), [true, false]);
    }
}
