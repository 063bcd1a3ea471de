//! One run along a path: the frame renderer, the policy, and the record of every frame.

use std::ops::ControlFlow;

use frugal_core::frontier::CostPoint;
use frugal_core::knobs::KnobLevels;
use frugal_core::units::Watts;
use frugal_trace::metrics::{Reference, SsimError};

use crate::scene::CameraPath;
use crate::stage::FrameRenderer;

/// Why an evaluation failed. `E` is the [`FrameRenderer`]'s error.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub(crate) enum EvaluationError<E> {
    /// Rendering or metering failed.
    #[error("{0}")]
    FrameRenderer(E),
    /// A frame's image cannot be compared with its reference.
    #[error("run `{run}`, frame {frame}: {source}")]
    Compare {
        /// The run.
        run: String,
        /// The frame's number.
        frame: usize,
        /// Why.
        source: SsimError,
    },
    /// A power that is negative or not finite.
    #[error("run `{run}`, frame {frame}: the meter gave {watts} W")]
    BadPower {
        /// The run.
        run: String,
        /// The frame's number.
        frame: usize,
        /// The reading.
        watts: f64,
    },
    /// Stopped from outside.
    #[error("interrupted")]
    Interrupted,
}

/// A camera's pose.
pub(crate) type Pose = frugal_trace::scene::CameraPose;

/// A policy's choice for a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Choice {
    /// The settings.
    pub settings: KnobLevels,
    /// The settings that the filter moves to; other than `settings` during a transition.
    pub target: KnobLevels,
    /// Predicted cost of the target, where the policy has a prediction.
    pub predicted: Option<CostPoint>,
}

impl From<KnobLevels> for Choice {
    fn from(settings: KnobLevels) -> Self {
        Self { settings, target: settings, predicted: None }
    }
}

/// Decides the settings of every frame of a run.
pub(crate) trait Policy {
    /// The settings of frame number `frame` at `pose`, `dt` seconds after the frame before. Called
    /// once for each frame, in order.
    fn decide(&mut self, frame: usize, dt: f64, pose: &Pose) -> Choice;

    /// Receives the cost of the last frame: for policies that react to a meter.
    fn observe(&mut self, cost: CostPoint) {
        let _ = cost;
    }
}

/// The same settings throughout.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Fixed(pub KnobLevels);

impl Policy for Fixed {
    fn decide(&mut self, _: usize, _: f64, _: &Pose) -> Choice {
        self.0.into()
    }
}

/// A function of the frame's number, the seconds since the frame before, and the pose.
impl<F: FnMut(usize, f64, &Pose) -> Choice> Policy for F {
    fn decide(&mut self, frame: usize, dt: f64, pose: &Pose) -> Choice {
        self(frame, dt, pose)
    }
}

/// A path, sampled at its frames.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PathPlan {
    name: String,
    fps: f64,
    poses: Vec<Pose>,
}

impl PathPlan {
    /// The longest path, in frames: an hour at 60 frames per second.
    pub(crate) const MAX_FRAMES: usize = 216_000;

    /// A scene's path called `name`, from its start, at `fps` frames per second.
    ///
    /// # Errors
    /// As [`sample`](Self::sample).
    pub(crate) fn along(name: &str, path: &CameraPath, fps: f64) -> Result<Self, String> {
        Self::sample(name, f64::from(path.duration()), fps, |seconds| {
            path.sample(path.start() + seconds as f32)
                .unwrap_or(Pose { position: glam::Vec3::ZERO, rotation: glam::Quat::IDENTITY })
        })
    }

    /// The path called `name`, `duration` seconds long, at `fps` frames per second: round(duration
    /// × fps) frames, at least one, the camera of frame i being `pose_at(i / fps)`.
    ///
    /// # Errors
    /// When the frame rate is not above 0 and finite, or the duration negative, not a number, or
    /// too long.
    pub(crate) fn sample(
        name: &str,
        duration: f64,
        fps: f64,
        mut pose_at: impl FnMut(f64) -> Pose,
    ) -> Result<Self, String> {
        if !(fps > 0.0 && fps.is_finite()) {
            return Err(format!(
                "{fps} frames per second: the frame rate must be above 0 and finite"
            ));
        }
        if duration.is_nan() || duration < 0.0 {
            return Err(format!(
                "path `{name}` lasts {duration} s: the duration must be 0 s or more"
            ));
        }
        let frames = (duration * fps).round().max(1.0);
        if frames > Self::MAX_FRAMES as f64 {
            let most = Self::MAX_FRAMES;
            return Err(format!(
                "path `{name}` has {frames} frames, where at most {most} are played"
            ));
        }
        let poses = (0..frames as usize).map(|frame| pose_at(frame as f64 / fps)).collect();
        Ok(Self { name: name.to_owned(), fps, poses })
    }

