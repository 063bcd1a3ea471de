//! The hidden camera that renders a part of a camera's view at the best settings.

use std::sync::Arc;
use std::time::Duration;

use bevy::anti_alias::taa::TemporalAntiAliasing;
use bevy::asset::RenderAssetUsages;
use bevy::camera::{RenderTarget, SubCameraView};
use bevy::ecs::system::SystemParam;
use bevy::post_process::auto_exposure::AutoExposure;
use bevy::prelude::*;
use bevy::render::gpu_readback::{Readback, ReadbackComplete};
use bevy::render::render_resource::TextureFormat;
use bevy::render::storage::ShaderBuffer;

use super::compare::{Comparison, Tile, bytes, error};
use super::{ErrorMeter, ErrorProbe, MeasuredError};
use crate::camera_copy::{ShowsWholeOnly, copy_looks};
use crate::control::{ErrorFeedback, Selection};
use crate::knobs::{KnobLevels, KnobRegistry, KnobSettings};

/// Frames after which a comparison without a result is given up: its pipeline compiles meanwhile.
const PATIENCE_FRAMES: u32 = 240;
/// Least frames that a probe renders: motion is known from the second on.
const MIN_FRAMES: u32 = 2;
/// The same with temporal antialiasing: its jitter has gone round twice.
const TEMPORAL_FRAMES: u32 = 16;
/// Distance within which a probe's automatic exposure is where it belongs in one frame, f-stops.
const ANY_EXPOSURE: f32 = 64.0;

/// An [`ErrorMeter`]'s state.
#[derive(Component, Debug, Default)]
pub(super) struct MeterState {
    /// Since the last measurement began.
    waited: Duration,
    /// Measurements begun.
    begun: u32,
    /// Where the camera was at the last measurement, and its settings: nothing new is to be
    /// measured of a view that stays.
    last: Option<(GlobalTransform, KnobLevels)>,
    phase: Phase,
}

#[derive(Debug, Default)]
enum Phase {
    #[default]
    Waits,
    /// A probe renders.
    Renders { probe: Entity, tile: Tile, frames: u32 },
    /// It was compared in the last frame, or before, and the sums are on their way.
    Reads { probe: Entity, reader: Entity, frames: u32 },
}

/// On the entity that reads sums back.
#[derive(Component, Debug)]
pub(super) struct PendingReadback {
    camera: Entity,
    tile: Tile,
    /// Error of the frame that the camera's map predicted.
    predicted: Option<f64>,
}

/// Assets of probes.
#[derive(SystemParam)]
pub(super) struct ProbeAssets<'w> {
    images: ResMut<'w, Assets<Image>>,
    buffers: ResMut<'w, Assets<ShaderBuffer>>,
}

type Measured = (
    Entity,
    &'static ErrorMeter,
    &'static mut MeterState,
    &'static Camera,
    &'static Projection,
    Option<&'static KnobSettings>,
    Option<&'static Selection>,
    (Has<TemporalAntiAliasing>, Has<AutoExposure>),
);

