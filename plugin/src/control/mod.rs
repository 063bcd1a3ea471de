//! The controller: selects every camera's knob settings from its frontiers under its budget, and
//! moves there smoothly.
//!
//! | component of a camera | written by | holds |
//! |---|---|---|
//! | [`FrontierMapHandle`] or [`FrontierSource`] | the app | the source of its frontiers |
//! | [`Budget`] | the app | its power and error limits |
//! | [`KnobBounds`] | the app, and whoever writes to `KnobSettings` | levels that the controller may set |
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
mod app_budget;
mod bounds;
mod budget;
mod camera;
mod components;
mod controller;
mod correction;
mod divide;
mod dwell;
mod error_feedback;
mod events;
mod exchange;
mod filter;
mod frame;
mod frame_rate;
mod history;
mod limits;
mod maps;
mod observed;
mod pace;
mod plugin;
mod power_feedback;
mod select;
mod state;
mod write;

pub use app_budget::{AppBudget, CameraPriority};
pub use bounds::KnobBounds;
pub use budget::{Budget, BudgetError, Limit};
pub use components::{
    ControlSettings, ControlStatus, FrontierMapHandle, FrontierSource, OffReason, Selection,
};
pub use controller::{CameraController, Decisions, Inputs};
pub use correction::{PowerCorrection, PowerModel};
pub use divide::PowerDivision;
pub use error_feedback::ErrorFeedback;
pub use events::{BudgetStateChanged, MapRejected, SettingsSwitched};
pub use filter::{SettingsFilter, TransitionTimes};
pub use maps::frontier_in_play;
pub use pace::ErrorPace;
pub use plugin::{ControlPlugin, ControlSystems};
pub use power_feedback::{FeedbackState, PowerFeedback};
pub use select::{Choice, ErrorPrice, MOST_OVER_MEAN, Outcome, select};
