//! Where cameras are: what a map is trained on, and what its error budgets are calibrated on.
//!
//! Cameras come from the scene's paths and recordings, from their surroundings, and from the free
//! space that they reach. None stands in a solid, outside what can be reached, or a hand's breadth
//! from a wall. Knows no renderer.
mod free_space;
mod pose;
mod recorded;
mod set;

pub use free_space::{Clearance, FreeSpace};
pub use pose::MovingCamera;
pub use recorded::{RecordedError, recorded};
pub use set::{CameraMix, CameraSet, TrackSample, tracks_of};
