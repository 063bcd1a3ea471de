//! The stage as the evaluation of a path sees it: frame after frame, as an app would play them.

use bevy_frugal_gi::knobs::RenderSettings;

use super::{Stage, StageError};
use crate::evaluate::{Player, Pose, Shot};

/// Plays frames on a [`Stage`].
pub struct StagePlayer<'s> {
    stage: &'s mut Stage,
}

impl<'s> StagePlayer<'s> {
    /// A player over `stage`.
    pub fn new(stage: &'s mut Stage) -> Self {
        Self { stage }
    }
}

impl Player for StagePlayer<'_> {
    type Error = StageError;

    fn begin_run(
        &mut self,
        _: &str,
        pose: &Pose,
        settings: RenderSettings,
    ) -> Result<(), StageError> {
        self.stage.place(pose.position, pose.rotation);
        self.stage.apply(settings);
        (0..4).for_each(|_| self.stage.frame());
        Ok(())
    }

    /// One frame, metered with whatever its switch costs: that is part of what an app pays.
    fn play(&mut self, pose: &Pose, settings: RenderSettings) -> Result<Shot, StageError> {
        self.stage.place(pose.position, pose.rotation);
        self.stage.switch(settings);
        let power = self.stage.metered_frames(1)?;
        Ok(Shot { picture: self.stage.picture()?, power })
    }
}
