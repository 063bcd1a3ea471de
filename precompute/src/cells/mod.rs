//! What frontiers cost where they are used.
//!
//! A frontier is found at an octree corner, along an axis; an app's camera stands somewhere in a leaf and looks anywhere. Corners are in and near
//! walls more often than cameras are, so that what a corner promises is off by much and in one direction. Wang et al. 2016 (section 3.5.3) divide
//! until neighbouring corners agree, which takes as many searches as there are corners. Here a frontier's *settings* stay what the search found, and
//! only their *costs* are measured once more, at a few random cameras that the run time will give this very frontier: its cell. That takes about
//! ten measurements a frontier, where a search takes a hundred.
//!
//! Cameras are drawn (`cameras`), a few points spread along each frontier are measured there (`measure`, `anchors`), what was
//! measured is averaged (`pooling`) and carried over to all points (`adjust`). `promise` holds the outcome against further cameras.
//!
//! Costs become *means* over the cell, in error as in power. A budget limits the mean of a run, and means over cells add up to the mean of a run;
//! quantiles do not. What error budgets get at still other cameras becomes the map's [`Correction`](bevy_frugal_gi::frontier::Correction).
mod adjust;
mod anchors;
mod cameras;
mod measure;
mod pooling;
mod promise;
#[cfg(test)]
mod tests;

pub use cameras::{Cell, RandomCameras, find_cells};
pub use measure::{Measure, RemeasureConfig, Remeasured, remeasure};
pub use promise::{Promise, Spread, correction, hold_to_promise};
