//! The controller's systems: observe, look up, allocate, switch, write.

use std::sync::Arc;

use bevy::asset::{AssetServer, Assets};
use bevy::camera::{Camera, Projection};
use bevy::ecs::prelude::*;
use bevy::log::warn;
use bevy::time::{Real, Time};
use bevy::transform::components::GlobalTransform;

use super::clock::{ControlClock, FeedbackState, RatedAt};
use super::controller::{Allocation, Decisions, Inputs, allocate, switch};
use super::limits::resolve;
use super::maps::{Overall, PreparedMaps, refuse, space_of, store_of};
use super::observed::SignalModel;
use super::{
    Budget, BudgetStateChanged, ControlSettings, ControlStatus, ErrorFeedback, ErrorPace,
    FrontierMapHandle, FrontierSource, Limit, MapRejected, OffReason, PowerFeedback, Selection,
    SettingsFilter, SettingsSwitched,
};
use crate::cut::CameraCut;
use crate::frontier::{
    AppConditions, CameraView, FrontierMap, FrontierStore, MapFit, Misfit, ShownScene,
};
use crate::knobs::{KnobLevels, KnobSettings, KnobSpace, KnownKnobs};
use crate::power::MeteredPower;
use crate::units::Watts;

/// Time for which a misfit lasts before it is logged, seconds: a slow frame or a step out of a door
/// is none.
const MISFIT_SECONDS: f64 = 2.0;

/// What one of a frame's systems leaves to the next.
#[derive(Clone, Debug, Default)]
pub(super) enum Step {
    /// The camera is inactive: everything stays as it is.
    #[default]
    Idle,
    /// The controller is off or waiting.
    Off(ControlStatus),
    LookedUp {
        view: CameraView,
        space: Arc<KnobSpace>,
    },
    Allocated {
        view: CameraView,
        space: Arc<KnobSpace>,
        allocation: Allocation,
        /// The camera's own limits as power and error, and its part of the app's.
        budget: Budget,
        binding: Option<Limit>,
        /// Levels of the knobs that the cameras share.
        agreed: Option<KnobLevels>,
    },
    Decided {
        space: Arc<KnobSpace>,
        binding: Option<Limit>,
        decisions: Decisions,
    },
}

/// The controller's state of one camera, from system to system and from frame to frame.
#[derive(Component, Debug, Default)]
pub(super) struct CameraState {
    pub(super) step: Step,
    /// Predicted power of the applied settings in the map's watts; `None` while the controller is
    /// off.
    predicted: Option<Watts>,
    /// Of the camera's map; `None` for other stores.
    pub(super) rated_at: Option<RatedAt>,
    is_active: bool,
    /// How long each misfit has lasted, seconds; infinite once it was logged.
    misfits: [f64; Misfit::ALL.len()],
}

impl CameraState {
    /// Predicted power of an active camera, in the map's watts; `Some(None)` if it is unknown.
    pub(super) fn predicted(&self) -> Option<Option<Watts>> {
        self.is_active.then_some(self.predicted)
    }
}

pub(super) type Source<'w> = AnyOf<(&'w FrontierMapHandle, &'w FrontierSource)>;

/// Finds every camera's frontiers, and how well they fit the app.
pub(super) fn look_up(
    time: Res<Time<Real>>,
    clock: Res<ControlClock>,
    (known, scene, metered): (
        Option<Res<KnownKnobs>>,
        Option<Res<ShownScene>>,
        Option<Res<MeteredPower>>,
    ),
    maps: Res<Assets<FrontierMap>>,
    server: Option<Res<AssetServer>>,
    mut prepared: ResMut<PreparedMaps>,
    mut cameras: Query<(
        Entity,
        Source<'static>,
        Option<&Budget>,
        &GlobalTransform,
        (Option<&Projection>, Option<&Camera>),
        &Selection,
        (&mut CameraState, &mut MapFit),
    )>,
) {
    for (
        entity,
        source,
        budget,
        transform,
        (projection, camera),
        selection,
        (mut state, mut fit),
    ) in &mut cameras
    {
        // What systems hand on to each other is no change for others to detect.
        let state = state.bypass_change_detection();
        state.is_active = camera.is_none_or(|camera| camera.is_active);
        if !state.is_active {
            state.step = Step::Idle;
            continue;
        }
        let logged = selection.status;
        let (server, known) = (server.as_deref(), known.as_deref());
        let found =
            space_of(source, &maps, server, &mut prepared, known, logged).and_then(|space| {
                match budget.map(Budget::validate) {
                    Some(Err(error)) => {
                        Err(refuse(logged, OffReason::InvalidBudget, || error.to_string()))
                    }
                    _ => Ok(space),
                }
            });
        let space = match found {
            Ok(space) => space,
            Err((status, message)) => {
                log(entity, message);
                state.step = Step::Off(status);
                continue;
            }
        };
        let view = CameraView::from_camera(transform, projection);
        let conditions = store_of(source, &maps).and_then(FrontierStore::conditions);
        state.rated_at = conditions.as_ref().map(|conditions| RatedAt {
            frames_per_second: conditions.capture.frames_per_second,
            idle: conditions.idle,
        });
        let new = conditions.map_or_else(MapFit::default, |conditions| {
            let app = AppConditions {
                scene: scene.as_ref().map(|scene| &scene.0),
                size: camera.and_then(Camera::physical_viewport_size),
                frames_per_second: clock.frames_per_second(),
                meter: metered.as_ref().and_then(|metered| metered.info.as_ref()),
            };
            MapFit::of(&conditions, &app, &view)
        });
        fit.set_if_neq(new);
        warn_of_misfits(entity, &new, &mut state.misfits, time.delta_secs_f64());
        state.step = Step::LookedUp { view, space };
    }
}

