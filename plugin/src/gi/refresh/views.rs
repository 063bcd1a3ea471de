//! The work of each GI camera in a frame: whether its VPLs are sampled, and from which texels.

use std::sync::Arc;

use bevy::camera::visibility::RenderLayers;
use bevy::ecs::prelude::*;
use bevy::math::{Affine3A, Mat4};
use bevy::render::camera::{ExtractedCamera, TemporalJitter};
use bevy::render::sync_world::MainEntity;
use bevy::render::view::ExtractedView;

use crate::cut::Jumps;
use crate::gi::bounces::BounceCamera;
use crate::gi::emissive::GiEmitters;
use crate::gi::rsm::{MapAge, MapLayers, MapWeight, RsmLight, RsmView};
use crate::gi::settings::FrugalGi;
use crate::gi::sky::{SkyCamera, SkyInputs};
use crate::gi::texels::{CascadeCut, TexelRange, TexelRow, TexelStore};
use crate::gi::trace::GiOccluders;
use crate::gi::view::{Fit, GatherCamera, GiFrame, GiRefresh, GiView, Step, Work};

/// What a camera's VPLs and its gather depend on, apart from the scene and its [`GiView`].
#[derive(Component, Clone, Debug, PartialEq)]
pub(super) struct ViewInputs {
    world_from_view: Affine3A,
    clip_from_view: Mat4,
    sky: Option<SkyInputs>,
    /// Whether the occluders were collected. In the frame in which an app switches rays on, they
    /// may not be yet.
    has_occluders: bool,
}

/// Gives every GI camera that has light to gather its [`GiView`], and takes it from the others.
pub(super) fn prepare(
    mut commands: Commands,
    store: Res<TexelStore>,
    (frame, policy, jumps): (Res<GiFrame>, Res<GiRefresh>, Res<Jumps>),
    maps: Query<MapRow>,
    (emitters, occluders): (Res<GiEmitters>, Res<GiOccluders>),
    cameras: Query<(
        Entity,
        &MainEntity,
        &FrugalGi,
        &ExtractedCamera,
        &ExtractedView,
        Has<TemporalJitter>,
        Option<&RenderLayers>,
        Option<&SkyCamera>,
        Option<&BounceCamera>,
    )>,
    mut held: Query<(&mut GiView, &mut ViewInputs)>,
    stale: Query<Entity, (With<GiView>, Or<(Without<FrugalGi>, Without<ExtractedCamera>)>)>,
) {
    for entity in &stale {
        commands.entity(entity).remove::<(GiView, ViewInputs)>();
    }
    for (entity, main_entity, gi, camera, view, jitters, layers, sky, bounces) in &cameras {
        let mut rows = rows_of(main_entity.id(), layers.unwrap_or_default(), &maps);
        if gi.emissive {
            emitters.add_rows(camera.exposure, store.first(TexelRange::Emissive), &mut rows);
        }
        if let Some(bounces) = bounces {
            bounces.add_rows(&mut rows);
        }
        if store.texels.is_none() {
            rows.clear();
        }
        let sky = sky.and_then(SkyCamera::inputs);
        let Some(size) = camera.physical_viewport_size.filter(|size| size.min_element() > 0) else {
            continue;
        };
        if !gi.gathers() || (rows.is_empty() && sky.is_none()) {
            if held.contains(entity) {
                commands.entity(entity).remove::<(GiView, ViewInputs)>();
            }
            continue;
        }
        let always = jitters || sky.as_ref().is_some_and(|sky| sky.is_generated());
        let mut next = GiView {
            gi: gi.clone(),
            camera: GatherCamera::new(camera, view, size, gi.pixel_fraction),
            rows: Arc::new(rows),
            sky_samples: sky.as_ref().map_or(0, |sky| sky.samples()),
            // Its buffers are empty, so the period does not apply.
            work: Work::ALL,
            step: Step::Begins,
        };
        let inputs = ViewInputs {
            world_from_view: view.world_from_view.affine(),
            clip_from_view: view.clip_from_view,
            sky,
            has_occluders: occluders.is_kept(),
        };
        let Ok((mut held, mut held_inputs)) = held.get_mut(entity) else {
            commands.entity(entity).insert((next, inputs));
            continue;
        };
        let is_cut = jumps.cuts.contains(&main_entity.id());
        if held.rows == next.rows {
            next.rows = Arc::clone(&held.rows);
        }
        let fit = held.fit(&next);
        let switched = held.gi != next.gi || held_inputs.sky != inputs.sky;
        let moved = switched
            || *held_inputs != inputs
            || held.camera.exposure != next.camera.exposure
            || is_cut;
        if fit != Fit::Empty {
            let changed = moved || fit == Fit::LaidOut;
            next.work = held.work.next(
                changed,
                always,
                &frame,
                *policy,
                gi.refresh_period.max(1),
                if gi.filters() { gi.rest_frames.min(FrugalGi::MAX_REST_FRAMES) } else { 0 },
            );
        }
        next.step = match next.work.gather {
            false => Step::Rests,
            true if next.work.rested > 0 => Step::Averages,
            // Light that was gathered before all occluders existed is no valid history.
            true if is_cut || held_inputs.has_occluders != inputs.has_occluders => Step::Begins,
            true if switched => Step::Switches,
            true if moved || fit > Fit::Same || always || frame.gather => Step::Moves,
            true => Step::Begins,
        };
        (*held, *held_inputs) = (next, inputs);
    }
}

/// A map in the render world.
type MapRow = (
    &'static RsmView,
    &'static RsmLight,
    &'static CascadeCut,
    &'static MapLayers,
    &'static MapAge,
    &'static MapWeight,
);

/// Rows of every map that serves `camera` and has texels, in an order that does not depend on where
/// they lie in the store.
fn rows_of(camera: Entity, layers: &RenderLayers, maps: &Query<MapRow>) -> Vec<TexelRow> {
    let mut serving: Vec<_> = maps
        .iter()
        .filter(|(map, _, _, shared, age, _)| {
            age.filled
                && map.camera.is_none_or(|owner| owner == camera)
                && shared.0.intersects(layers)
        })
        .collect();
    serving.sort_by_key(|(map, ..)| map.key());
    let mut rows = Vec::new();
    for (_, RsmLight { texel_offset, resolution, .. }, cut, _, _, weight) in serving {
        let side = *resolution;
        TexelRow::add_map(&mut rows, *texel_offset, side, side, (*cut, weight.share));
    }
    rows
}
