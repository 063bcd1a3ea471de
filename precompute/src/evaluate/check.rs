//! Real plays beside those from a record: a check of the simulation, and the machine's drift.

use std::ops::ControlFlow;

use frugal_core::knobs::KnobLevels;
use frugal_search::evaluate::{Drift, Fixed, FrameRecord, PathPlan, Policy};
use frugal_search::pipeline::{PipelineError, Progress};
use frugal_trace::metrics::Picture;

use super::{Against, play};
use crate::stage::FrameRenderer;

/// Renders a run of each of `policies`, between two runs of the `best` settings, whose images are
/// the references. Returns their frames, and the drift from the first run to the last.
///
/// # Errors
/// When the frame renderer fails or `on_frame` breaks.
pub(crate) fn play_for_real(
    renderer: &mut impl FrameRenderer,
    path: &PathPlan,
    best: KnobLevels,
    policies: &mut [Box<dyn Policy + '_>],
    on_frame: &mut dyn FnMut(&Progress<'_>) -> ControlFlow<()>,
) -> Result<(Vec<Vec<FrameRecord>>, Drift), PipelineError> {
    let total = (2 + policies.len()) * path.poses().len();
    let mut done = 0;
    let mut run = |name: &str, policy: &mut dyn Policy, against: Against<'_>| {
        play(renderer, path, name, policy, against, &mut || {
            done += 1;
            on_frame(&Progress { stage: name, done, total })
        })
    };
    let mut references: Vec<Picture> = Vec::new();
    let first = run("maximum", &mut Fixed(best), Against::Collect(&mut references))?;
    let mut runs = Vec::new();
    for policy in policies {
        runs.push(run("frugal", policy.as_mut(), Against::Compare(&references))?);
    }
    let last = run("maximum again", &mut Fixed(best), Against::Compare(&references))?;
    Ok((runs, Drift::between(&first, &last)))
}

#[cfg(test)]
mod tests {
    use frugal_search::evaluate::{Baselines, BudgetRequest, EvaluationResult, PowerBudget};
    use frugal_search::testing::formula::{ALONG, map, path, recorded, space, trial};

    use super::*;
    use crate::evaluate::testing::Fake;

    #[test]
    fn a_real_play_checks_the_record_and_finds_drift() {
        let map = map(space());
        let record = recorded(&map, Baselines::Quick);
        let trial = trial(&record, &map, Baselines::Quick);
        let budget = BudgetRequest { power: Some(PowerBudget::Share(0.6)), ..Default::default() };
        let mut result = trial.judge(&budget);
        let mut renderer = Fake { drift: 0.2, ..Fake::default() };
        let mut policies: Vec<Box<dyn Policy + '_>> =
            vec![Box::new(trial.controller(&result.budget))];
        let (mut seen, mut stages) = (0, Vec::new());
        let (runs, drift) = play_for_real(
            &mut renderer,
            &path(),
            space().highest(),
            &mut policies,
            &mut |progress| {
                seen = progress.done;
                stages.push(progress.stage.to_owned());
                stages.dedup();
                assert!(progress.done <= progress.total);
                ControlFlow::Continue(())
            },
        )
        .unwrap();
        let stages = stages.join(", ");
        assert_eq!((stages.as_str(), renderer.runs), ("maximum, frugal, maximum again", 3));
        assert_eq!(seen, 30);
        let simulated = record.simulate(&mut trial.controller(&result.budget));
        result.add_check(&runs[0], &simulated, drift);
        assert!((result.drift.relative - 0.4 / (4.2 + ALONG)).abs() < 1e-9);
        assert_eq!(result.drift.repeat_max_error, 0.0);
        assert!(result.warnings.last().unwrap().contains("the machine's"));
        let differs = |result: &EvaluationResult| {
            result
                .warnings
                .iter()
                .filter(|warning| warning.contains("less power than the record"))
                .count()
        };
        let cheaper: Vec<FrameRecord> = simulated
            .iter()
            .map(|frame| FrameRecord { power: frame.power * 0.7, ..*frame })
            .collect();
        assert_eq!(differs(&result), 0);
        let mut other = result.clone();
        other.add_check(&cheaper, &simulated, drift);
        assert_eq!(differs(&other), 1);
        let check = result.spot_check.unwrap();
        let mean =
            simulated.iter().map(|frame| frame.power.0).sum::<f64>() / simulated.len() as f64;
        assert!((check.recorded_mean_power_w.0 - mean).abs() < 1e-9);
        assert!(
            (check.mean_power_w.0 - 0.2 - check.recorded_mean_power_w.0).abs() < 1e-6,
            "{check:?}"
        );
    }

    #[test]
    fn a_failure_and_an_interruption_end_a_real_play() {
        let play = |renderer: &mut Fake, most: usize| {
            let mut policies: Vec<Box<dyn Policy>> = vec![Box::new(Fixed(space().lowest()))];
            let on_frame = &mut |progress: &Progress<'_>| {
                if progress.done == most {
                    ControlFlow::Break(())
                } else {
                    ControlFlow::Continue(())
                }
            };
            play_for_real(renderer, &path(), space().highest(), &mut policies, on_frame)
                .err()
                .unwrap()
        };
        let broken = play(&mut Fake { broken_at: Some(13), ..Fake::default() }, 99);
        assert_eq!(broken.to_string(), "broken");
        assert!(matches!(play(&mut Fake::default(), 25), PipelineError::Interrupted));
    }
}