/// Selects a point of every camera's frontier.
pub(super) fn allocate_budgets(
    time: Res<Time<Real>>,
    settings: Res<ControlSettings>,
    (feedback, signals): (Res<PowerFeedback>, Res<SignalModel>),
    maps: Res<Assets<FrontierMap>>,
    mut cameras: Query<(
        Entity,
        Source<'static>,
        Option<&Budget>,
        &Selection,
        &mut CameraState,
        (&ErrorFeedback, &mut ErrorPace),
    )>,
) {
    for (entity, source, budget, selection, mut state, (errors, mut pace)) in &mut cameras {
        let state = state.bypass_change_detection();
        let Step::LookedUp { view, space } = &state.step else { continue };
        let (view, space) = (*view, Arc::clone(space));
        let Some(store) = store_of(source, &maps) else { continue };
        let overall = Overall(store);
        let store = if feedback.has_left_map { &overall } else { store };
        let budget = budget.copied().unwrap_or_default();
        let correction = feedback.per_camera();
        let frontier = store.look_up(&view).map(|found| found.frontier);
        let ends = frontier.and_then(|f| f.points().first().zip(f.points().last()));
        let mut observed = signals.observed();
        observed.range = ends.map(|(least, most)| {
            (correction.corrected(least.cost.power), correction.corrected(most.cost.power))
        });
        if feedback.state == FeedbackState::Off
            && let Some(conditions) = store.conditions()
        {
            // Predicted watts are those of the map's frame rate.
            observed.frames_per_second = Some(conditions.capture.frames_per_second);
        }
        let envelope = resolve(&budget, &observed);
        let inputs = Inputs {
            store,
            view,
            budget: envelope.budget(),
            delta_seconds: time.delta_secs_f64(),
            current: None,
            correction,
            errors: *errors,
            settings: *settings,
            agreed: None,
        };
        // This state advances every frame without a change for others to detect.
        state.step = match allocate(&inputs, pace.bypass_change_detection()) {
            Some(allocation) => {
                let power = envelope.power.map(|power| correction.uncorrected(power));
                let binding = frontier.and_then(|f| envelope.binds(power, f, &allocation.choice));
                let (budget, agreed) = (inputs.budget, None);
                Step::Allocated { view, space, allocation, budget, binding, agreed }
            }
            None => {
                let (status, message) = refuse(selection.status, OffReason::NothingKnown, || {
                    "no sample camera of the map has a frontier: check that its scene is not empty and its bounds do not lie inside a wall".to_owned()
                });
                log(entity, message);
                Step::Off(status)
            }
        };
    }
}

/// Moves every camera's settings towards the selected ones.
pub(super) fn switch_settings(
    time: Res<Time<Real>>,
    settings: Res<ControlSettings>,
    feedback: Res<PowerFeedback>,
    maps: Res<Assets<FrontierMap>>,
    mut cameras: Query<(
        Source<'static>,
        &mut CameraState,
        &mut SettingsFilter,
        (&ErrorFeedback, &mut ErrorPace),
        Option<&KnobSettings>,
        Has<CameraCut>,
    )>,
) {
    for (source, mut state, mut filter, (errors, mut pace), knobs, has_cut) in &mut cameras {
        let state = state.bypass_change_detection();
        let Step::Allocated { view, space, allocation, budget, binding, agreed } = &state.step
        else {
            continue;
        };
        let binding = *binding;
        let Some(store) = store_of(source, &maps) else { continue };
        let overall = Overall(store);
        let store = if feedback.has_left_map { &overall } else { store };
        let inputs = Inputs {
            store,
            view: *view,
            budget: *budget,
            delta_seconds: time.delta_secs_f64(),
            // Levels of another knob space do not apply to this one.
            current: knobs
                .filter(|knobs| same_space(&knobs.space, space))
                .map(|knobs| knobs.settings),
            correction: feedback.per_camera(),
            errors: *errors,
            settings: *settings,
            agreed: *agreed,
        };
        // Both advance every frame without a change for others to detect.
        let filter = filter.bypass_change_detection();
        if has_cut {
            filter.cut();
        }
        let decisions = switch(&inputs, allocation, filter, pace.bypass_change_detection());
        state.predicted = Some(decisions.uncorrected);
        state.step = Step::Decided { space: Arc::clone(space), binding, decisions };
    }
}

