//! From a table of cameras and settings to a map: frontiers by address of an octree, divided only
//! where that lowers the cost.
//!
//! The cost at an address is a mean over the training cameras, weighted by their distance to the
//! address's own. For views between cameras, a regression predicts costs from what they show. A
//! node of the octree is divided where the finer estimates differ (Wang et al. 2016, section
//! 3.5.3). Where the division saves nothing at held-out cameras, all addresses share one frontier,
//! so that no map is worse than its own best constant. Independent of the renderer.
mod calibrate;
mod cluster;
mod completion;
mod estimate;
mod held_out;
mod octree;
mod regression;
mod smooth;
#[cfg(test)]
mod tests;
mod training;

pub(crate) use calibrate::{Calibration, calibrate};
pub(crate) use completion::Completion;
pub(crate) use octree::{FitConfig, Fitted, fit};
pub(crate) use regression::DescribedView;
pub(crate) use smooth::Smoother;
pub(crate) use training::Training;
