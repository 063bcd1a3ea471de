//! The `frugal` tool as a library: scenes, the stage that renders them, plays under a budget, and the
//! analysis of maps. The search is the crate `frugal_search`.
//!
//! [`cli::run`] is the tool. The examples and the integration tests share the other public modules
//! with it: scene files and the headless renderer. Path tracer and image metrics are the crate
//! `frugal_trace`.

pub mod cli;
mod control_log;
mod device;
mod evaluate;
mod inspect;
mod report;
pub mod scene;
pub mod stage;
mod subject;
mod work_meter;
