//! One system for every camera's frame: look up, choose, divide, switch, write.

use std::sync::Arc;

use bevy::ecs::system::SystemParam;
use bevy::prelude::*;
use frugal_core::control::{
    FrameKind, FrameRate, Observed, RateTracker, RatedAt, SignalModel, resolve,
};
use smallvec::SmallVec;

use super::components::CameraState;
use super::events::{write_selection, write_settings};
use super::frame::{Controlled, ControlledItem, Frame, same_space, weight_of};
use super::maps::{PreparedMaps, Refusal, frontier_in_play, refuse, source_of};
use super::power_feedback::FeedbackState;
use super::{
    AppBudget, ControlSettings, ControlStatus, ErrorFeedback, FrontierSource, Inputs, Limit,
    OffReason, PowerController, PowerFeedback, Selection, SettingsFilter,
};
use crate::frontier::{
    AppConditions, CameraView, Conditions, CostPoint, Frontier, FrontierMap, MapFit, Misfit,
    SampleRef, ShownScene, camera_view,
};
use crate::knobs::{KnobRegistry, KnobSpace};
use crate::power::MeteredPower;
use crate::units::Watts;

/// Time after which a lasting misfit is logged, seconds. Slow frames and steps out of a door pass.
const MISFIT_SECONDS: f64 = 2.0;

/// What all cameras have in common.
#[derive(SystemParam)]
pub(super) struct Common<'w> {
    pub(super) time: Res<'w, Time<Real>>,
    rate: Res<'w, FrameRate>,
    pub(super) settings: Res<'w, ControlSettings>,
    pub(super) feedback: Res<'w, PowerFeedback>,
    signals: Res<'w, SignalModel>,
    pub(super) app_budget: Res<'w, AppBudget>,
    known: Option<Res<'w, KnobRegistry>>,
    scene: Option<Res<'w, ShownScene>>,
    metered: Option<Res<'w, MeteredPower>>,
    maps: Res<'w, Assets<FrontierMap>>,
    server: Option<Res<'w, AssetServer>>,
}

/// Decides and writes every camera's settings.
pub(super) fn control_cameras(
    mut commands: Commands,
    common: Common,
    mut prepared: ResMut<PreparedMaps>,
    mut together: Local<RateTracker>,
    mut cameras: Query<Controlled>,
) {
    let mut active: SmallVec<[ControlledItem; 4]> = SmallVec::new();
    let mut frames: SmallVec<[Frame; 4]> = SmallVec::new();
    for mut camera in &mut cameras {
        // What the controller keeps for itself is no change for others to detect.
        let state = camera.state.bypass_change_detection();
        // A minimised window has no pixels.
        let has_pixels = |camera: &Camera| {
            camera.physical_viewport_size().is_none_or(|size| size.x > 0 && size.y > 0)
        };
        state.is_active = camera.camera.is_none_or(|camera| camera.is_active && has_pixels(camera));
        if !state.is_active {
            continue;
        }
        match common.look_up(&mut prepared, &mut camera) {
            Ok(frame) => {
                active.push(camera);
                frames.push(frame);
            }
            Err(status) => {
                camera.state.bypass_change_detection().predicted = None;
                let off = Selection {
                    status,
                    predicted: None,
                    predicted_applied: None,
                    binding: None,
                    sample: None,
                    ..*camera.selection
                };
                write_selection(&mut commands, &mut camera, off);
            }
        }
    }
    common.divide(&mut together, &mut frames);
    let mut sum = CostPoint::new(0.0, 0.0);
    for (camera, frame) in active.into_iter().zip(frames) {
        sum.power = sum.power + common.switch(camera, frame, &mut commands);
    }
    together.spend(sum, common.time.delta_secs_f64());
}

