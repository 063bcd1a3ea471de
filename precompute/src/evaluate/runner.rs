//! The rendered runs of an evaluation: selection, order and reference images.

use std::ops::ControlFlow;

use bevy_frugal_gi::frontier::Frontier;
use bevy_frugal_gi::knobs::KnobSpace;
use bevy_frugal_gi::power::MeterInfo;

use frugal_trace::metrics::{Picture, Reference, SsimError};

use super::baselines::best_on;
use super::play::{Against, play};
use super::resolution::{self, RESOLUTION_KNOB};
use super::result::mean_power;
use super::{
    BudgetRequest, Drift, EvaluationResult, Fixed, PathPlan, Policy, PowerBudget, Progress,
    ResolvedBudget, RunResult,
};
use crate::stage::FrameRenderer;

/// Relative change of the maximum run's mean power from which drift is reported.
const NOTABLE_DRIFT: f64 = 0.05;
/// Mean error between two runs at the same settings from which noise is reported. Half the smallest
/// error step that subdivision considers.
const NOTABLE_NOISE: f64 = 0.001;

/// Name of the run of the best constant settings by the training cameras.
pub(super) const ELSEWHERE: &str = "best-constant-elsewhere";

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

/// The input of an evaluation.
#[derive(Clone, Debug)]
pub(crate) struct EvaluationPlan<'a> {
    /// The scene's name, for the record.
    pub scene: &'a str,
    /// The knobs that settings refer to.
    pub space: &'a KnobSpace,
    /// The camera's path.
    pub path: &'a PathPlan,
    /// The frame renderer's meter, for the record.
    pub meter: MeterInfo,
    /// The limits.
    pub budget: BudgetRequest,
    /// Mean costs at training cameras, from which the best constant is chosen; without it there is no
    /// such run.
    pub trained: Option<&'a Frontier>,
    /// Numbers of the frames whose images are returned for every run; those beyond the path are
    /// ignored.
    pub keep_frames: &'a [usize],
}

/// A frame's image that is returned.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct FramePicture {
    /// The run.
    pub run: String,
    /// The frame's number.
    pub frame: usize,
    /// The display-referred image.
    pub picture: Picture,
}

/// The output of an evaluation.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Evaluation {
    /// The figures.
    pub result: EvaluationResult,
    /// The requested images, run by run in the result's order.
    pub pictures: Vec<FramePicture>,
}

/// Renders `plan`'s path at the maximum and at the minimum, which define percentages; then under
/// the policy that `controller` makes from the budget in watts, and with the best constant by the
/// training cameras; then with the presets in between and with resolution alone; and once more at
/// the maximum, to measure the machine's drift.
///
/// The maximum's images are the references: they stay in memory, 16 bytes per pixel and frame.
/// `on_frame` is called after every frame; `Break` ends the evaluation.
///
/// # Errors
/// When the frame renderer fails, returns images of several sizes or a power that is negative or
/// not finite, or `on_frame` breaks.
pub(crate) fn evaluate<'c, P: FrameRenderer>(
    renderer: &mut P,
    plan: &EvaluationPlan<'_>,
    controller: impl FnOnce(&ResolvedBudget) -> Box<dyn Policy + 'c>,
    on_frame: &mut dyn FnMut(&Progress<'_>) -> ControlFlow<()>,
) -> Result<Evaluation, EvaluationError<P::Error>> {
    let (space, path) = (plan.space, plan.path);
    let resolution_knob = space.index_of(RESOLUTION_KNOB);
    let levels = resolution_knob.map_or(0, |knob| space.knobs()[knob].levels.len());
    // Seven runs, and those of the binary search.
    let runs =
        6 + usize::from(plan.trained.is_some()) + levels.checked_ilog2().unwrap_or(0) as usize + 1;
    let mut context = RunContext {
        renderer,
        plan,
        on_frame,
        references: Vec::new(),
        frames_done: 0,
        frames_total: runs * path.poses().len(),
    };

    let highest = space.highest();
    let maximum = context.run("maximum", &mut Fixed(highest))?;
    let minimum = context.run("minimum", &mut Fixed(space.lowest()))?;
    let (p_min, p_max) = (mean_power(&minimum.0), mean_power(&maximum.0));
    let budget = plan.budget.resolve(p_min, p_max);
    let frugal = context.run("frugal", controller(&budget).as_mut())?;
    let constant = plan.trained.and_then(|trained| best_on(trained, &budget));
    let constant =
        constant.map(|settings| context.run(ELSEWHERE, &mut Fixed(settings))).transpose()?;
    let max_mid = context.run("max-mid", &mut Fixed(space.preset(2.0 / 3.0)))?;
    let mid_min = context.run("mid-min", &mut Fixed(space.preset(1.0 / 3.0)))?;
    let resolution_only = match resolution_knob {
        Some(knob) => Some(resolution::search(levels - 1, &maximum.0, &budget, |level| {
            context.run("resolution-only", &mut Fixed(highest.with_level(knob, level)))
        })?),
        None => None,
    };
    let again = context.run("maximum again", &mut Fixed(highest))?;
    let drift = Drift::between(&maximum.0, &again.0);

    let mut warnings = warnings(&plan.budget, p_min.0, p_max.0, &drift);
    let mut pictures = Vec::new();
    let size = context.references.first().map_or((0, 0), Reference::size);
    let mut add = |name: &str, (series, kept): (Vec<_>, Vec<FramePicture>)| {
        pictures.extend(kept);
        RunResult::new(name, series, &budget, space).with_windows(&budget, path.fps())
    };
    let maximum_frames = maximum.clone();
    let mut runs = vec![
        add("frugal", frugal),
        add("maximum", maximum),
        add("max-mid", max_mid),
        add("mid-min", mid_min),
        add("minimum", minimum),
    ];
    runs.extend(constant.map(|constant| {
        let mut run = add(ELSEWHERE, constant);
        run.note = Some("tuned on the training cameras".to_owned());
        run
    }));
    match resolution_only {
        Some(found) => {
            let mut renamed = maximum_frames;
            renamed.1.iter_mut().for_each(|picture| picture.run = "resolution-only".to_owned());
            let mut run = add("resolution-only", found.played.unwrap_or(renamed));
            run.note = (!found.met)
                .then(|| "no resolution meets the budget: this is the closest".to_owned());
            runs.push(run);
        }
        None => warnings.push(format!(
            "the run resolution-only is missing: this scene's knobs lack `{RESOLUTION_KNOB}`"
        )),
    }
    let result = EvaluationResult {
        scene: plan.scene.to_owned(),
        path: path.name().to_owned(),
        frames: path.poses().len(),
        fps: path.fps(),
        size: size.into(),
        meter: plan.meter.clone(),
        budget,
        asked: plan.budget.to_string(),
        runs,
        drift,
        warnings,
        gap_closed: None,
        dominated_by: Vec::new(),
        spot_check: None,
    };
    Ok(Evaluation { result, pictures })
}

