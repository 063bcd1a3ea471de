//! Plays a camera path under a budget beside baselines, and compares power and error of the runs.
//!
//! Independent of the renderer: a [`FrameRenderer`](crate::stage::FrameRenderer) renders and meters, a [`Policy`] decides the
//! settings of each frame.
//!
//! | part | job |
//! |---|---|
//! | `budget` | `7W`, `60%`, `0.02`: reading budgets, resolving percentages |
//! | `play` | one run along a path: frame renderer, policy, per-frame records |
//! | `runner` | rendered runs under one budget: selection, order, reference images |
//! | `record` | power and error of many settings at every frame of a path; policies are simulated from it without rendering |
//! | `recording` | makes a record, with several renderers side by side |
//! | `baselines`, `judge` | the baselines, and the comparison with them |
//! | `controlled` | the plugin's controller as a policy |
//! | `bootstrap` | statistical significance of differences |
//! | `recorded` | a record read back, for benchmarks |
//! | `resolution` | the baseline that scales resolution alone |
//! | `result` | results, as JSON |
//! | `table` | results as text, and per-frame CSV |
pub(crate) mod baselines;
mod bootstrap;
mod budget;
mod controlled;
#[cfg(test)]
pub(crate) mod fake;
mod judge;
mod play;
mod record;
mod recorded;
mod recording;
mod resolution;
mod result;
mod runner;
mod table;

pub(crate) use budget::{BudgetRequest, PowerBudget, ResolvedBudget, parse_error_budget};
pub(crate) use controlled::Controller;
pub(crate) use judge::{Judged, judge, settings_to_record};
pub(crate) use play::{Choice, Controlled, Fixed, FrameRecord, PathPlan, Policy, Pose, Progress};
pub(crate) use record::{PathRecord, RecordError};
pub use recorded::{ReactiveLadder, RecordedPath};
pub(crate) use resolution::RESOLUTION_KNOB;
pub(crate) use result::{Drift, EvaluationResult, RunResult, SpotCheck};
pub(crate) use runner::{Evaluation, EvaluationError, EvaluationPlan, evaluate};
pub(crate) use table::{frames_csv, judged_table, table};
