//! Divides camera space where frontiers differ (Wang et al. 2016, sections 3.5.2 and 3.5.3).
//!
//! Breadth first: the corners of the root are searched, then every node with a pair of adjacent corners that differ in some view is divided, its new
//! corners searched for the views whose parents differ, and so on down to the level limit. Whatever stops it, the map is whole.
mod builder;
mod config;
mod distance;
mod dividing;
mod lattice;
mod schedule;
mod searching;
#[cfg(test)]
mod tests;

pub use builder::{Subdivision, subdivide};
pub use config::{CameraSpace, Statistics, SubdivideConfig, SubdivideError, Threshold};
pub use distance::{Distance, half_distance};