fn warnings(request: &BudgetRequest, p_min: f64, p_max: f64, drift: &Drift) -> Vec<String> {
    let mut warnings = Vec::new();
    if p_max <= p_min {
        let meaning = if matches!(request.power, Some(PowerBudget::Share(_))) {
            ", so a percentage between them is undefined"
        } else {
            ""
        };
        warnings.push(format!("the highest settings took no more power ({p_max:.3} W) than the lowest ({p_min:.3} W){meaning}"));
    }
    if drift.relative.abs() > NOTABLE_DRIFT {
        let percent = 100.0 * drift.relative;
        warnings
            .push(format!("the same settings took {percent:+.1}% power at the end: smaller differences between runs are the machine's drift"));
    }
    if drift.repeat_mean_error > NOTABLE_NOISE {
        let error = drift.repeat_mean_error;
        warnings.push(format!("the same settings rendered twice differ by an error of {error:.4}: smaller errors are noise"));
    }
    warnings
}

/// State that all runs share.
struct RunContext<'a, 'p, P> {
    renderer: &'a mut P,
    plan: &'a EvaluationPlan<'p>,
    on_frame: &'a mut dyn FnMut(&Progress<'_>) -> ControlFlow<()>,
    references: Vec<Reference>,
    frames_done: usize,
    frames_total: usize,
}

impl<P: FrameRenderer> RunContext<'_, '_, P> {
    /// The first run's images become the references.
    fn run(
        &mut self,
        name: &str,
        policy: &mut dyn Policy,
    ) -> Result<(Vec<super::FrameRecord>, Vec<FramePicture>), EvaluationError<P::Error>> {
        let mut kept = Vec::new();
        let mut keep = |frame: usize, picture: Picture| {
            if self.plan.keep_frames.contains(&frame) {
                kept.push(FramePicture { run: name.to_owned(), frame, picture });
            }
        };
        let mut told = || {
            self.frames_done += 1;
            (self.on_frame)(&Progress {
                run: name,
                frames_done: self.frames_done,
                frames_total: self.frames_total,
            })
        };
        let first = self.references.is_empty();
        let against = if first {
            Against::Collect(&mut self.references)
        } else {
            Against::Compare(&self.references)
        };
        let series =
            play(self.renderer, self.plan.path, name, policy, against, &mut keep, &mut told)?;
        Ok((series, kept))
    }
}

#[cfg(test)]
#[path = "runner_tests.rs"]
mod tests;
