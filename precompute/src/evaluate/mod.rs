//! Plays a camera path under a budget beside fixed presets, and says what each cost and looked
//! like.
//!
//! Knows no renderer: a [`Player`] renders and meters, a [`Policy`] decides the settings of each
//! frame.
//!
//! | part | job |
//! |---|---|
//! | `budget` | `7W`, `60%`, `0.02`: reading budgets, resolving percentages |
//! | `play` | one run along a path: player, policy, per-frame records |
//! | `runner` | real runs under one budget: which, in which order, against which references |
//! | `record` | a path played once with each of many settings: policies are played from it without rendering |
//! | `baselines`, `judge` | what ours is compared with, and the comparison |
//! | `controlled` | the controller that an app has |
//! | `bootstrap` | whether a difference is more than luck |
//! | `resolution` | the baseline that scales resolution alone |
//! | `result` | what came out, as JSON |
//! | `table` | the same for people, and per-frame CSV |
pub mod baselines;
mod bootstrap;
mod budget;
mod controlled;
#[cfg(test)]
pub(crate) mod fake;
mod judge;
mod play;
mod record;
mod resolution;
mod result;
mod runner;
mod table;

pub use bootstrap::dominates;
pub use budget::{BudgetError, BudgetRequest, PowerBudget, ResolvedBudget, parse_error_budget};
pub use controlled::Controller;
pub use judge::{Judged, judge, settings_to_record};
pub use play::{
    Choice, Controlled, Fixed, FrameRecord, PathError, PathPlan, Player, Policy, Pose, Progress,
    Shot,
};
pub use record::{PathRecord, RecordError};
pub use resolution::RESOLUTION_KNOB;
pub use result::{Drift, EvaluationResult, RunResult, SpotCheck};
pub use runner::{Evaluation, EvaluationError, EvaluationPlan, FramePicture, evaluate};
pub use table::{frames_csv, judged_table, table};
