//! The controller: selects every camera's knob settings from its frontiers under its budget, and
//! moves there smoothly.
//!
//! | component of a camera | written by | holds |
//! |---|---|---|
//! | [`FrontierMapHandle`] or [`FrontierSource`] | the app | the source of its frontiers |
//! | [`Budget`] | the app | its power and error limits |
//! | [`Selection`] | the controller | the selected settings, their predicted cost, and whether the budget is met |
//! | [`MapFit`](crate::frontier::MapFit) | the controller | how well the map fits this app |
//! | [`ErrorFeedback`] | the [error meter](crate::error_meter), or the app | how measured errors compare with predicted ones |
//! | [`ErrorPace`] | the controller | correction of the error rate for views unlike the calibration views |
//! | [`SettingsFilter`] | the controller | the transition from old settings to new ones; the app may call [`cut`](SettingsFilter::cut) on it |
//! | [`KnobSettings`](crate::knobs::KnobSettings) | the controller | the settings to apply |
//!
//! [`PowerFeedback`] says how the app's meter corrects predicted watts. [`CameraController`] is the
//! same controller without an app: plain data in, [`Decisions`] out.
mod agree;
mod budget;
mod clock;
mod controller;
mod divide;
mod dividing;
mod dwell;
mod error_feedback;
mod events;
mod exchange;
mod feedback;
mod filter;
mod history;
mod limits;
mod maps;
mod observed;
mod pace;
mod select;
mod selection;
mod systems;
pub use budget::{Budget, BudgetError};
pub use clock::{FeedbackState, PowerFeedback};
pub use controller::{Allocation, CameraController, Decisions, Inputs, allocate, switch};
pub use divide::{AppBudget, CameraPriority, PowerDivision};
pub use error_feedback::ErrorFeedback;
pub use events::{BudgetStateChanged, MapRejected, SettingsSwitched};
pub use feedback::{PowerCorrection, PowerModel};
pub use filter::{SettingsFilter, TransitionTimes};
pub use limits::Limit;
pub(crate) use maps::frontier_in_play;
pub use pace::{ErrorPace, choose};
pub use select::{Choice, ErrorPrice, MOST_OVER_MEAN, Outcome, select};
pub use selection::{
    ControlSettings, ControlStatus, FrontierMapHandle, FrontierSource, OffReason, Selection,
};

use bevy::app::{App, Plugin, PostUpdate};
use bevy::asset::{AssetEvent, AssetEventSystems, Assets};
use bevy::ecs::schedule::common_conditions::{
    any_with_component, on_message, resource_exists, resource_exists_and_changed,
};
use bevy::ecs::schedule::{IntoScheduleConfigs, SystemCondition, SystemSet};
use bevy::log::warn;
use bevy::transform::TransformSystems;

use crate::frontier::FrontierMap;
use crate::knobs::KnownKnobs;
use crate::signals::{BatteryLevel, FrameTime, ThermalHeadroom, read_battery};

/// When the controller runs.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum ControlSystems {
    /// All of the following. Part of `PostUpdate`, after transform propagation. Settings are applied
    /// before cameras are updated, which Bevy does earlier in the schedule: a selection takes
    /// effect in the next frame.
    Select,
    /// First: the frame rate, the device's signals, and metered against predicted power ([`PowerFeedback`]).
    Observe,
    /// Then: every camera's frontiers, and how well they fit
    /// ([`MapFit`](crate::frontier::MapFit)).
    LookUp,
    /// Then: a point of every frontier, within the [`AppBudget`] where there is one.
    Allocate,
    /// Then: the settings on the way to it.
    Switch,
    /// Last: writes [`Selection`] and [`KnobSettings`](crate::knobs::KnobSettings), and sends
    /// [`SettingsSwitched`], [`BudgetStateChanged`] and [`MapRejected`].
    Write,
}

/// Adds the controller. Needs [`FrontierMapPlugin`](crate::frontier::FrontierMapPlugin) and Bevy's
/// `TimePlugin`; without the former it stays off and logs a warning.
#[derive(Clone, Copy, Debug, Default)]
pub struct ControlPlugin;

impl Plugin for ControlPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<ControlSettings>()
            .init_resource::<AppBudget>()
            .init_resource::<PowerFeedback>()
            .init_resource::<BatteryLevel>()
            .init_resource::<FrameTime>()
            .init_resource::<ThermalHeadroom>()
            .init_resource::<observed::SignalModel>()
            .init_resource::<clock::ControlClock>()
            .init_resource::<clock::FeedbackModel>()
            .init_resource::<maps::PreparedMaps>()
            .add_message::<SettingsSwitched>()
            .add_message::<BudgetStateChanged>()
            .add_message::<MapRejected>()
            .register_type::<AppBudget>()
            .register_type::<Budget>()
            .register_type::<CameraPriority>()
            .register_type::<ControlSettings>()
            .register_type::<ControlStatus>()
            .register_type::<BatteryLevel>()
            .register_type::<ErrorFeedback>()
            .register_type::<ErrorPace>()
            .register_type::<FrameTime>()
            .register_type::<Limit>()
            .register_type::<ThermalHeadroom>()
            .register_type::<FrontierMapHandle>()
            .register_type::<KnownKnobs>()
            .register_type::<OffReason>()
            .register_type::<Outcome>()
            .register_type::<PowerFeedback>()
            .register_type::<Selection>()
            .register_type::<SettingsFilter>()
            .add_observer(systems::forget_camera::<FrontierMapHandle>)
            .add_observer(systems::forget_camera::<FrontierSource>)
            .configure_sets(
                PostUpdate,
                (
                    ControlSystems::Observe,
                    ControlSystems::LookUp,
                    ControlSystems::Allocate,
                    ControlSystems::Switch,
                    ControlSystems::Write,
                )
                    .chain()
                    .in_set(ControlSystems::Select)
                    // Need this frame's map changes, so that no map is read with the knobs of its
                    // predecessor.
                    .after(AssetEventSystems)
                    // Need this frame's camera transforms.
                    .after(TransformSystems::Propagate)
                    .run_if(resource_exists::<Assets<FrontierMap>>),
            )
            .configure_sets(
                PostUpdate,
                (
                    ControlSystems::LookUp,
                    ControlSystems::Allocate,
                    ControlSystems::Switch,
                    ControlSystems::Write,
                )
                    .run_if(any_with_component::<systems::CameraState>),
            )
            .add_systems(
                PostUpdate,
                (
                    (
                        read_battery.run_if(observed::needs_battery),
                        clock::observe,
                        observed::observe_signals,
                        // With or without cameras, so that no change is missed.
                        maps::forget_changed_maps.run_if(
                            on_message::<AssetEvent<FrontierMap>>
                                .or_eager(resource_exists_and_changed::<KnownKnobs>),
                        ),
                    )
                        .chain()
                        .in_set(ControlSystems::Observe),
                    systems::look_up.in_set(ControlSystems::LookUp),
                    (systems::allocate_budgets, dividing::divide_app_budget)
                        .chain()
                        .in_set(ControlSystems::Allocate),
                    systems::switch_settings.in_set(ControlSystems::Switch),
                    systems::write_decisions.in_set(ControlSystems::Write),
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
