//! Plays a camera path under a budget beside fixed presets, and says what each cost and looked like.
//!
//! Knows no renderer: a [`Player`] renders and meters, a [`Policy`] decides the settings of each frame.
//!
//! | part | job |
//! |---|---|
//! | `budget` | `7W`, `60%`, `0.02`: reading budgets, resolving percentages |
//! | `play` | one run along a path: player, policy, per-frame records |
//! | `runner` | which runs, in which order, against which references |
//! | `resolution` | the rival that scales resolution alone |
//! | `result` | what came out, as JSON |
//! | `table` | the same for people, and per-frame CSV |
mod budget;
#[cfg(test)]
pub(crate) mod fake;
mod play;
mod resolution;
mod result;
mod runner;
mod table;

pub use budget::{BudgetError, BudgetRequest, PowerBudget, ResolvedBudget, parse_error_budget};
pub use play::{Choice, Controlled, Fixed, FrameRecord, PathError, PathPlan, Player, Policy, Pose, Progress, Shot};
pub use resolution::RESOLUTION_KNOB;
pub use result::{Drift, EvaluationResult, RunResult};
pub use runner::{Evaluation, EvaluationError, EvaluationPlan, FramePicture, evaluate};
pub use table::{frames_csv, table};