/// A probe.
type Probe =
    (&'static mut Projection, &'static mut GlobalTransform, Option<&'static mut AutoExposure>);

/// Begins, goes on with and ends the measurements of all meters.
pub(super) fn drive(
    (time, shown_time): (Res<Time<Real>>, Res<Time>),
    registry: Option<Res<KnobRegistry>>,
    transforms: TransformHelper,
    mut meters: Query<Measured, Without<ErrorProbe>>,
    whole: Query<(), ShowsWholeOnly>,
    mut probes: Query<Probe, With<ErrorProbe>>,
    mut assets: ProbeAssets,
    mut commands: Commands,
) {
    let Some(registry) = registry else { return };
    for (camera, meter, mut state, view, projection, knobs, selection, history) in &mut meters {
        let (is_temporal, is_exposed) = history;
        let state = state.bypass_change_detection();
        state.waited = state.waited.saturating_add(time.delta());
        let Ok(place) = transforms.compute_global_transform(camera) else { continue };
        match &mut state.phase {
            Phase::Waits => {
                let is_due = state.begun == 0 || state.waited >= meter.interval(state.begun);
                let Some(knobs) = knobs.filter(|_| is_due) else { continue };
                let best = best(&registry, knobs);
                if !view.is_active
                    || view.sub_camera_view.is_some()
                    || knobs.settings == best
                    || state.last == Some((place, knobs.settings))
                    || is_exposed && shown_time.delta_secs() <= 0.0
                {
                    continue;
                }
                let share = if whole.contains(camera) { 1.0 } else { meter.share };
                let size = view.physical_viewport_size();
                let Some(tile) = size.and_then(|size| Tile::new(size, share, state.begun)) else {
                    continue;
                };
                let best = KnobSettings { space: Arc::clone(&knobs.space), settings: best };
                let target = Image::new_target_texture(
                    tile.size.x,
                    tile.size.y,
                    TextureFormat::Rgba8UnormSrgb,
                    None,
                );
                let target = assets.images.add(target);
                let probe = commands
                    .spawn((
                        ErrorProbe { camera },
                        Camera3d::default(),
                        Camera {
                            // Drawn before it is compared.
                            order: view.order.saturating_sub(1),
                            clear_color: view.clear_color,
                            invert_culling: view.invert_culling,
                            sub_camera_view: Some(SubCameraView {
                                full_size: tile.full,
                                offset: tile.offset.as_vec2(),
                                size: tile.size,
                            }),
                            ..Default::default()
                        },
                        RenderTarget::Image(target.into()),
                        projection.clone(),
                        place,
                        best,
                    ))
                    // An app's `Single<&mut Transform, With<Camera>>` means its own camera.
                    .remove::<Transform>()
                    .id();
                commands.queue(move |world: &mut World| copy_looks(world, camera, probe));
                state.phase = Phase::Renders { probe, tile, frames: 0 };
                state.waited = Duration::ZERO;
                state.begun = state.begun.wrapping_add(1).max(1);
            }
            Phase::Renders { probe, tile, frames } => {
                *frames += 1;
                let same = view.physical_viewport_size() == Some(tile.full) && view.is_active;
                // While time stands still, exposure cannot come to rest, and the probe would render on.
                let seconds = shown_time.delta_secs();
                let goes_on = same && !(is_exposed && seconds <= 0.0);
                let (Ok((mut lens, mut at, exposure)), Some(knobs), true) =
                    (probes.get_mut(*probe), knobs, goes_on)
                else {
                    commands.entity(*probe).try_despawn();
                    state.phase = Phase::Waits;
                    continue;
                };
                *lens = projection.clone();
                at.set_if_neq(place);
                if let Some(mut exposure) = exposure {
                    adapt(&mut exposure, seconds);
                }
                let least = if is_temporal { TEMPORAL_FRAMES } else { MIN_FRAMES };
                if *frames < meter.frames.max(least) {
                    continue;
                }
                let buffer = ShaderBuffer::with_size(bytes(tile), RenderAssetUsages::RENDER_WORLD);
                let sums = assets.buffers.add(buffer);
                commands.entity(*probe).insert(Comparison {
                    camera,
                    tile: *tile,
                    sums: sums.clone(),
                });
                let predicted = selection.and_then(|selection| selection.predicted_applied);
                let predicted = predicted.map(|cost| cost.error);
                let reading = PendingReadback { camera, tile: *tile, predicted };
                let reader = commands.spawn((reading, Readback::buffer(sums))).observe(read).id();
                state.last = Some((place, knobs.settings));
                state.phase = Phase::Reads { probe: *probe, reader, frames: 0 };
            }
            Phase::Reads { probe, reader, frames } => {
                if *frames == 0 {
                    commands.entity(*probe).try_despawn();
                }
                *frames += 1;
                if *frames > PATIENCE_FRAMES {
                    commands.entity(*reader).try_despawn();
                    state.phase = Phase::Waits;
                }
            }
        }
    }
}

/// Lets automatic exposure come to rest in a frame of `seconds`. The camera's own has followed its
/// image for long; that of a probe would begin with none.
fn adapt(exposure: &mut AutoExposure, seconds: f32) {
    let speed = ANY_EXPOSURE / seconds;
    exposure.exponential_transition_distance = ANY_EXPOSURE;
    (exposure.speed_brighten, exposure.speed_darken) = (speed, speed);
}

/// The best settings for a probe of a camera with `knobs`: knobs of the whole app stay as they are,
/// since they would change in the camera's image, too.
fn best(registry: &KnobRegistry, knobs: &KnobSettings) -> KnobLevels {
    let space = &knobs.space;
    (0..space.len()).fold(space.canonical(space.highest()), |best, knob| {
        let is_shared = registry.is_app_wide(&space.knobs()[knob].name);
        if is_shared { best.with_level(knob, knobs.settings.level(knob)) } else { best }
    })
}

/// Takes account of sums that have arrived.
fn read(
    sums: On<ReadbackComplete>,
    readings: Query<&PendingReadback>,
    mut meters: Query<(&mut MeterState, &mut MeasuredError, Option<&mut ErrorFeedback>)>,
    mut commands: Commands,
) {
    let Ok(PendingReadback { camera, tile, predicted }) = readings.get(sums.entity) else { return };
    // Nothing was compared yet: the pipeline compiles.
    let Some(error) = error(tile, &sums.data) else { return };
    commands.entity(sums.entity).try_despawn();
    let Ok((mut state, mut measured, feedback)) = meters.get_mut(*camera) else { return };
    state.bypass_change_detection().phase = Phase::Waits;
    *measured = MeasuredError { last: Some(error), count: measured.count.wrapping_add(1) };
    if let (Some(mut feedback), Some(predicted)) = (feedback, *predicted) {
        feedback.observe(error, predicted);
    }
}

/// Ends a measurement with its meter.
pub(super) fn stop(
    removed: On<Remove, ErrorMeter>,
    probes: Query<(Entity, &ErrorProbe)>,
    readings: Query<(Entity, &PendingReadback)>,
    mut commands: Commands,
) {
    let probes = probes.iter().filter(|(_, probe)| probe.camera == removed.entity);
    let readings = readings.iter().filter(|(_, reading)| reading.camera == removed.entity);
    for entity in probes.map(|(entity, _)| entity).chain(readings.map(|(entity, _)| entity)) {
        commands.entity(entity).try_despawn();
    }
    commands.entity(removed.entity).try_remove::<(MeterState, MeasuredError)>();
}
