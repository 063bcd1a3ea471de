//! The controller: selects every camera's knob settings from its frontiers under its budget, and
//! moves there smoothly.
//!
//! | component of a camera | written by | holds |
//! |---|---|---|
//! | [`PowerController`] or [`FrontierSource`] | the app | the source of its frontiers |
//! | [`Budget`] | the app | its limits: power, error, energy, time, battery, heat |
//! | [`KnobBounds`] | the app, and whoever writes to `KnobSettings` | levels that the controller may set |
//! | [`Selection`] | the controller | the selected settings, their predicted cost, and whether the budget is met |
//! | [`MapFit`] | the controller | how well the map fits this app |
//! | [`ErrorFeedback`] | the [error meter](crate::error_meter), or the app | how measured errors compare with predicted ones |
//! | [`RateTracker`] | the controller | the exchange rate of power and error, and what was spent of the budget |
//! | [`SettingsFilter`] | the controller | the transition from old settings to new ones; the app may call [`cut`](SettingsFilter::cut) on it |
//! | [`KnobSettings`](crate::knobs::KnobSettings) | the controller | the settings to apply |
//!
//! [`PowerFeedback`] says how the app's meter corrects predicted watts. [`CameraController`] is the
//! same controller without an app: plain data in, [`Decisions`] out.

mod app_budget;
mod camera;
mod components;
mod events;
mod frame;
mod maps;
mod power_feedback;

use bevy::asset::AssetEventSystems;
use bevy::prelude::*;
pub use frugal_core::control::{
    Budget, BudgetError, CameraController, Choice, ControlSettings, Decisions, ErrorFeedback,
    Inputs, KnobBounds, Limit, Outcome, PowerCorrection, PowerModel, RateTracker, SettingsFilter,
    select,
};
use frugal_core::control::{FrameKind, FrameRate, FrameSignals, SignalModel};

use crate::frontier::{FrontierMap, MapFit};
use crate::knobs::KnobRegistry;
use crate::pacing::FrameWait;
use crate::power::MeteredPower;
use crate::signals::{BatteryLevel, BatterySettings, FrameTime, ThermalHeadroom, read_battery};
use components::CameraState;

pub use components::{
    AppBudget, CameraPriority, ControlStatus, FrontierSource, OffReason, PowerController, Selection,
};
pub use events::{BudgetStateChanged, MapRejected, SettingsSwitched};
pub use maps::frontier_in_play;
use power_feedback::{FeedbackModel, Predicted, sum};
pub use power_feedback::{FeedbackState, PowerFeedback};

/// When the controller runs.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum ControlSystems {
    /// Both of the following. Part of `PostUpdate`, after transform propagation. Settings are applied
    /// before cameras are updated, which Bevy does earlier in the schedule: a selection takes
    /// effect in the next frame.
    Select,
    /// First: the frame rate, the device's signals, and metered against predicted power
    /// ([`PowerFeedback`]).
    Observe,
    /// Then, for every camera: finds its frontier and how well it fits
    /// ([`MapFit`]), selects a point of it at one exchange rate, moves
    /// the settings, writes [`Selection`] and [`KnobSettings`](crate::knobs::KnobSettings), and triggers
    /// [`SettingsSwitched`], [`BudgetStateChanged`] and [`MapRejected`].
    Control,
}

/// Adds the controller. Needs [`FrontierMapPlugin`](crate::frontier::FrontierMapPlugin) and Bevy's
/// `TimePlugin`; without the former it stays off and logs a warning.
#[derive(Clone, Copy, Debug, Default)]
pub struct ControlPlugin;

impl Plugin for ControlPlugin {
    fn build(&self, app: &mut App) {
        crate::cut::build(app);
        app.init_resource::<ControlSettings>()
            .init_resource::<AppBudget>()
            .init_resource::<PowerFeedback>()
            .init_resource::<BatteryLevel>()
            .init_resource::<BatterySettings>()
            .init_resource::<FrameTime>()
            .init_resource::<ThermalHeadroom>()
            .init_resource::<SignalModel>()
            .init_resource::<FrameRate>()
            .init_resource::<FeedbackModel>()
            .init_resource::<maps::PreparedMaps>()
            .add_observer(camera::forget_camera::<PowerController>)
            .add_observer(camera::forget_camera::<FrontierSource>)
            .configure_sets(
                PostUpdate,
                (ControlSystems::Observe, ControlSystems::Control)
                    .chain()
                    .in_set(ControlSystems::Select)
                    // Need this frame's map changes, so that no map is read with the knobs of its
                    // predecessor.
                    .after(AssetEventSystems)
                    // Need this frame's camera transforms.
                    .after(TransformSystems::Propagate)
                    .run_if(resource_exists::<Assets<FrontierMap>>),
            )
            .add_systems(
                PostUpdate,
                (
                    (
                        read_battery.run_if(needs_battery),
                        observe_app,
                        // With or without cameras, so that no change is missed.
                        maps::forget_changed_maps.run_if(
                            on_message::<AssetEvent<FrontierMap>>
                                .or_eager(resource_exists_and_changed::<KnobRegistry>),
                        ),
                    )
                        .chain()
                        .in_set(ControlSystems::Observe),
                    camera::control_cameras
                        .run_if(any_with_component::<CameraState>)
                        .in_set(ControlSystems::Control),
                ),
            );
    }

    fn finish(&self, app: &mut App) {
        if !app.world().contains_resource::<Assets<FrontierMap>>() {
            warn!(
                "ControlPlugin stays off: this app has no frontier map assets, add FrontierMapPlugin"
            );
        }
    }
}

/// Whether a camera's budget asks for the battery.
fn needs_battery(budgets: Query<&Budget>) -> bool {
    budgets.iter().any(|budget| budget.battery_until.is_some())
}

/// Observes the frame rate, compares predicted with metered power, and learns from signals.
fn observe_app(
    time: Res<Time<Real>>,
    mut rate: ResMut<FrameRate>,
    wait: Option<Res<FrameWait>>,
    metered: Option<Res<MeteredPower>>,
    (frame_time, battery, headroom): (Res<FrameTime>, Res<BatteryLevel>, Res<ThermalHeadroom>),
    cameras: Query<(&CameraState, &MapFit)>,
    mut model: ResMut<FeedbackModel>,
    settings: Res<ControlSettings>,
    mut feedback: ResMut<PowerFeedback>,
    mut signals: ResMut<SignalModel>,
) {
    let delta_seconds = time.delta_secs_f64();
    let active = cameras.iter().filter(|(state, _)| state.is_active);
    let active = active.map(|(state, fit)| Predicted {
        power: state.predicted,
        meter: fit.meter,
        rated_at: state.rated_at,
    });
    let predicted = sum(active.clone());
    rate.observe(delta_seconds, predicted);
    let new = model.observe(
        active,
        predicted,
        delta_seconds,
        metered.as_deref(),
        &mut rate,
        settings.power_feedback,
        &feedback,
    );
    feedback.set_if_neq(new);
    // What a limiter of the frame rate waits is no work.
    let waited = wait.map_or(0.0, |wait| wait.0.as_secs_f64());
    let work = Some(delta_seconds - waited).filter(|_| rate.kind() != FrameKind::Pause);
    let (energy, power) = battery.valid();
    signals.step(&FrameSignals {
        predicted,
        is_playing: rate.kind() == FrameKind::Usual,
        delta_seconds,
        now_seconds: time.elapsed_secs_f64(),
        frame_seconds: frame_time.valid().or(work),
        battery: energy,
        battery_power: power,
        is_battery_new: battery.is_changed(),
        headroom: headroom.valid(),
    });
}
