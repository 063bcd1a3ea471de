//! The stage as the evaluator of a search: power and error of settings at a camera.

use bevy_frugal_gi::frontier::CostPoint;
use bevy_frugal_gi::knobs::KnobLevels;
use bevy_frugal_gi::units::Watts;

use super::{Stage, StageError};
use crate::metrics::Reference;
use crate::scene::CameraPose;

/// Unmetered frames at the start of a clip: the first creates textures and pipelines.
const UNMETERED_FRAMES: usize = 1;

/// Renders and meters on a [`Stage`]; the reference is the best settings' image at the same camera.
pub struct StageEvaluator {
    stage: Stage,
    reference: Option<(Vec<CameraPose>, Reference)>,
}

impl StageEvaluator {
    /// An evaluator on `stage`.
    pub fn new(stage: Stage) -> Self {
        Self { stage, reference: None }
    }

    /// The stage.
    pub fn stage(&mut self) -> &mut Stage {
        &mut self.stage
    }

    /// Power and error of `settings` over a clip: the poses of consecutive frames. Power is the
    /// mean of all but the first frame, error that of the last one, against the last frame of the
    /// same clip at the best settings. A repeated pose is a still camera. Every clip begins with a
    /// cut, so its cost does not depend on earlier frames.
    ///
    /// # Errors
    /// When the rendering or the metering fails.
    pub fn measure(
        &mut self,
        clip: &[CameraPose],
        settings: KnobLevels,
    ) -> Result<CostPoint, StageError> {
        if self.reference.as_ref().is_none_or(|(of, _)| of != clip) {
            let best = self.stage.space.highest();
            self.stage.apply(best);
            if let Some(first) = clip.first() {
                // Some per-camera resources of the scene lag the camera by a frame.
                self.stage.place(first.position, first.rotation);
                self.stage.frame();
            }
            self.stage.apply(best);
            self.play(clip)?;
            self.reference = Some((clip.to_vec(), Reference::new(&self.stage.picture()?)?));
        }
        self.stage.apply(settings);
        let power = self.play(clip)?;
        let Some((_, reference)) = &self.reference else {
            return Ok(CostPoint::new(power.0, 0.0));
        };
        Ok(CostPoint::new(power.0, reference.error(&self.stage.picture()?)?))
    }

    fn play(&mut self, clip: &[CameraPose]) -> Result<Watts, StageError> {
        let mut poses = clip.iter();
        for pose in poses.by_ref().take(UNMETERED_FRAMES) {
            self.stage.place(pose.position, pose.rotation);
            self.stage.frame();
        }
        self.stage.metered(
            |frame| poses.clone().nth(frame).map(|pose| (pose.position, pose.rotation)),
            poses.len() as u32,
        )
    }
}
