//! The controller without an app: budgets, selection from a frontier, the transition to the
//! selected settings, and what a meter and other signals teach.
//!
//! `budget` → `limits` (all currencies as watts) → `select` and `pace` (a point of the frontier) →
//! `divide` and `agree` (several cameras) → `dwell` and `filter` (the way there). `correction`,
//! `frame_rate`, `exchange` and `observed` learn what predicted watts are in measured ones, in
//! seconds and in the battery's energy. [`CameraController`] is all of it for one camera.

mod agree;
mod bounds;
mod budget;
mod controller;
mod correction;
mod divide;
mod dwell;
mod error_feedback;
mod exchange;
mod filter;
mod frame_rate;
mod history;
mod limits;
mod observed;
mod pace;
mod select;
mod settings;

pub use agree::*;
pub use bounds::{BoundedFrontier, KnobBounds};
pub use budget::{Budget, BudgetError, Limit};
pub use controller::{CameraController, Decisions, Inputs, Switch};
pub use correction::{PowerCorrection, PowerModel};
pub use divide::PowerDivision;
pub use error_feedback::ErrorFeedback;
pub use filter::SettingsFilter;
pub use frame_rate::{FrameKind, FrameRate, RatedAt};
pub use limits::{Limits, resolve};
pub use observed::{FrameSignals, Observed, SignalModel};
pub use pace::{ErrorPace, choose};
pub use select::{Choice, ErrorPrice, MAX_OVER_MEAN, Outcome, select};
pub use settings::{ControlSettings, TransitionTimes};
