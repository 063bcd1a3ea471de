//! The controller: selects every camera's knob settings from its frontiers under its budget, and
//! moves there smoothly.
//!
//! | component of a camera | written by | holds |
//! |---|---|---|
//! | [`PowerController`] or [`FrontierSource`] | the app | the source of its frontiers |
//! | [`Budget`] | the app | its limits: power, error, energy, time, battery, heat |
//! | [`KnobBounds`] | the app, and whoever writes to `KnobSettings` | levels that the controller may set |
//! | [`Selection`] | the controller | the selected settings, their predicted cost, and whether the budget is met |
//! | [`MapFit`](crate::frontier::MapFit) | the controller | how well the map fits this app |
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
mod plugin;
mod power_feedback;
mod write;

pub use frugal_core::control::{
    Budget, BudgetError, CameraController, Choice, ControlSettings, Decisions, ErrorFeedback,
    Inputs, KnobBounds, Limit, Outcome, PowerCorrection, PowerModel, RateTracker, SettingsFilter,
    TransitionTimes, select,
};

pub use components::{
    AppBudget, CameraPriority, ControlStatus, FrontierSource, OffReason, PowerController, Selection,
};
pub use events::{BudgetStateChanged, MapRejected, SettingsSwitched};
pub use maps::frontier_in_play;
pub use plugin::{ControlPlugin, ControlSystems};
pub use power_feedback::{FeedbackState, PowerFeedback};
