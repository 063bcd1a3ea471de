//! What fills a table.

use bevy_frugal_gi::frontier::CostPoint;
use bevy_frugal_gi::knobs::RenderSettings;

use crate::scene::CameraPose;

/// Gives the cost of settings at a camera: a renderer, or a formula in tests.
pub trait Measure {
    /// Why there is no cost.
    type Error;

    /// Power and error of `settings` over a clip, the poses of consecutive frames: of its last
    /// frame, as it is played.
    ///
    /// # Errors
    /// When the rendering or the metering fails.
    fn measure(
        &mut self,
        clip: &[CameraPose],
        settings: RenderSettings,
    ) -> Result<CostPoint, Self::Error>;
}