impl Common<'_> {
    /// Finds the camera's frontier, and its own choice there. An error says why the controller is off
    /// or waiting.
    fn look_up<'a>(
        &'a self,
        prepared: &mut PreparedMaps,
        camera: &mut ControlledItem<'a, '_>,
    ) -> Result<Frame<'a>, ControlStatus> {
        let (source, logged) = (camera.source, camera.selection.status);
        let (server, known) = (self.server.as_deref(), self.known.as_deref());
        let entity = camera.entity;
        let off = |(status, message): Refusal| {
            if let Some(message) = message {
                warn!("the power controller is off for camera {entity}: {message}");
            }
            Err(status)
        };
        let (store, space) = match source_of(source, &self.maps, server, prepared, known, logged) {
            Ok(found) => found,
            Err(refusal) => return off(refusal),
        };
        let view = camera_view(camera.transform, camera.projection);
        let conditions = store.conditions();
        self.compare(camera, conditions.as_ref(), &view);
        let budget = camera.budget.copied().unwrap_or_default();
        let found = store.look_up(&view);
        let has_left_map = self.feedback.has_left_map;
        let found = found.map(|found| SampleRef {
            frontier: frontier_in_play(store, found, has_left_map),
            ..found
        });
        let whole = found.map(|found| found.frontier);
        let limits = match resolve(&budget, &self.observed(whole, conditions.as_ref())) {
            Ok(limits) => limits,
            Err(error) => {
                let refusal = refuse(logged, OffReason::InvalidBudget, || error.to_string());
                return off(refusal);
            }
        };
        pin_what_others_wrote(camera, &space);
        let state = camera.state.bypass_change_detection();
        let bounded = whole.and_then(|whole| state.bounded.get(&camera.bounds, &space, whole));
        let frontier = bounded.as_deref().or(whole);
        // Both advance every frame without a change for others to detect.
        let filter = camera.filter.bypass_change_detection();
        let rates = camera.rates.bypass_change_detection();
        if camera.has_cut {
            filter.cut();
        }
        if camera.bounds.is_changed() {
            filter.end_dwell();
        }
        filter.observe_view(&view, self.time.delta_secs_f64());
        // Levels of another knob space do not apply to this one.
        let knobs = camera.knobs.as_ref().filter(|knobs| same_space(&knobs.space, &space));
        let given = Inputs {
            store,
            view,
            budget,
            delta_seconds: self.time.delta_secs_f64(),
            current: knobs.map(|knobs| knobs.settings),
            correction: self.feedback.per_camera(),
            mean_correction: self.feedback.mean_per_camera(),
            errors: *camera.errors,
            settings: *self.settings,
        };
        let choice = frontier.and_then(|frontier| given.choose(&limits, frontier, rates, filter));
        let has_moved = filter.has_moved() && !rates.is_instant();
        let (Some(found), Some(mut choice)) = (found, choice) else {
            let refusal = refuse(logged, OffReason::NothingKnown, || {
                "no sample camera of the map has a frontier: check that its scene is not empty and its bounds do not lie inside a wall".to_owned()
            });
            return off(refusal);
        };
        let is_excluded = || {
            let best = found.frontier.points().last();
            best.is_some_and(|best| best.cost.error < choice.cost.error)
        };
        if bounded.is_some() && choice.binding.is_none() && is_excluded() {
            choice.binding = Some(Limit::KnobBounds);
        }
        let weight = weight_of(camera.camera, camera.priority);
        let stored = given.stored(&limits);
        let could_stay = [stored.power, stored.peak].into_iter().flatten();
        let could_stay = could_stay.map(|limit| limit.0).fold(f64::INFINITY, f64::min);
        let most = if has_moved { choice.most.power } else { Watts(could_stay) };
        let agreed = None;
        Ok(Frame { weight, has_moved, given, limits, space, found, bounded, choice, most, agreed })
    }

    /// How well the camera's map fits the app.
    fn compare(
        &self,
        camera: &mut ControlledItem<'_, '_>,
        conditions: Option<&Conditions<'_>>,
        view: &CameraView,
    ) {
        let state = camera.state.bypass_change_detection();
        state.rated_at = conditions.map(|conditions| RatedAt {
            frames_per_second: conditions.capture.frames_per_second,
            idle: conditions.idle,
        });
        let new = conditions.map_or_else(MapFit::default, |conditions| {
            let app = AppConditions {
                scene: self.scene.as_ref().map(|scene| &scene.0),
                size: camera.camera.and_then(Camera::physical_viewport_size),
                frames_per_second: self.rate.frames_per_second(),
                meter: self.metered.as_ref().and_then(|metered| metered.info.as_ref()),
            };
            MapFit::of(conditions, &app, view)
        });
        camera.fit.set_if_neq(new);
        if self.rate.kind() != FrameKind::Pause {
            warn_of_misfits(camera.entity, &new, &mut state.misfits, self.time.delta_secs_f64());
        }
    }

    /// What is known for the limits of a camera with this frontier.
    fn observed(
        &self,
        frontier: Option<&Frontier>,
        conditions: Option<&Conditions<'_>>,
    ) -> Observed {
        let correction = self.feedback.per_camera();
        let ends = frontier.and_then(|it| it.points().first().zip(it.points().last()));
        let mut observed = self.signals.observed();
        (observed.correction, observed.cameras) = (self.feedback.correction, self.feedback.cameras);
        observed.range = ends.map(|(least, most)| {
            (correction.corrected(least.cost.power), correction.corrected(most.cost.power))
        });
        let of_map = conditions.map(|conditions| conditions.capture.frames_per_second);
        // Without a meter, predicted watts are those of the map's frame rate.
        observed.frames_per_second = match self.feedback.state {
            FeedbackState::Off => of_map.or(self.rate.frames_per_second()),
            _ => self.rate.frames_per_second().or(of_map),
        };
        observed
    }

    /// Moves the camera's settings towards the choice, and writes them. Returns the predicted power of
    /// what is applied, in the store's watts.
    fn switch(
        &self,
        mut camera: ControlledItem<'_, '_>,
        frame: Frame<'_>,
        commands: &mut Commands,
    ) -> Watts {
        let Frame { given, limits, space, found, choice, agreed, .. } = frame;
        let charge =
            |settings| agreed.as_ref().map_or(Watts(0.0), |agreed| agreed.charge(settings));
        // Both advance every frame without a change for others to detect.
        let filter = camera.filter.bypass_change_detection();
        let rates = camera.rates.bypass_change_detection();
        let decisions = given.switch(&limits, found, &choice, charge, filter, rates);
        camera.state.bypass_change_detection().predicted = Some(decisions.uncorrected);
        write_selection(
            commands,
            &mut camera,
            Selection {
                binding: choice.binding,
                status: ControlStatus::Active(decisions.outcome),
                target: decisions.target,
                applied: decisions.applied,
                predicted: Some(decisions.predicted),
                predicted_applied: Some(decisions.predicted_applied),
                sample: Some(decisions.sample),
            },
        );
        write_settings(commands, camera, &space, &decisions);
        decisions.uncorrected
    }
}

