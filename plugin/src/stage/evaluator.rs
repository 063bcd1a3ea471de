//! The stage as the evaluator of a search: power and error of settings at a camera.

use frugal_trace::metrics::{Picture, Reference};
use frugal_trace::scene::CameraPose;
use serde::{Deserialize, Serialize};

use super::metering::SHORT_WINDOW;
use super::{Meter, Stage, StageError};
use crate::knobs::KnobLevels;
use crate::units::Watts;

/// Unmetered frames at the start of a clip: the first creates textures and pipelines.
const UNMETERED_FRAMES: usize = 1;

/// What settings cost at a camera.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Measurement {
    /// Power at the target frame rate; `None` on a stage without a meter.
    pub power: Option<Watts>,
    /// 1 − SSIM, against the image of the best settings; 0 of a clip without frames.
    pub error: f64,
}

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
    ) -> Result<Measurement, StageError> {
        if self.reference.as_ref().is_none_or(|(of, _)| of != clip) {
            let best = self.stage.space.highest();
            self.stage.apply(best);
            if let Some(first) = clip.first() {
                // Some per-camera resources of the scene lag the camera by a frame.
                show(&mut self.stage, std::slice::from_ref(first));
            }
            let (_, shown) = self.play(clip, best)?;
            self.reference = Some((clip.to_vec(), Reference::new(&shown)?));
        }
        let (power, shown) = self.play(clip, settings)?;
        let Some((_, reference)) = &self.reference else {
            return Ok(Measurement { power, error: 0.0 });
        };
        Ok(Measurement { power, error: reference.error(&shown)? })
    }

    /// Power over the clip, and its last image.
    fn play(
        &mut self,
        clip: &[CameraPose],
        settings: KnobLevels,
    ) -> Result<(Option<Watts>, Picture), StageError> {
        self.stage.complete(settings, |stage| play_once(stage, clip))
    }
}

fn show(stage: &mut Stage, poses: &[CameraPose]) {
    for pose in poses {
        stage.place(pose.position, pose.rotation);
        stage.frame();
    }
}

fn play_once(
    stage: &mut Stage,
    clip: &[CameraPose],
) -> Result<(Option<Watts>, Picture), StageError> {
    let (first, rest) = clip.split_at(UNMETERED_FRAMES.min(clip.len()));
    show(stage, first);
    let window = stage.meter.as_ref().map_or(0.0, Meter::window_seconds);
    if clip.first() != clip.last() && window >= SHORT_WINDOW {
        // The meter's window is longer than the clip. The image is that of the clip; then the
        // camera goes to and fro, since one at rest costs less.
        show(stage, rest);
        let shown = stage.picture()?;
        let pose = |frame| to_and_fro(clip, frame).map(|pose| (pose.position, pose.rotation));
        return Ok((stage.metered(pose, clip.len() as u32)?, shown));
    }
    let pose = |frame: usize| rest.get(frame).map(|pose| (pose.position, pose.rotation));
    let power = stage.metered(pose, rest.len() as u32)?;
    Ok((power, stage.picture()?))
}

/// The pose `frame` frames after the end of `clip`, of a camera that goes back to its beginning,
/// and to its end again.
fn to_and_fro(clip: &[CameraPose], frame: usize) -> Option<&CameraPose> {
    let last = clip.len().checked_sub(1).filter(|last| *last > 0)?;
    clip.get(((frame + 1) % (2 * last)).abs_diff(last))
}

#[cfg(test)]
mod tests {
    use bevy::math::{Quat, Vec3};

    use super::*;

    #[test]
    fn a_camera_goes_to_and_fro() {
        let pose = |x: f32| CameraPose { position: Vec3::X * x, rotation: Quat::IDENTITY };
        let clip = [pose(0.0), pose(1.0), pose(2.0), pose(3.0)];
        let shown: Vec<_> = (0..9)
            .filter_map(|frame| to_and_fro(&clip, frame))
            .map(|pose| pose.position.x)
            .collect();
        assert_eq!(shown, [2.0, 1.0, 0.0, 1.0, 2.0, 3.0, 2.0, 1.0, 0.0]);
        assert_eq!((to_and_fro(&clip[..1], 3), to_and_fro(&[], 3)), (None, None));
    }
}
