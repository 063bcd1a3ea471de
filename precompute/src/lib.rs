//! The `frugal` tool as a library: scene → cameras → stage → table → pool → fit → map, and the
//! analysis of maps.
pub mod cameras;
pub mod cli;
pub mod cost;
pub mod evaluate;
pub mod files;
pub mod fit;
pub mod inspect;
pub mod journal;
pub mod metrics;
pub mod pipeline;
pub mod pool;
pub mod reference;
pub mod report;
pub mod scene;
pub mod search;
pub mod search_bench;
pub mod stage;
pub mod table;
