//! Knobs, Pareto frontiers, frontier maps and the power controller, without a renderer.
//!
//! `frontier` (predicted power and error of settings) → `control` (settings selected under a budget,
//! and the way there) → levels of `knobs`. The plugin `bevy_frugal_gi` applies the levels; the tool
//! `frugal` writes the maps.

pub mod control;
pub mod frontier;
pub mod knobs;
pub mod power;
#[cfg(any(test, feature = "testing"))]
pub mod testing;
pub mod units;
