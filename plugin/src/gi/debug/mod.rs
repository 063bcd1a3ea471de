//! Counters and GPU state of global illumination, for apps, tests and debuggers.

mod diagnostics;
#[cfg(feature = "inspect")]
pub mod inspect;

use bevy::app::{App, Plugin};

pub use diagnostics::{GI_DIAGNOSTICS, GiCounts};

pub(super) struct DebugPlugin;

impl Plugin for DebugPlugin {
    fn build(&self, app: &mut App) {
        app.register_type::<GiCounts>();
    }

    fn finish(&self, app: &mut App) {
        diagnostics::finish(app);
    }
}
