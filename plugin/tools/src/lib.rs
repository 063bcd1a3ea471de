//! Development tools for [`bevy_frugal_gi`]: what an app adds while it is made, and a shipping build
//! leaves out as a whole.
//!
//! | plugin | job |
//! |---|---|
//! | [`HudPlugin`] | shows what the controller does, over the image |
//! | [`ControlLogPlugin`] | writes what the controller does to a file |
//! | [`CameraRecorderPlugin`] | records camera paths for `frugal precompute --cameras` |
//!
//! They read an app and change nothing of it. None is part of
//! [`FrugalGiPlugins`](bevy_frugal_gi::FrugalGiPlugins).

pub mod control_log;
pub mod hud;
pub mod recording;
pub mod row_log;
#[cfg(test)]
mod testing;

pub use control_log::ControlLogPlugin;
pub use hud::{HudPart, HudPlugin, HudSettings, HudWipe};
pub use recording::{CameraRecorder, CameraRecorderPlugin, RecordCamera};
