//! The `frugal` tool as a library: scene → stage → measure → search → frontier map, and what reads one back.
pub mod cells;
pub mod cli;
pub mod evaluate;
pub mod files;
pub mod metrics;
pub mod reference;
pub mod report;
pub mod scene;
pub mod search;
pub mod stage;
pub mod subdivide;
