//! What budgets in other currencies than watts are kept by: frame time, battery and heat.
//!
//! | resource | written by | holds |
//! |---|---|---|
//! | [`FrameTime`] | the app, if it knows better than its frame rate | the time of a frame's work |
//! | [`BatteryLevel`] | this module on Linux, or the app | the energy that is left, and the power drawn |
//! | [`ThermalHeadroom`] | the app | how far the device is from throttling |
//!
//! A number that is none (NaN, or out of its range) counts as unknown.

mod battery;
mod frame_time;
mod headroom;

pub use battery::BatteryLevel;
pub use frame_time::FrameTime;
pub use headroom::ThermalHeadroom;

pub(crate) use battery::read_battery;