/// Writes what was decided, and tells of changes.
pub(super) fn write_decisions(
    mut commands: Commands,
    mut switched: MessageWriter<SettingsSwitched>,
    mut changed: MessageWriter<BudgetStateChanged>,
    mut rejected: MessageWriter<MapRejected>,
    mut cameras: Query<(Entity, &mut CameraState, &mut Selection, Option<&mut KnobSettings>)>,
) {
    for (camera, mut state, mut selection, knobs) in &mut cameras {
        let state = state.bypass_change_detection();
        let before = *selection;
        let new = match &state.step {
            Step::Off(status) => Selection {
                status: *status,
                predicted: None,
                predicted_applied: None,
                binding: None,
                sample: None,
                ..before
            },
            Step::Decided { decisions, binding, .. } => Selection {
                binding: *binding,
                status: ControlStatus::Active(decisions.outcome),
                target: decisions.target,
                applied: decisions.applied,
                predicted: Some(decisions.predicted),
                predicted_applied: Some(decisions.predicted_applied),
                sample: Some(decisions.sample),
            },
            Step::Idle | Step::LookedUp { .. } | Step::Allocated { .. } => continue,
        };
        if let Step::Off(status) = &state.step {
            state.predicted = None;
            if let (ControlStatus::Off(reason), true) = (*status, *status != before.status)
                && reason != OffReason::InvalidBudget
            {
                rejected.write(MapRejected { camera, reason });
            }
        }
        if new.status != before.status {
            changed.write(BudgetStateChanged { camera, from: before.status, to: new.status });
        }
        selection.set_if_neq(new);
        let Step::Decided { space, decisions, .. } = &state.step else { continue };
        let to = decisions.applied;
        match knobs {
            Some(knobs) => {
                if same_space(&knobs.space, space) && knobs.settings != to {
                    let from = knobs.settings;
                    let target = decisions.target;
                    switched.write(SettingsSwitched { camera, from, to, target });
                }
                write(knobs, space, to);
            }
            None => {
                let settings = KnobSettings { space: Arc::clone(space), settings: to };
                commands.entity(camera).try_insert(settings);
            }
        }
    }
}

/// Whether two spaces are equal. Compares contents only where the pointers differ; [`write`] then
/// makes the pointers equal.
pub(super) fn same_space(a: &Arc<KnobSpace>, b: &Arc<KnobSpace>) -> bool {
    Arc::ptr_eq(a, b) || a == b
}

/// Writes the settings, and triggers change detection only if their meaning differs.
fn write(mut knobs: Mut<KnobSettings>, space: &Arc<KnobSpace>, applied: KnobLevels) {
    let same = same_space(&knobs.space, space);
    if !same || knobs.settings != applied {
        *knobs = KnobSettings { space: Arc::clone(space), settings: applied };
    } else if !Arc::ptr_eq(&knobs.space, space) {
        knobs.bypass_change_detection().space = Arc::clone(space);
    }
}

fn log(camera: Entity, message: Option<String>) {
    if let Some(message) = message {
        warn!("the power controller is off for camera {camera}: {message}");
    }
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

/// Removes the controller's state from a camera that is no longer controlled. Its [`KnobSettings`]
/// stay and belong to the app from then on.
pub(super) fn forget_camera<C: Component>(removed: On<Remove, C>, mut commands: Commands) {
    let camera = removed.entity;
    // The removed components are still present here, both where both are removed at once.
    commands.queue(move |world: &mut World| {
        let Ok(mut camera) = world.get_entity_mut(camera) else { return };
        if !camera.contains::<FrontierMapHandle>() && !camera.contains::<FrontierSource>() {
            camera.remove::<(Selection, SettingsFilter, ErrorFeedback, ErrorPace, MapFit, CameraState)>();
        }
    });
}

#[cfg(test)]
#[path = "systems_tests.rs"]
mod tests;
