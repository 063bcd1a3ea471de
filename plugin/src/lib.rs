//! Power-aware real-time global illumination for Bevy.
//!
//! Dynamic indirect light on any GPU, without ray-tracing hardware, and a controller that keeps
//! each frame within a power budget:
//!
//! ```no_run
//! use bevy::prelude::*;
//! use bevy_frugal_gi::prelude::*;
//!
//! App::new()
//!     .add_plugins((DefaultPlugins, FrugalGiPlugins))
//!     .add_systems(Startup, |mut commands: Commands, assets: Res<AssetServer>| {
//!         commands.spawn((
//!             Camera3d::default(),
//!             FrugalGi::default(),                                       // global illumination
//!             PowerController(assets.load("maps/courtyard.pareto.ron")), // and the controller
//!             Budget::power(Watts(7.0)),
//!         ));
//!     })
//!     .run();
//! ```
//!
//! Without a map, [`FrugalGi`](gi::FrugalGi) renders global illumination with fixed settings. The
//! `frugal` tool makes the map: `frugal precompute courtyard.scene.ron`.
//!
//! Data flows in one direction: `frontier` (predicted power and error) → `control` (selected
//! settings) → `knobs` (applied levels) → `gi`, `resolution` and Bevy's renderer.

mod atmosphere;
pub mod camera_copy;
pub mod control;
mod cut;
pub mod error_meter;
pub mod frontier;
// Without `inspect`, what only it shows is unused.
#[cfg_attr(not(feature = "inspect"), allow(dead_code, unreachable_pub, unused_imports))]
pub mod gi;
pub mod knobs;
pub mod pacing;
pub mod power;
pub mod resolution;
mod schedule;
pub mod signals;
#[cfg(feature = "stage")]
pub mod stage;
/// Without the feature `stage` the tool cannot render an app.
#[cfg(not(feature = "stage"))]
pub mod stage {
    use bevy::app::{PluginGroup, PluginGroupBuilder};

    /// Returns an app's plugins unchanged.
    pub fn on_stage(plugins: impl PluginGroup) -> PluginGroupBuilder {
        plugins.build()
    }
}

use bevy::app::{PluginGroup, PluginGroupBuilder};
pub use frugal_core::units;

/// All plugins of this crate. Each can be disabled or replaced.
///
/// | plugin | job |
/// |---|---|
/// | [`GiPlugin`](gi::GiPlugin) | global illumination on cameras with [`FrugalGi`](gi::FrugalGi); makes deferred rendering the default |
/// | [`ResolutionPlugin`](resolution::ResolutionPlugin) | per-camera resolution scale, with a filtered upscale |
/// | [`FramePacingPlugin`](pacing::FramePacingPlugin) | a limit of the frame rate, for the knob `frame_rate` |
/// | [`KnobPlugin`](knobs::KnobPlugin) | the registry of knobs; applies [`KnobSettings`](knobs::KnobSettings) |
/// | [`FrontierMapPlugin`](frontier::FrontierMapPlugin) | the `*.pareto.ron` asset |
/// | [`ControlPlugin`](control::ControlPlugin) | selects settings from a camera's map under its [`Budget`](control::Budget) |
/// | [`ErrorMeterPlugin`](error_meter::ErrorMeterPlugin) | measures errors on cameras with [`ErrorMeter`](error_meter::ErrorMeter) |
/// | [`PowerPlugin`](power::PowerPlugin) | meters power in the background |
///
/// The crate `bevy_frugal_gi_tools` has more for development: a HUD, a log of the controller, and a
/// camera recorder.
#[derive(Clone, Copy, Debug, Default)]
pub struct FrugalGiPlugins;

impl PluginGroup for FrugalGiPlugins {
    fn build(self) -> PluginGroupBuilder {
        PluginGroupBuilder::start::<Self>()
            .add(gi::GiPlugin::default())
            .add(resolution::ResolutionPlugin)
            .add(pacing::FramePacingPlugin)
            .add(knobs::KnobPlugin)
            .add(frontier::FrontierMapPlugin)
            .add(control::ControlPlugin)
            .add(error_meter::ErrorMeterPlugin)
            .add(power::PowerPlugin::default())
    }
}

/// What most apps name. Everything else is in the module of its kind.
pub mod prelude {
    pub use crate::FrugalGiPlugins;
    pub use crate::control::{
        AppBudget, Budget, BudgetStateChanged, ControlStatus, FrontierSource, KnobBounds,
        MapRejected, Outcome, PowerController, Selection, SettingsSwitched,
    };
    pub use crate::error_meter::ErrorMeter;
    pub use crate::frontier::FrontierMap;
    pub use crate::gi::{CameraCut, FrugalGi, GiPlugin, GiSupport};
    pub use crate::knobs::{KnobSettings, RegisterKnob, WarmKnobs};
    pub use crate::pacing::FrameRateLimit;
    pub use crate::power::MeteredPower;
    pub use crate::resolution::ResolutionScale;
    pub use crate::units::Watts;
}