    /// The poses of a path's frames at `fps` frames per second.
    ///
    /// # Errors
    /// When there are none or too many.
    pub(crate) fn of_poses(name: &str, fps: f64, poses: Vec<Pose>) -> Result<Self, String> {
        let (frames, most) = (poses.len(), Self::MAX_FRAMES);
        if !(1..=most).contains(&frames) {
            return Err(format!(
                "path `{name}` has {frames} frames, where one to {most} are played"
            ));
        }
        Ok(Self { name: name.to_owned(), fps, poses })
    }

    /// The path's name in the scene.
    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    /// Frames per second.
    pub(crate) fn fps(&self) -> f64 {
        self.fps
    }

    /// The camera pose of every frame; at least one.
    pub(crate) fn poses(&self) -> &[Pose] {
        &self.poses
    }
}

/// Progress of an evaluation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Progress<'a> {
    /// The run that is playing.
    pub run: &'a str,
    /// Frames of all runs played so far, this one included.
    pub frames_done: usize,
    /// Frames of all runs.
    pub frames_total: usize,
}

/// The record of one frame of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FrameRecord {
    /// Seconds since the path's start.
    pub time: f64,
    /// The settings it was rendered with.
    pub settings: KnobLevels,
    /// Power at the target frame rate.
    pub power: Watts,
    /// 1 − SSIM against the same frame at the best settings.
    pub error: f64,
    /// The policy's prediction.
    pub predicted: Option<CostPoint>,
}

/// Use of a run's images.
pub(super) enum Against<'a> {
    /// Stores them as the references.
    Collect(&'a mut Vec<Reference>),
    /// Compares them with these references.
    Compare(&'a [Reference]),
}

/// Plays all of `path`. `on_frame` is called after every frame and can stop the run.
pub(super) fn play<P: FrameRenderer>(
    renderer: &mut P,
    path: &PathPlan,
    name: &str,
    policy: &mut dyn Policy,
    mut against: Against<'_>,
    on_frame: &mut dyn FnMut() -> ControlFlow<()>,
) -> Result<Vec<FrameRecord>, EvaluationError<P::Error>> {
    let dt = path.fps.recip();
    let mut records = Vec::with_capacity(path.poses.len());
    for (frame, pose) in path.poses.iter().enumerate() {
        let choice = policy.decide(frame, dt, pose);
        if frame == 0 {
            renderer
                .begin_run(name, pose, choice.settings)
                .map_err(EvaluationError::FrameRenderer)?;
        }
        let rendered =
            renderer.render_frame(pose, choice.settings).map_err(EvaluationError::FrameRenderer)?;
        let watts = rendered.power.0;
        if !(watts.is_finite() && watts >= 0.0) {
            return Err(EvaluationError::BadPower { run: name.to_owned(), frame, watts });
        }
        let at_frame = |source| EvaluationError::Compare { run: name.to_owned(), frame, source };
        let error = match &mut against {
            Against::Collect(references) => {
                references.push(Reference::new(&rendered.picture).map_err(at_frame)?);
                0.0
            }
            Against::Compare(references) => {
                references[frame].error(&rendered.picture).map_err(at_frame)?
            }
        };
        let time = frame as f64 * dt;
        policy.observe(CostPoint::new(rendered.power.0, error));
        records.push(FrameRecord {
            time,
            settings: choice.settings,
            power: rendered.power,
            error,
            predicted: choice.predicted,
        });
        if on_frame().is_break() {
            return Err(EvaluationError::Interrupted);
        }
    }
    Ok(records)
}

#[cfg(test)]
mod tests {
    use glam::{Quat, Vec3};

    use super::*;

    fn still(_: f64) -> Pose {
        Pose { position: Vec3::ZERO, rotation: Quat::IDENTITY }
    }

    #[test]
    fn a_path_has_as_many_frames_as_its_length_says() {
        let frames =
            |duration, fps| PathPlan::sample("tour", duration, fps, still).unwrap().poses().len();
        assert_eq!(frames(6.0, 30.0), 180);
        assert_eq!(frames(0.99, 2.0), 2);
        assert_eq!(frames(0.0, 30.0), 1, "a still camera is a path too");
        let path = PathPlan::sample("tour", 1.0, 4.0, |time| Pose {
            position: Vec3::X * time as f32,
            rotation: Quat::IDENTITY,
        })
        .unwrap();
        assert_eq!(
            path.poses().iter().map(|pose| pose.position.x).collect::<Vec<_>>(),
            [0.0, 0.25, 0.5, 0.75]
        );
    }

    #[test]
    fn impossible_paths_are_refused() {
        let refused = |duration, fps| {
            PathPlan::sample("tour", duration, fps, still).expect_err("an impossible path")
        };
        for fps in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(refused(1.0, fps).contains("frame rate must be above 0"), "{fps}");
        }
        for seconds in [-1.0, f64::NAN, f64::NEG_INFINITY] {
            assert!(refused(seconds, 30.0).contains("duration must be 0 s or more"), "{seconds}");
        }
        assert!(refused(f64::INFINITY, 30.0).contains("at most 216000 are played"));
    }
}
