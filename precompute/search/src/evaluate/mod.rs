//! Policies simulated along a recorded path and compared: neither a renderer nor a scene is needed.
//!
//! | part | job |
//! |---|---|
//! | `budget` | `7W`, `60%`, `0.02`: reading budgets, resolving percentages |
//! | `record` | power and error of many settings at every frame of a path; policies are simulated from it |
//! | `result` | results, as JSON |
//! | `baselines` | constants, oracles, and the reactive ladder |
//! | `controlled` | the plugin's controller as a policy |
//! | `judge` | the comparison of all of them under one budget |

mod baselines;
mod budget;
mod controlled;
mod judge;
mod record;
mod result;

use frugal_core::frontier::CostPoint;
use frugal_core::knobs::KnobLevels;
use frugal_core::units::Watts;

pub use baselines::{Reactive, ladder};
pub use budget::{BudgetRequest, PowerBudget, ResolvedBudget, parse_error_budget};
pub use controlled::Controller;
pub use judge::{Baselines, Trial, settings_to_record};
pub use record::PathRecord;
pub use result::{Drift, EvaluationResult, Made, RunResult, SpotCheck};

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

    /// The path called `name`, at `fps` frames per second, with a pose for each frame.
    ///
    /// # Errors
    /// When the frame rate is not above 0 and finite, or there are no frames or too many.
    pub fn new(
        name: &str,
        fps: f64,
        poses: impl ExactSizeIterator<Item = Pose>,
    ) -> Result<Self, String> {
        if !(fps > 0.0 && fps.is_finite()) {
            return Err(format!(
                "{fps} frames per second: the frame rate must be above 0 and finite"
            ));
        }
        let (frames, most) = (poses.len(), Self::MAX_FRAMES);
        if !(1..=most).contains(&frames) {
            return Err(format!(
                "path `{name}` has {frames} frames, where one to {most} are played"
            ));
        }
        Ok(Self { name: name.to_owned(), fps, poses: poses.collect() })
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

    #[test]
    fn impossible_paths_are_refused() {
        let still = Pose { position: Vec3::ZERO, rotation: Quat::IDENTITY };
        let refused = |frames: usize, fps| {
            PathPlan::new("tour", fps, (0..frames).map(|_| still)).expect_err("an impossible path")
        };
        for fps in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(refused(1, fps).contains("frame rate must be above 0"), "{fps}");
        }
        for frames in [0, PathPlan::MAX_FRAMES + 1, usize::MAX] {
            assert!(refused(frames, 30.0).contains("one to 216000 are played"), "{frames}");
        }
    }
}
