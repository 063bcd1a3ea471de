//! The stage as the evaluator of a search: power and error of settings at a camera. The reference is the
//! best settings' image at the same camera.

use frugal_trace::metrics::{Picture, Reference};
use frugal_trace::scene::CameraPose;
use serde::{Deserialize, Serialize};

use super::metering::SHORT_WINDOW;
use super::{Stage, StageError};
use crate::knobs::KnobLevels;
use crate::units::Watts;

/// Unmetered frames at the start of a clip: the first creates textures and pipelines.
const UNMETERED_FRAMES: usize = 1;

/// What settings cost at a camera.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Measurement {
    /// Power at the target frame rate; `None` on a stage without a meter.
    pub power: Option<Watts>,
    /// 1 − SSIM, against the image of the best settings.
    pub error: f64,
}

impl Stage {
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
        let known = self.reference.take().filter(|(of, _)| of == clip);
        let reference = match known {
            Some((_, reference)) => reference,
            None => {
                let best = self.space.highest();
                self.apply(best);
                // Some per-camera resources of the scene lag the camera by a frame.
                self.show(clip.get(..1).unwrap_or_default());
                let (_, shown) = self.complete(best, |stage| stage.play(clip))?;
                Reference::new(&shown).map_err(StageError::failed)?
            }
        };
        let (power, shown) = self.complete(settings, |stage| stage.play(clip))?;
        let error = reference.error(&shown).map_err(StageError::failed)?;
        self.reference = Some((clip.to_vec(), reference));
        Ok(Measurement { power, error })
    }

    fn show(&mut self, poses: &[CameraPose]) {
        for pose in poses {
            self.place(pose.position, pose.rotation);
            self.frame();
        }
    }

    /// Power over the clip, and its last image.
    fn play(&mut self, clip: &[CameraPose]) -> Result<(Option<Watts>, Picture), StageError> {
        let (first, rest) = clip.split_at(UNMETERED_FRAMES.min(clip.len()));
        self.show(first);
        let window = self.meter.as_ref().map_or(0.0, |meter| meter.window_seconds);
        if clip.first() != clip.last() && window >= SHORT_WINDOW {
            // The meter's window is longer than the clip. The image is that of the clip; then the
            // camera goes to and fro, since one at rest costs less.
            self.show(rest);
            let shown = self.picture()?;
            let power = self.metered(|frame| to_and_fro(clip, frame).copied(), clip.len())?;
            return Ok((power, shown));
        }
        let power = self.metered(|frame| rest.get(frame).copied(), rest.len())?;
        Ok((power, self.picture()?))
    }
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
