//! One run along a path: the frame renderer, the policy, and the record of every frame.

use std::ops::ControlFlow;

use frugal_core::frontier::CostPoint;
use frugal_search::evaluate::{FrameRecord, PathPlan, Policy, Pose};
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

/// A scene's path called `name`, from its start, at `fps` frames per second.
///
/// # Errors
/// As [`PathPlan::sample`].
pub(crate) fn plan_along(name: &str, path: &CameraPath, fps: f64) -> Result<PathPlan, String> {
    PathPlan::sample(name, f64::from(path.duration()), fps, |seconds| {
        path.sample(path.start() + seconds as f32)
            .unwrap_or(Pose { position: glam::Vec3::ZERO, rotation: glam::Quat::IDENTITY })
    })
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

/// Use of a run's images.
pub(crate) enum Against<'a> {
    /// Stores them as the references.
    Collect(&'a mut Vec<Reference>),
    /// Compares them with these references.
    Compare(&'a [Reference]),
}

/// Plays all of `path`. `on_frame` is called after every frame and can stop the run.
pub(crate) fn play<P: FrameRenderer>(
    renderer: &mut P,
    path: &PathPlan,
    name: &str,
    policy: &mut dyn Policy,
    mut against: Against<'_>,
    on_frame: &mut dyn FnMut() -> ControlFlow<()>,
) -> Result<Vec<FrameRecord>, EvaluationError<P::Error>> {
    let dt = path.fps().recip();
    let mut records = Vec::with_capacity(path.poses().len());
    for (frame, pose) in path.poses().iter().enumerate() {
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
