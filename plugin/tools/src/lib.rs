//! Development tools for [`bevy_frugal_gi`], to be left out of builds that ship.
//!
//! | plugin | job |
//! |---|---|
//! | [`HudPlugin`] | shows what the controller does, over the image |
//! | [`ControlLogPlugin`] | writes what the controller does to a file |
//! | [`CameraRecorderPlugin`] | records camera paths for `frugal precompute --cameras` |
//!
//! None is part of [`FrugalGiPlugins`](bevy_frugal_gi::FrugalGiPlugins). They only read the app,
//! except for [`HudWipe`], which sets app-wide knobs to their best.

pub mod control_log;
pub mod hud;
pub mod recording;
pub mod row_log;
#[cfg(test)]
mod testing;

pub use control_log::ControlLogPlugin;
pub use hud::{HudPart, HudPlugin, HudSettings, HudWipe};
pub use recording::{CameraRecorder, CameraRecorderPlugin, RecordCamera};
