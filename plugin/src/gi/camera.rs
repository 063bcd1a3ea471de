//! The work of each GI camera in a frame: from which texels its VPLs are sampled, and whether it
//! gathers.
//!
//! A camera gathers while anything changes or it moves, and at rest until its image has converged.
//! Then only the composite is left.

use std::sync::Arc;

use bevy::camera::visibility::RenderLayers;
use bevy::ecs::prelude::*;
use bevy::render::camera::{ExtractedCamera, TemporalJitter};
use bevy::render::sync_world::MainEntity;
use bevy::render::view::ExtractedView;

use super::bounces::BounceCamera;
use super::emissive::GiEmitters;
use super::rsm::{LightMap, RsmView};
use super::settings::FrugalGi;
use super::sky::{SkyCamera, SkyInputs};
use super::texels::{TexelRange, TexelRow, TexelStore};
use super::trace::GiOccluders;
use super::view::{BufferReuse, GatherCamera, GiFrame, GiRefresh, GiView, HistoryAction, Work};
use crate::cut::Jumps;

/// Sequences of samples that a cache takes one after another, before they repeat.
const SEQUENCES: u32 = 4096;

/// What a camera's VPLs and its gather depend on, apart from the scene and its [`GiView`].
#[derive(Component, Clone, Debug, PartialEq)]
pub(super) struct ViewInputs {
    sky: Option<SkyInputs>,
    /// Whether the occluders were collected. In the frame in which an app switches rays on, they
    /// may not be yet.
    has_occluders: bool,
    /// They say which meshes it shows.
    layers: RenderLayers,
}

/// Gives every GI camera that has light to gather its [`GiView`], and takes it from the others.
pub(super) fn prepare(
    mut commands: Commands,
    store: Res<TexelStore>,
    (frame, policy, jumps): (Res<GiFrame>, Res<GiRefresh>, Res<Jumps>),
    maps: Query<(&RsmView, &LightMap)>,
    (emitters, occluders): (Res<GiEmitters>, Res<GiOccluders>),
    mut cameras: Query<
        (
            Entity,
            &MainEntity,
            Option<(&FrugalGi, &ExtractedCamera, &ExtractedView)>,
            Has<TemporalJitter>,
            Option<&RenderLayers>,
            Option<&SkyCamera>,
            Option<&BounceCamera>,
            Option<(&mut GiView, &mut ViewInputs)>,
        ),
        Or<(With<FrugalGi>, With<GiView>)>,
    >,
) {
    for (entity, main_entity, camera, jitters, layers, sky, bounces, held) in &mut cameras {
        let gathers = camera.filter(|(gi, ..)| gi.gathers()).and_then(|(gi, camera, view)| {
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
            (!rows.is_empty() || sky.is_some()).then_some((gi, camera, view, rows, sky))
        });
        let Some((gi, camera, view, rows, sky)) = gathers else {
            if held.is_some() {
                commands.entity(entity).remove::<(GiView, ViewInputs)>();
            }
            continue;
        };
        let Some(size) = camera.physical_viewport_size.filter(|size| size.min_element() > 0) else {
            continue;
        };
        let always = jitters || sky.as_ref().is_some_and(|sky| sky.is_generated());
        let mut next = GiView {
            gi: gi.clone(),
            camera: GatherCamera::new(camera, view, size, gi.pixel_fraction),
            rows: Arc::new(rows),
            sky_samples: sky.map_or(0, |sky| sky.samples),
            // Its buffers are empty, so the period does not apply.
            work: Work::ALL,
            sequence: 0,
            is_new: true,
            relit: false,
            history: HistoryAction::Begins,
        };
        let layers = layers.cloned().unwrap_or_default();
        let inputs = ViewInputs { sky, has_occluders: occluders.is_kept(), layers };
        let Some((mut held, mut held_inputs)) = held else {
            commands.entity(entity).insert((next, inputs));
            continue;
        };
        let is_cut = jumps.cuts.contains(&main_entity.id());
        if held.rows == next.rows {
            next.rows = Arc::clone(&held.rows);
        }
        let reuse = held.reuse(&next);
        let switched = held.gi != next.gi || held_inputs.sky != inputs.sky;
        let moved = switched || *held_inputs != inputs || held.camera != next.camera || is_cut;
        if reuse != BufferReuse::Empty {
            let changed = moved || reuse == BufferReuse::LaidOut;
            next.work = held.work.next(
                changed,
                always,
                &frame,
                *policy,
                gi.refresh_period.max(1),
                if gi.converges() { gi.rest_frames.min(FrugalGi::MAX_REST_FRAMES) } else { 0 },
            );
        }
        // Light that was gathered before all occluders existed is not valid.
        next.is_new = is_cut || held_inputs.has_occluders != inputs.has_occluders;
        let lights = |gi: &FrugalGi| (gi.emissive, gi.bounces, gi.environment_samples);
        next.relit = lights(&held.gi) != lights(&next.gi) || held_inputs.sky != inputs.sky;
        // Cells average light over time, and a history fixes its samples while anything moves.
        let steps = frame.number % SEQUENCES;
        next.sequence = if gi.caches() { steps } else { next.work.rested };
        next.history = match next.work.gather {
            false => HistoryAction::Rests,
            true if next.work.rested > 0 => HistoryAction::Averages,
            true if next.is_new => HistoryAction::Begins,
            true if switched => HistoryAction::Switches,
            true if moved || reuse > BufferReuse::Same || always || frame.gather => {
                HistoryAction::Moves
            }
            true => HistoryAction::Begins,
        };
        (*held, *held_inputs) = (next, inputs);
    }
}

/// Rows of every map that serves `camera` and has texels, in an order that does not depend on where
/// they lie in the store.
fn rows_of(
    camera: Entity,
    layers: &RenderLayers,
    maps: &Query<(&RsmView, &LightMap)>,
) -> Vec<TexelRow> {
    let mut serving: Vec<_> = maps
        .iter()
        .filter(|(view, map)| {
            map.age.filled
                && view.camera.is_none_or(|owner| owner == camera)
                && map.layers.intersects(layers)
        })
        .collect();
    serving.sort_by_key(|(view, _)| **view);
    let mut rows = Vec::new();
    for (_, LightMap { light, cut, share, .. }) in serving {
        let side = light.resolution;
        TexelRow::add_map(&mut rows, light.texel_offset, side, side, (*cut, *share));
    }
    rows
}
