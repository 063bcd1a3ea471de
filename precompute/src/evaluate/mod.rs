//! Plays a camera path under a budget beside baselines, and compares power and error of the runs.
//!
//! Independent of the renderer: a [`FrameRenderer`](crate::stage::FrameRenderer) renders and meters, a [`Policy`] decides the
//! settings of each frame.
//!
//! | part | job |
//! |---|---|
//! | `budget` | `7W`, `60%`, `0.02`: reading budgets, resolving percentages |
//! | `play` | one run along a path: frame renderer, policy, per-frame records |
//! | `path_costs` | power and error of many settings at every frame of a path; policies are simulated from it without rendering |
//! | `render_path` | makes such a record, with several renderers side by side |
//! | `baselines`, `judge` | the baselines, and the comparison with them under one budget |
//! | `check` | real plays beside the record: errors of simulation, drift, images |
//! | `controlled` | the plugin's controller as a policy |
//! | `bootstrap` | statistical significance of differences |
//! | `for_benches` | a record read back, for benchmarks |
//! | `result` | results, as JSON |
//! | `table` | results as text, and per-frame CSV |
pub(crate) mod baselines;
mod bootstrap;
mod budget;
mod check;
mod controlled;
#[cfg(test)]
pub(crate) mod fake;
mod for_benches;
mod judge;
mod path_costs;
mod play;
mod render_path;
mod result;
mod table;

pub(crate) use budget::{BudgetRequest, PowerBudget, ResolvedBudget, parse_error_budget};
pub(crate) use check::{FramePicture, pictures, play_for_real};
pub(crate) use controlled::Controller;
pub use for_benches::{ReactiveLadder, RecordedPath};
pub(crate) use judge::{Baselines, Trial, settings_to_record};
pub(crate) use path_costs::{PathRecord, RecordError};
pub(crate) use play::{
    Choice, EvaluationError, Fixed, FrameRecord, PathPlan, Policy, Pose, Progress,
};
pub(crate) use result::{Drift, EvaluationResult, RunResult};
pub(crate) use table::{TABLE_HEADERS, frames_csv, table, table_row};
