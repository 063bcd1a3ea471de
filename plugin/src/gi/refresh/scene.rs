//! Decides which maps are rendered and whether light is gathered, from the changes of the scene.

use bevy::camera::{Camera, Projection};
use bevy::ecs::prelude::*;
use bevy::log::info_once;
use bevy::mesh::Mesh3d;
use bevy::pbr::{MeshMaterial3d, StandardMaterial};
use bevy::transform::components::Transform;

use super::changes::SceneChanges;
use super::queue::{Gate, Waiting, due};
use crate::gi::rsm::{MapAge, MapDelta, MapExtent, MapWeight, RsmView};
use crate::gi::settings::{FrugalGi, GiLimits};
use crate::gi::trace::GiOccluders;
use crate::gi::view::{CameraCut, GiFrame, GiRefresh, SceneDelta};
use crate::pipelines::PipelinesBusy;

/// A map's camera.
type Map = (
    &'static RsmView,
    &'static MapWeight,
    &'static Transform,
    &'static Projection,
    &'static mut MapAge,
    &'static mut Camera,
);

pub(super) fn decide(
    mut frame: ResMut<GiFrame>,
    (policy, limits, maps_delta): (Res<GiRefresh>, Res<GiLimits>, Res<MapDelta>),
    busy: Option<Res<PipelinesBusy>>,
    occluders: Res<GiOccluders>,
    cameras: Query<(&Camera, &FrugalGi), Without<RsmView>>,
    cuts: Query<(), With<CameraCut>>,
    other_materials: Query<(), (With<Mesh3d>, Without<MeshMaterial3d<StandardMaterial>>)>,
    mut scene: SceneChanges,
    mut maps: Query<Map>,
) {
    let changes = scene.read();
    let always = *policy == GiRefresh::EveryFrame || !other_materials.is_empty();
    if always && *policy != GiRefresh::EveryFrame {
        info_once!(
            "a mesh has no StandardMaterial: global illumination is refreshed in every frame, since its material may change by itself"
        );
    }
    let mut delta = SceneDelta {
        changed: changes.any() || maps_delta.reweighted,
        arrived: changes.arrived,
        // The renderer reports pipelines one or two frames late: meshes that it left out are then
        // rendered again.
        missing: busy.is_some_and(|busy| busy.get()) || occluders.waiting() > 0,
        always,
        unfilled: false,
        cut: !cuts.is_empty(),
    };
    for (.., age, _) in &maps {
        delta.changed |= age.stale > 0;
        delta.unfilled |= !age.filled || age.urgent;
    }
    let periods = cameras
        .iter()
        .filter(|(camera, gi)| camera.is_active && gi.vpl_count > 0)
        .map(|(_, gi)| gi.refresh_period.max(1));
    let mut next = frame.next(delta, periods.min().unwrap_or(1));
    let everywhere = changes.everywhere || always || next.arriving > 0;
    let gate = match next.maps {
        true if delta.cut => Gate::All,
        true => Gate::Most(limits.max_rsms_per_frame),
        false => Gate::Urgent,
    };
    let mut sorted: Vec<_> = maps.iter_mut().collect();
    sorted.sort_by_key(|(view, ..)| view.key());
    let waiting: Vec<Waiting> = sorted
        .iter_mut()
        .map(|(view, weight, transform, projection, age, _)| {
            let is_hit = || {
                let extent = MapExtent::new(transform, projection);
                changes.spheres.iter().any(|sphere| extent.meets(sphere))
            };
            if age.stale == 0 && (everywhere || !changes.spheres.is_empty() && is_hit()) {
                age.stale = 1;
            }
            let group = (view.light, view.camera);
            Waiting { group, importance: weight.importance, age: **age }
        })
        .collect();
    let mut rendered = false;
    for ((.., age, camera), is_due) in sorted.iter_mut().zip(due(&waiting, gate)) {
        rendered |= is_due;
        if is_due {
            age.set_if_neq(MapAge { stale: 0, filled: true, urgent: false });
        } else if age.stale > 0 {
            age.stale = age.stale.saturating_add(1);
            next.waiting += u32::from(gate != Gate::Urgent);
        }
        if camera.is_active != is_due {
            camera.is_active = is_due;
        }
    }
    next.maps = rendered;
    next.relit = rendered || maps_delta.reweighted;
    *frame = next;
}
