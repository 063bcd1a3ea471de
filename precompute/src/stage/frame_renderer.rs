//! The stage as the frame renderer of an evaluation: consecutive frames, as in an app.

use bevy_frugal_gi::knobs::KnobLevels;

use super::{Stage, StageError};
use crate::evaluate::{FrameRenderer, Pose, RenderedFrame};

/// Renders consecutive frames on a [`Stage`].
pub(crate) struct StageFrameRenderer<'s> {
    stage: &'s mut Stage,
}

impl<'s> StageFrameRenderer<'s> {
    /// A frame renderer on `stage`.
    pub(crate) fn new(stage: &'s mut Stage) -> Self {
        Self { stage }
    }
}

impl FrameRenderer for StageFrameRenderer<'_> {
    type Error = StageError;

    fn begin_run(&mut self, _: &str, pose: &Pose, settings: KnobLevels) -> Result<(), StageError> {
        self.stage.place(pose.position, pose.rotation);
        self.stage.apply(settings);
        (0..4).for_each(|_| self.stage.frame());
        Ok(())
    }

    /// Renders and meters one frame, including the cost of a switch of settings, which an app pays
    /// too.
    fn render_frame(
        &mut self,
        pose: &Pose,
        settings: KnobLevels,
    ) -> Result<RenderedFrame, StageError> {
        self.stage.place(pose.position, pose.rotation);
        self.stage.switch(settings);
        let power = self.stage.metered_frames(1)?;
        Ok(RenderedFrame { picture: self.stage.picture()?, power })
    }
}
