//! The interface for filling a table.

use std::ops::ControlFlow;

use frugal_core::frontier::CostPoint;
use frugal_core::knobs::KnobLevels;

use frugal_trace::scene::CameraPose;

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

    /// Measures all of `batches`, in order or side by side, and hands over each cost as it is known,
    /// until `done` breaks.
    ///
    /// # Errors
    /// When a rendering or its metering fails. What was handed over before counts.
    fn measure_all(
        &mut self,
        batches: &[Batch],
        done: &mut dyn FnMut(Measured) -> ControlFlow<()>,
    ) -> Result<(), Self::Error> {
        for (batch, Batch { clip, settings }) in batches.iter().enumerate() {
            for settings in settings.iter().copied() {
                let cost = self.measure(clip, settings)?;
                if done(Measured { batch, settings, cost }).is_break() {
                    return Ok(());
                }
            }
        }
        Ok(())
    }
}

/// Settings to measure at one camera.
#[derive(Clone, Debug, PartialEq)]
pub struct Batch {
    /// The poses of consecutive frames.
    pub clip: Vec<CameraPose>,
    /// The settings.
    pub settings: Vec<KnobLevels>,
}

/// A cost of [`Measure::measure_all`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// Number of the batch.
    pub batch: usize,
    /// The settings.
    pub settings: KnobLevels,
    /// Their power and error.
    pub cost: CostPoint,
}
