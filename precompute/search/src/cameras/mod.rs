//! Cameras that a map is trained on, and cameras that its error budgets are calibrated on.
//!
//! Cameras come from the scene's paths and recordings, from their vicinity, and from the free space
//! that they reach. None is inside a solid, outside the reachable space, or within the clearance of
//! a wall. Independent of the renderer.
mod free_space;
mod pose;
mod set;
mod stretch;

pub(crate) use free_space::{Clearance, FreeSpace};
pub use pose::MovingCamera;
pub use set::{CameraMix, CameraSet, sampled};
pub use stretch::{TrackSample, stretches};
