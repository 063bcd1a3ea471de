//! The controller without an app: budgets, selection from a frontier, the transition to the
//! selected settings, and what a meter and other signals teach.
//!
//! `budget` → `limits` (all as power and error) → `rate` (the exchange rate that spends them over
//! the horizon) → `choose` (the least power + rate × error on a frontier; [`select`] where every
//! frame keeps the limits) → [`agree`](crate::frontier::SharedLevels::agree) (levels that several
//! cameras share) → `filter` (the way there). `correction`, `frame_rate`, `observed` and
//! `error_feedback` learn how predicted watts and errors translate into measured ones, into seconds
//! and into battery energy. [`CameraController`] combines all for one camera.

mod bounds;
mod budget;
mod choose;
mod controller;
mod correction;
mod delay;
mod error_feedback;
mod filter;
mod frame_rate;
mod limits;
mod observed;
mod rate;

pub use bounds::{BoundedFrontier, KnobBounds};
pub use budget::{Budget, BudgetError, ControlSettings, Limit};
pub use choose::{Choice, Outcome, select};
pub use controller::{CameraController, Decisions, Inputs};
pub use correction::{PowerCorrection, PowerModel};
pub use error_feedback::{ErrorFeedback, MEASUREMENT_PERIOD, measurement_interval};
pub use filter::SettingsFilter;
pub use frame_rate::{FrameKind, FrameRate, RatedAt};
pub use limits::{Limits, resolve};
pub use observed::{FrameSignals, Observed, SignalModel};
pub use rate::{Curve, Rate, RateTracker};
