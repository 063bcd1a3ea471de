//! Real plays beside those from a record: a check of the simulation, the machine's drift, and
//! images.

use std::ops::ControlFlow;

use frugal_core::knobs::KnobLevels;
use frugal_trace::metrics::{Picture, Reference};

use super::play::{Against, play};
use super::{
    Drift, EvaluationError, EvaluationResult, Fixed, FrameRecord, PathPlan, Policy, Progress,
};
use crate::stage::FrameRenderer;

/// Frames of history of an image.
const HISTORY: usize = 8;

/// Runs that were rendered.
pub(crate) struct RealPlay {
    /// Of the policies.
    pub runs: Vec<Vec<FrameRecord>>,
    /// From the first to the last run, both at the best settings.
    pub drift: Drift,
}

/// Renders a run of each of `policies`, between two runs of the `best` settings, whose images are
/// the references.
///
/// # Errors
/// When the frame renderer fails or `on_frame` breaks.
pub(crate) fn play_for_real<P: FrameRenderer>(
    renderer: &mut P,
    path: &PathPlan,
    best: KnobLevels,
    policies: &mut [Box<dyn Policy + '_>],
    on_frame: &mut dyn FnMut(&Progress<'_>) -> ControlFlow<()>,
) -> Result<RealPlay, EvaluationError<P::Error>> {
    let frames_total = (2 + policies.len()) * path.poses().len();
    let mut frames_done = 0;
    let mut run = |name: &str, policy: &mut dyn Policy, against: Against<'_>| {
        play(renderer, path, name, policy, against, &mut || {
            frames_done += 1;
            on_frame(&Progress { run: name, frames_done, frames_total })
        })
    };
    let mut references: Vec<Reference> = Vec::new();
    let first = run("maximum", &mut Fixed(best), Against::Collect(&mut references))?;
    let mut runs = Vec::new();
    for policy in policies {
        runs.push(run("frugal", policy.as_mut(), Against::Compare(&references))?);
    }
    let last = run("maximum again", &mut Fixed(best), Against::Compare(&references))?;
    Ok(RealPlay { runs, drift: Drift::between(&first, &last) })
}

/// The image of a frame of a run.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct FramePicture {
    /// The run.
    pub run: String,
    /// The frame's number.
    pub frame: usize,
    /// The display-referred image.
    pub picture: Picture,
}

/// Renders `frames` of every run, each with a short history; those beyond the path are left out.
///
/// # Errors
/// When the frame renderer fails or `on_frame` breaks.
pub(crate) fn pictures<P: FrameRenderer>(
    renderer: &mut P,
    path: &PathPlan,
    result: &EvaluationResult,
    frames: &[usize],
    on_frame: &mut dyn FnMut(&Progress<'_>) -> ControlFlow<()>,
) -> Result<Vec<FramePicture>, EvaluationError<P::Error>> {
    let mut kept = Vec::new();
    let frames_total = result.runs.len() * frames.len();
    for run in &result.runs {
        for frame in frames.iter().copied().filter(|frame| *frame < run.series.len()) {
            let mut picture = None;
            for shown in frame.saturating_sub(HISTORY)..=frame {
                let (pose, settings) = (&path.poses()[shown], run.series[shown].settings);
                if picture.is_none() {
                    renderer
                        .begin_run(&run.name, pose, settings)
                        .map_err(EvaluationError::FrameRenderer)?;
                }
                let rendered = renderer.render_frame(pose, settings);
                picture = Some(rendered.map_err(EvaluationError::FrameRenderer)?.picture);
            }
            kept.extend(picture.map(|picture| FramePicture {
                run: run.name.clone(),
                frame,
                picture,
            }));
            let frames_done = kept.len();
            if on_frame(&Progress { run: "images", frames_done, frames_total }).is_break() {
                return Err(EvaluationError::Interrupted);
            }
        }
    }
    Ok(kept)
}
