//! From a table of cameras and settings to a map: frontiers by address of the octree, split only
//! where that pays.
//!
//! What settings cost at an address is a mean over the training cameras, by how near they are to
//! the address's own. A node of the octree is divided where settings picked by the finer estimates
//! cost less at cameras that took no part in them. Where nothing pays, all addresses share one
//! frontier, so no map is worse than its own best constant. Departs from Wang et al. 2016, section
//! 3.5.3, who divide where frontiers differ, which noise does as well. Knows no renderer.
mod calibrate;
mod estimate;
mod octree;
mod smooth;
#[cfg(test)]
mod tests;
mod validate;

pub use calibrate::{Calibration, calibrate};
pub use estimate::{Estimate, Keys, Training};
pub use octree::{FitConfig, FitReport, Fitted, fit};
pub use smooth::{Place, Smoother};
pub use validate::Losses;
