//! What each GI camera has to do in a frame: from which texels its VPLs are sampled, and whether.

use bevy::ecs::prelude::*;
use bevy::math::{Affine3A, Mat4};
use bevy::render::camera::{ExtractedCamera, TemporalJitter};
use bevy::render::sync_world::MainEntity;
use bevy::render::view::ExtractedView;

use crate::gi::bounces::BounceCamera;
use crate::gi::emissive::GiEmitters;
use crate::gi::rsm::{RsmLight, RsmView};
use crate::gi::settings::FrugalGi;
use crate::gi::sky::{SkyCamera, SkySeen};
use crate::gi::texels::{CascadeCut, TexelRange, TexelRow, TexelStore};
use crate::gi::trace::GiOccluders;
use crate::gi::view::{CutCameras, Fit, GatherPlace, GiFrame, GiRefresh, GiView, Step, Work};

/// What decides about a camera's VPLs and what they send to it, beside the scene.
#[derive(Component, Clone, Debug, PartialEq)]
pub(super) struct Seen {
    gi: FrugalGi,
    exposure: f32,
    world_from_view: Affine3A,
    clip_from_view: Mat4,
    sky: Option<SkySeen>,
    /// Whether what rays may meet was there. It is not in the frame in which an app asks for rays
    /// after it was collected.
    has_occluders: bool,
}

impl Seen {
    fn new(
        gi: &FrugalGi,
        camera: &ExtractedCamera,
        view: &ExtractedView,
        sky: Option<SkySeen>,
        has_occluders: bool,
    ) -> Self {
        let (world_from_view, clip_from_view) =
            (view.world_from_view.affine(), view.clip_from_view);
        Self {
            gi: gi.clone(),
            exposure: camera.exposure,
            world_from_view,
            clip_from_view,
            sky,
            has_occluders,
        }
    }
}

impl Seen {
    /// Whether both are of the same settings and sky, wherever the camera is.
    fn has_settings_of(&self, other: &Self) -> bool {
        self.gi == other.gi && self.sky == other.sky
    }
}

/// Gives every GI camera that has light to gather its [`GiView`], and takes it from the others.
pub(super) fn prepare(
    mut commands: Commands,
    store: Res<TexelStore>,
    (frame, policy, cuts): (Res<GiFrame>, Res<GiRefresh>, Res<CutCameras>),
    maps: Query<(&RsmView, &RsmLight, &CascadeCut)>,
    (emitters, occluders): (Res<GiEmitters>, Res<GiOccluders>),
    cameras: Query<(
        Entity,
        &MainEntity,
        &FrugalGi,
        &ExtractedCamera,
        &ExtractedView,
        Has<TemporalJitter>,
        Option<&SkyCamera>,
        Option<&BounceCamera>,
    )>,
    mut held: Query<(&mut GiView, &mut Seen)>,
    stale: Query<Entity, (With<GiView>, Or<(Without<FrugalGi>, Without<ExtractedCamera>)>)>,
) {
    for entity in &stale {
        commands.entity(entity).remove::<(GiView, Seen)>();
    }
    for (entity, main_entity, gi, camera, view, jitters, sky, bounces) in &cameras {
        let mut rows = rows_of(main_entity.id(), &maps);
        if gi.emissive {
            emitters.add_rows(camera.exposure, store.first(TexelRange::Emissive), &mut rows);
        }
        if let Some(bounces) = bounces {
            bounces.add_rows(&mut rows);
        }
        if store.texels.is_none() {
            rows.clear();
        }
        let sky = sky.and_then(SkyCamera::seen);
        let Some(size) = camera.physical_viewport_size.filter(|size| size.min_element() > 0) else {
            continue;
        };
        if !gi.gathers() || (rows.is_empty() && sky.is_none()) {
            if held.contains(entity) {
                commands.entity(entity).remove::<(GiView, Seen)>();
            }
            continue;
        }
        let always = jitters || sky.as_ref().is_some_and(|sky| sky.is_generated());
        let mut next = GiView {
            gi: gi.clone(),
            place: GatherPlace::new(camera, view, size, gi.pixel_fraction),
            rows,
            sky_samples: sky.as_ref().map_or(0, |sky| sky.samples()),
            // Its buffers are empty, whatever the period says.
            work: Work::ALL,
            step: Step::Begins,
        };
        let seen = Seen::new(gi, camera, view, sky, occluders.is_kept());
        let Ok((mut held, mut held_seen)) = held.get_mut(entity) else {
            commands.entity(entity).insert((next, seen));
            continue;
        };
        let is_cut = cuts.0.contains(&main_entity.id());
        let fit = held.fit(&next);
        let moved = *held_seen != seen || is_cut;
        if fit != Fit::Empty {
            let changed = moved || fit == Fit::LaidOut;
            next.work = held.work.next(changed, always, &frame, *policy, gi.refresh_period.max(1));
        }
        next.step = match next.work.gather {
            false => Step::Rests,
            true if is_cut => Step::Begins,
            true if !held_seen.has_settings_of(&seen) => Step::Switches,
            true if moved || fit > Fit::Same || always || frame.gather => Step::Moves,
            true => Step::Begins,
        };
        (*held, *held_seen) = (next, seen);
    }
}

/// Rows of every map that serves `camera`, in the order of the store.
fn rows_of(camera: Entity, maps: &Query<(&RsmView, &RsmLight, &CascadeCut)>) -> Vec<TexelRow> {
    let mut serving: Vec<_> = maps
        .iter()
        .filter(|(map, ..)| map.camera.is_none_or(|owner| owner == camera))
        .map(|(_, light, cut)| (light, *cut))
        .collect();
    serving.sort_by_key(|(light, _)| light.texel_offset);
    let mut rows = Vec::new();
    for (RsmLight { texel_offset, resolution, .. }, cut) in serving {
        TexelRow::add_map(&mut rows, *texel_offset, *resolution, *resolution, cut);
    }
    rows
}
