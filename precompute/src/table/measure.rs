//! The interface for filling a table.

use bevy_frugal_gi::frontier::CostPoint;
use bevy_frugal_gi::knobs::KnobLevels;

use crate::scene::CameraPose;

/// Measures the cost of settings at a camera: by a renderer, or by a formula in tests.
pub trait Measure {
    /// Why a measurement failed.
    type Error;

    /// Power and error of `settings` in the last frame of a clip, the poses of consecutive frames.
    ///
    /// # Errors
    /// When the rendering or the metering fails.
    fn measure(
        &mut self,
        clip: &[CameraPose],
        settings: KnobLevels,
    ) -> Result<CostPoint, Self::Error>;
}
