//! Policies simulated along a recorded path and compared: neither a renderer nor a scene is needed.
//!
//! | part | job |
//! |---|---|
//! | `budget` | `7W`, `60%`, `0.02`: reading budgets, resolving percentages |
//! | `policy` | a path sampled at its frames, and what decides their settings |
//! | `record` | power and error of many settings at every frame of a path; policies are simulated from it |
//! | `data` | records as small files |
//! | `result` | results, as JSON |
//! | `bootstrap` | statistical significance of differences |
//! | `baselines` | constants, oracles, and the reactive ladder |
//! | `controlled` | the plugin's controller as a policy |
//! | `judge` | the comparison of all of them under one budget |

mod baselines;
mod bootstrap;
mod budget;
mod controlled;
mod data;
mod judge;
mod policy;
mod record;
mod result;

pub use baselines::{
    Mixed, Oracle, Reactive, best_constant, best_on, ladder, mixed_constants, oracle,
};
pub use budget::{BudgetRequest, PowerBudget, ResolvedBudget, parse_error_budget};
pub use controlled::{Controller, MeterInterval};
pub use data::{Made, RecordFile, read_records};
pub use judge::{Baselines, Trial, settings_to_record};
pub use policy::{Choice, Fixed, FrameRecord, PathPlan, Policy, Pose};
pub use record::PathRecord;
pub use result::{Drift, EvaluationResult, RunResult, SpotCheck};
