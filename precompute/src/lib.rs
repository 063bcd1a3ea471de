//! The `frugal` tool as a library: scene → cameras → stage → table → pool → fit → map, and the
//! analysis of maps.
//!
//! [`cli::run`] is the tool. The other public modules are those that the examples and the
//! integration tests share with it: scene files and the headless renderer. Path tracer and image
//! metrics are the crate `frugal_trace`.

mod cameras;
pub mod cli;
mod control_log;
mod cost;
mod default_settings;
mod device;
mod evaluate;
mod farthest;
mod files;
mod fit;
mod inspect;
mod journal;
mod linalg;
mod medoids;
mod meters;
mod pipeline;
mod pool;
mod quantile;
mod report;
pub mod scene;
mod search;
pub mod stage;
mod table;
mod view_features;

// For the benchmarks. Not part of the interface.
#[doc(hidden)]
pub use evaluate::{ReactiveLadder, RecordedPath};
