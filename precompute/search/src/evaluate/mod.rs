//! Policies simulated along a recorded path and compared: neither a renderer nor a scene is needed.
//!
//! | part | job |
//! |---|---|
//! | `budget` | `7W`, `60%`, `0.02`: reading budgets, resolving percentages |
//! | `record` | power and error of many settings at every frame of a path; policies are simulated from it |
//! | `data` | records as small files |
//! | `result` | results, as JSON |
//! | `baselines` | constants, oracles, and the reactive ladder |
//! | `controlled` | the plugin's controller as a policy |
//! | `judge` | the comparison of all of them under one budget |

mod baselines;
mod budget;
mod controlled;
mod data;
mod judge;
mod record;
mod result;

use frugal_core::frontier::CostPoint;
use frugal_core::knobs::KnobLevels;
use frugal_core::units::Watts;

pub use baselines::{Reactive, best_constant, ladder};
pub use budget::{BudgetRequest, PowerBudget, ResolvedBudget, parse_error_budget};
pub use controlled::Controller;
pub use data::{Made, RecordFile, read_records};
pub use judge::{Baselines, Trial, settings_to_record};
pub use record::PathRecord;
pub use result::{Drift, EvaluationResult, RunResult, SpotCheck};

/// A camera's pose.
pub type Pose = frugal_trace::scene::CameraPose;

/// A policy's choice for a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Choice {
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
pub trait Policy {
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
pub struct Fixed(pub KnobLevels);

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
pub struct PathPlan {
    name: String,
    fps: f64,
    poses: Vec<Pose>,
}

impl PathPlan {
    /// The longest path, in frames: an hour at 60 frames per second.
    pub const MAX_FRAMES: usize = 216_000;

    /// The path called `name`, `duration` seconds long, at `fps` frames per second: round(duration
    /// × fps) frames, at least one, the camera of frame i being `pose_at(i / fps)`.
    ///
    /// # Errors
    /// When the frame rate is not above 0 and finite, or the duration negative, not a number, or
    /// too long.
    pub fn sample(
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
    pub fn of_poses(name: &str, fps: f64, poses: Vec<Pose>) -> Result<Self, String> {
        let (frames, most) = (poses.len(), Self::MAX_FRAMES);
        if !(1..=most).contains(&frames) {
            return Err(format!(
                "path `{name}` has {frames} frames, where one to {most} are played"
            ));
        }
        Ok(Self { name: name.to_owned(), fps, poses })
    }

    /// The path's name in the scene.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Frames per second.
    pub fn fps(&self) -> f64 {
        self.fps
    }

    /// The camera pose of every frame; at least one.
    pub fn poses(&self) -> &[Pose] {
        &self.poses
    }
}

/// The record of one frame of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameRecord {
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
