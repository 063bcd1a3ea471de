//! Recording: the whole path with every setting, by one renderer or several side by side.

use std::iter;
use std::ops::ControlFlow;

use frugal_core::frontier::CostPoint;
use frugal_core::knobs::{KnobLevels, KnobSpace};
use frugal_search::evaluate::{Fixed, FrameRecord, PathPlan, PathRecord};
use frugal_search::journal::{Journal, JournalError, cost_record};
use frugal_search::pipeline::{PipelineError, Progress};
use frugal_trace::metrics::Picture;

use super::{Against, play};
use crate::stage::{FrameRenderer, side_by_side};

/// Renders the whole path with each of `settings` that is not recorded yet, and stores each
/// frame's cost. Several renderers play different settings side by side.
///
/// The best settings are rendered first: their images are the references. Their own cost is that of
/// another run, so that what differs between two runs counts for them as for all others.
///
/// # Errors
/// When a frame renderer fails, the journal cannot be written, or `on_frame` breaks.
pub(crate) fn extend<P: FrameRenderer + Send>(
    record: &mut PathRecord,
    renderers: &mut [P],
    settings: &[KnobLevels],
    journal: &mut Journal,
    on_frame: &mut dyn FnMut(&Progress<'_>) -> ControlFlow<()>,
) -> Result<(), PipelineError> {
    let PathRecord { path, space, table } = record;
    let best = space.canonical(space.highest());
    let mut missing = space.canonical_once(iter::once(best).chain(settings.iter().copied()));
    missing.retain(|settings| table.column(*settings).is_none());
    let Some(first) = renderers.first_mut().filter(|_| !missing.is_empty()) else {
        return Ok(());
    };
    let total = (1 + missing.len()) * path.poses().len();
    let mut done = 0;
    let mut told = |settings: KnobLevels| {
        done += 1;
        on_frame(&Progress { stage: &space.describe(settings), done, total })
    };
    let mut keep = |settings: KnobLevels, series: Vec<FrameRecord>| {
        for (frame, FrameRecord { power, error, .. }) in series.into_iter().enumerate() {
            let cost = CostPoint::new(power.0, error);
            let question = format!("frame {:x} {frame:x}", settings.bits());
            journal.append(&cost_record(&question, cost))?;
            table.set(frame, settings, cost);
        }
        Ok::<_, JournalError>(())
    };
    let mut references: Vec<Picture> = Vec::new();
    constant(first, (path, space), best, Against::Collect(&mut references), &mut || told(best))?;

    let (path, space) = (&*path, &*space);
    let mut result = Ok(());
    side_by_side(
        renderers,
        &missing,
        |renderer, settings, tell| {
            let against = Against::Compare(&references);
            let on_frame = &mut || tell((*settings, None));
            let series = constant(renderer, (path, space), *settings, against, on_frame);
            let has_ended = series.is_err();
            let told = tell((*settings, Some(series)));
            if has_ended { ControlFlow::Break(()) } else { told }
        },
        |(settings, played)| {
            let now = match played {
                None if told(settings).is_break() => Err(PipelineError::Interrupted),
                None => Ok(()),
                Some(series) => series.and_then(|series| Ok(keep(settings, series)?)),
            };
            let flow = if now.is_ok() { ControlFlow::Continue(()) } else { ControlFlow::Break(()) };
            if result.is_ok() {
                result = now;
            }
            flow
        },
    );
    result
}

/// Plays a path with the same settings throughout.
fn constant(
    renderer: &mut impl FrameRenderer,
    (path, space): (&PathPlan, &KnobSpace),
    settings: KnobLevels,
    against: Against<'_>,
    on_frame: &mut dyn FnMut() -> ControlFlow<()>,
) -> Result<Vec<FrameRecord>, PipelineError> {
    let run = space.describe(settings);
    play(renderer, path, &run, &mut Fixed(settings), against, on_frame)
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use frugal_search::journal::{Existing, JournalHeader};
    use frugal_search::testing::formula::{path, space};

    use super::*;
    use crate::evaluate::testing::Fake;

    #[test]
    fn an_interrupted_record_resumes_with_the_missing_settings() {
        let (low, high) = (space().canonical(space().lowest()), space().highest());
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("journal");
        let (mut journal, _) =
            Journal::open(&file, &JournalHeader::default(), Existing::Refuse).expect("a journal");
        let mut record = PathRecord::restore(&path(), &space(), &[]);
        let mut frames = 0;
        let stopped =
            extend(&mut record, &mut [Fake::default()], &[low], &mut journal, &mut |_| {
                frames += 1;
                if frames == 25 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            });
        assert!(matches!(stopped, Err(PipelineError::Interrupted)));
        drop(journal);
        let (mut journal, lines) =
            Journal::open(&file, &JournalHeader::default(), Existing::Resume).expect("resumes");
        let mut again = PathRecord::restore(&path(), &space(), &lines);
        assert_eq!(again.table.settings(), [high]);
        extend(&mut again, &mut [Fake::default()], &[low], &mut journal, &mut |_| {
            ControlFlow::Continue(())
        })
        .expect("plays");
        assert!((0..2).all(|column| again.table.is_complete(column)));
        assert_eq!(again.table.settings(), [high, low]);
    }

    #[test]
    fn a_failure_of_one_renderer_ends_all_and_keeps_whole_runs() {
        let all: Vec<KnobLevels> = space().iter().collect();
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("journal");
        let (mut journal, _) =
            Journal::open(&file, &JournalHeader::default(), Existing::Refuse).expect("a journal");
        let mut record = PathRecord::restore(&path(), &space(), &[]);
        let broken = Fake { broken_at: Some(25), ..Fake::default() };
        // So slow that it cannot do all before the other breaks.
        let slow = Fake { pause: Duration::from_millis(2), ..Fake::default() };
        let failed = extend(&mut record, &mut [slow, broken], &all, &mut journal, &mut |_| {
            ControlFlow::Continue(())
        });
        assert!(matches!(failed, Err(PipelineError::Measure(_))));
        let kept = record.table.settings().len();
        assert!((2..all.len()).contains(&kept), "{kept} of {}", all.len());
        assert!((0..kept).all(|column| record.table.is_complete(column)));
    }

    #[test]
    fn constants_cost_the_same_simulated_and_rendered() {
        let (low, high) = (space().canonical(space().lowest()), space().highest());
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("journal");
        let (mut journal, _) =
            Journal::open(&file, &JournalHeader::default(), Existing::Refuse).expect("a journal");
        let mut record = PathRecord::restore(&path(), &space(), &[]);
        let mut renderers = [Fake::default(), Fake::default(), Fake::default()];
        extend(&mut record, &mut renderers, &[low, high, low], &mut journal, &mut |_| {
            ControlFlow::Continue(())
        })
        .expect("plays");
        let recorded = record.table.settings();
        assert!(recorded.len() == 2 && recorded.contains(&high) && recorded.contains(&low));
        for settings in [low, high] {
            let mut references = Vec::new();
            let mut renderer = Fake::default();
            let mut run = |settings, against: Against<'_>| {
                play(&mut renderer, &path(), "run", &mut Fixed(settings), against, &mut || {
                    ControlFlow::Continue(())
                })
                .expect("plays")
            };
            run(high, Against::Collect(&mut references));
            let real = run(settings, Against::Compare(&references));
            assert_eq!(record.simulate(&mut Fixed(settings)), real);
        }
    }

    #[test]
    fn what_differs_between_two_runs_counts_for_the_best_settings_too() {
        let high = space().highest();
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("journal");
        let (mut journal, _) =
            Journal::open(&file, &JournalHeader::default(), Existing::Refuse).expect("a journal");
        let mut record = PathRecord::restore(&path(), &space(), &[]);
        let mut unsteady = [Fake { brighter: 10, ..Fake::default() }];
        extend(&mut record, &mut unsteady, &[], &mut journal, &mut |_| ControlFlow::Continue(()))
            .expect("plays");
        let cost = record.table.get(0, high).expect("recorded");
        assert!(cost.error > 1e-6, "{cost:?}");
    }
}
