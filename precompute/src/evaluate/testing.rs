//! A frame renderer whose power and error are formulas, for tests.

use std::time::Duration;

use frugal_core::knobs::KnobLevels;
use frugal_core::units::Watts;
use frugal_search::evaluate::Pose;
use frugal_search::testing::formula::{grey, power};
use frugal_trace::metrics::Picture;

use crate::stage::{FrameRenderer, StageError};

/// Power by formula. Images are uniformly grey.
#[derive(Default)]
pub(crate) struct Fake {
    /// Number of runs so far.
    pub(crate) runs: usize,
    /// Additional watts of each run over the one before.
    pub(crate) drift: f64,
    /// How much brighter the images of each run are than those of the one before.
    pub(crate) brighter: u8,
    /// The frame, counted over all runs, that fails.
    pub(crate) broken_at: Option<usize>,
    /// Time that a frame takes.
    pub(crate) pause: Duration,
    /// Frames rendered over all runs.
    pub(crate) frames: usize,
}

impl FrameRenderer for Fake {
    fn begin_run(&mut self, _: &Pose, _: KnobLevels) -> Result<(), StageError> {
        self.runs += 1;
        Ok(())
    }

    fn render_frame(
        &mut self,
        pose: &Pose,
        settings: KnobLevels,
    ) -> Result<(Picture, Watts), StageError> {
        std::thread::sleep(self.pause);
        if self.broken_at == Some(self.frames) {
            return Err(StageError::failed("broken"));
        }
        let watts = power(settings)
            + 0.01 * f64::from(pose.position.x)
            + self.drift * (self.runs - 1) as f64;
        self.frames += 1;
        let grey = grey(settings) + self.brighter * (self.runs - 1) as u8;
        Ok((Picture::from_fn(16, 12, |_, _| [grey; 3]), Watts(watts)))
    }
}