/// Pins the knobs that somebody beside the controller has written since the last frame.
fn pin_what_others_wrote(camera: &mut ControlledItem<'_, '_>, space: &Arc<KnobSpace>) {
    let Some(knobs) = camera.knobs.as_ref() else { return };
    let applied = camera.filter.applied();
    let is_others = camera.filter.is_smooth()
        && camera.selection.predicted.is_some()
        && same_space(&knobs.space, space)
        && knobs.settings != applied;
    // A warm-up shows every level for a frame.
    if camera.is_warming || !is_others {
        return;
    }
    let new = knobs.settings;
    camera.bounds.pin_changes(space, applied, new);
}

/// Logs every misfit that lasts, once.
fn warn_of_misfits(
    camera: Entity,
    fit: &MapFit,
    lasted: &mut [f64; Misfit::ALL.len()],
    delta_seconds: f64,
) {
    for (misfit, lasted) in Misfit::ALL.into_iter().zip(lasted) {
        if *lasted == f64::INFINITY {
            continue;
        }
        *lasted = if fit.has(misfit) { *lasted + delta_seconds } else { 0.0 };
        if *lasted > MISFIT_SECONDS {
            warn!(
                "camera {camera}: its predicted power and error are off: {}",
                fit.describe(misfit)
            );
            *lasted = f64::INFINITY;
        }
    }
}

/// Removes the controller's state from a camera that is no longer controlled. Its `KnobSettings`
/// and `KnobBounds` stay and belong to the app from then on.
pub(super) fn forget_camera<C: Component>(removed: On<Remove, C>, mut commands: Commands) {
    let camera = removed.entity;
    // The removed components are still present here, both where both are removed at once.
    commands.queue(move |world: &mut World| {
        let Ok(mut camera) = world.get_entity_mut(camera) else { return };
        if !camera.contains::<PowerController>() && !camera.contains::<FrontierSource>() {
            camera.remove::<(Selection, SettingsFilter, ErrorFeedback, RateTracker, MapFit, CameraState)>();
        }
    });
}

#[cfg(test)]
#[path = "camera_tests.rs"]
mod tests;
