//! The pipeline on a synthetic renderer: kills, shards, time limits, and quality of the map.

use std::ops::ControlFlow;
use std::time::Duration;

use frugal_core::frontier::CostPoint;
use frugal_trace::scene::CameraPose;
use glam::{Quat, Vec3};

use super::*;
use crate::journal::{Existing, Journal, JournalHeader};
use crate::table::{Batch, Measure, Measured};
use crate::testing::{
    BOUNDS, Formula, Run, cost, layout, one_by_one, run_once, run_with, space, whole,
};

/// Hands over the costs of several processes, the later batches first.
struct SideBySide(Formula);

impl Measure for SideBySide {
    fn measure_all(
        &mut self,
        batches: &[Batch],
        done: &mut dyn FnMut(Measured) -> ControlFlow<()>,
    ) -> Result<(), String> {
        let mut after_the_end = 2;
        for (batch, Batch { clip, settings }) in batches.iter().enumerate().rev() {
            for settings in settings.iter().rev().copied() {
                let cost = self.0.measure(clip, settings);
                // The other processes finish what they are at.
                if done(Measured { batch, settings, cost }).is_break() {
                    after_the_end -= 1;
                }
                if after_the_end == 0 {
                    return Ok(());
                }
            }
        }
        Ok(())
    }
}

/// The results that must not depend on interruptions and shards.
fn product(outcome: &Outcome) -> (Fitted, ErrorRates, Vec<KnobLevels>, [usize; 2], usize) {
    (
        outcome.fitted.clone(),
        outcome.error_rates.clone(),
        outcome.pool.clone(),
        outcome.cameras,
        outcome.renderings,
    )
}

#[test]
fn most_cameras_render_the_anchors_alone() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("journal");
    let outcome = run_once(&whole(&file)).0.expect("a map");
    let text = std::fs::read_to_string(&file).expect("a journal");
    let lines = |start: &str| text.lines().filter(|line| line.starts_with(start)).count();
    let Extent { full, anchors, block, .. } = Extent::WHOLE;
    let of_camera: Vec<usize> =
        (0..40).map(|camera| lines(&format!("render t {camera:x} "))).collect();
    let few = of_camera.iter().filter(|count| **count <= anchors).count();
    assert!((40 - full - block..=40 - full).contains(&few), "{of_camera:?}");
    assert!(of_camera.iter().all(|count| *count > 0), "{of_camera:?}");
    // All cameras take part in the map, with all settings.
    assert_eq!((outcome.cameras, outcome.training.rows()), ([40, 30], 40));
    let columns = 0..outcome.training.settings().len();
    assert!(columns.into_iter().all(|column| outcome.training.is_complete(column)));
}

#[test]
fn a_run_that_is_killed_again_and_again_ends_with_the_same_map() {
    let folder = tempfile::tempdir().expect("a folder");
    let (outcome, all) = run_once(&whole(&folder.path().join("whole")));
    let reference = outcome.expect("a map");
    assert!(
        reference.screening.without_effect == [4],
        "the idle knob: {:?}",
        reference.screening.without_effect
    );
    assert_eq!(reference.cameras, [40, 30]);
    let file = folder.path().join("killed");
    let mut made = 0;
    for patience in (1..).map(|round: usize| 1 + round * 7 % 23) {
        let (outcome, renderings) = run_once(&Run { patience, ..whole(&file) });
        made += renderings;
        // Every other time the last record is truncated, as by a kill.
        let length = std::fs::metadata(&file).expect("a journal").len();
        match outcome {
            Ok(outcome) => {
                assert_eq!(product(&outcome), product(&reference));
                break;
            }
            Err(PipelineError::Interrupted) if patience % 2 == 0 => {
                // It may be a choice of settings, which is no rendering.
                let text = std::fs::read_to_string(&file).expect("a journal");
                let last = text.lines().next_back().expect("lines");
                made -= usize::from(last.starts_with("render "));
                std::fs::OpenOptions::new()
                    .write(true)
                    .open(&file)
                    .expect("opens")
                    .set_len(length - 3)
                    .expect("shortened");
            }
            Err(PipelineError::Interrupted) => {}
            Err(error) => panic!("{error}"),
        }
    }
    assert_eq!(made, all, "kept renderings are not repeated");
}

#[test]
fn renderings_in_any_order_make_the_same_map_and_none_is_made_twice() {
    let folder = tempfile::tempdir().expect("a folder");
    let (outcome, all) = run_once(&whole(&folder.path().join("whole")));
    let reference = product(&outcome.expect("a map"));
    let file = folder.path().join("side by side");
    let mut measure = SideBySide(Formula { space: space(), renderings: 0 });
    let outcome = loop {
        match run_with(&mut measure, &Run { patience: 100, ..whole(&file) }) {
            Ok(outcome) => break outcome,
            Err(PipelineError::Interrupted) => {}
            Err(error) => panic!("{error}"),
        }
    };
    assert_eq!(product(&outcome), reference);
    assert_eq!(measure.0.renderings, all);
}

#[test]
fn shards_that_read_each_other_s_journals_make_the_same_map() {
    let folder = tempfile::tempdir().expect("a folder");
    let reference = run_once(&whole(&folder.path().join("whole"))).0.expect("a map");
    for count in [2, 5] {
        let files: Vec<_> =
            (0..count).map(|index| folder.path().join(format!("{index}-of-{count}"))).collect();
        let mut renderings = vec![0; count];
        let outcome = loop {
            let mut last = None;
            for (index, file) in files.iter().enumerate() {
                let others: Vec<_> = files
                    .iter()
                    .filter(|other| *other != file && other.exists())
                    .cloned()
                    .collect();
                let shard = (index, count);
                let (outcome, made) = run_once(&Run { shard, others: &others, ..whole(file) });
                renderings[index] += made;
                match outcome {
                    Ok(outcome) => last = Some(outcome),
                    Err(PipelineError::NeedsOthers) => {}
                    Err(error) => panic!("{error}"),
                }
            }
            if let Some(outcome) = last {
                break outcome;
            }
        };
        assert_eq!(product(&outcome), product(&reference));
        let total: usize = renderings.iter().sum();
        assert!(
            renderings.iter().all(|share| *share * count > total / 2),
            "work is shared: {renderings:?}"
        );
    }
}

#[test]
fn the_map_dominates_the_best_constant_where_views_differ() {
    let folder = tempfile::tempdir().expect("a folder");
    let (outcome, renderings) = run_once(&whole(&folder.path().join("journal")));
    let outcome = outcome.expect("a map");
    assert!(
        outcome.fitted.report.octree_loss < outcome.fitted.report.shared_loss,
        "{:?}",
        outcome.fitted.report
    );
    assert!(outcome.cost_error < 0.02, "{}", outcome.cost_error);
    assert!(
        outcome.error_rates.is_sound() && outcome.error_rates.0.len() > 6,
        "{:?}",
        outcome.error_rates
    );
    assert!(renderings < 70 * 45, "{renderings}");
    let space = space();
    assert!(
        outcome.pool.contains(&space.canonical(space.highest()))
            && outcome.pool.contains(&space.canonical(space.lowest()))
    );
    // The pool is within 10 % of the best of all combinations, at a typical exchange rate, at fresh
    // cameras.
    for x in [1.0, 3.5, 4.5, 7.0] {
        let pose = CameraPose { position: Vec3::new(x, 3.3, 2.2), rotation: Quat::IDENTITY };
        let value = |settings: KnobLevels| {
            let cost = cost(&space, &pose, settings);
            cost.power.0 + 200.0 * cost.error
        };
        let least = |all: &mut dyn Iterator<Item = KnobLevels>| {
            all.map(value).fold(f64::INFINITY, f64::min)
        };
        let (pool, all) = (least(&mut outcome.pool.iter().copied()), least(&mut space.iter()));
        assert!(pool < 1.1 * all, "{pool} against {all} at x = {x}");
    }
}

#[test]
fn a_time_limit_ends_with_a_map_whenever_it_strikes() {
    let folder = tempfile::tempdir().expect("a folder");
    for (number, limit) in [Duration::ZERO, Duration::from_micros(300), Duration::from_secs(3600)]
        .into_iter()
        .enumerate()
    {
        let file = folder.path().join(number.to_string());
        let (outcome, _) = run_once(&Run { limit: Some(limit), ..whole(&file) });
        let outcome = outcome.expect("a map");
        assert!(!outcome.fitted.shared.is_empty() && outcome.fitted.octree.validate() == Ok(()));
        // On resuming, the decisions of the clock are kept.
        let again = run_once(&Run { limit: Some(Duration::from_secs(9)), ..whole(&file) })
            .0
            .expect("a map");
        assert_eq!(product(&again), product(&outcome));
    }
}

#[test]
fn a_resumed_run_has_the_time_that_is_left() {
    /// Takes a millisecond for each rendering.
    struct Slow(Formula);
    impl Measure for Slow {
        fn measure_all(
            &mut self,
            batches: &[Batch],
            done: &mut dyn FnMut(Measured) -> ControlFlow<()>,
        ) -> Result<(), String> {
            one_by_one(batches, done, |clip, settings| {
                std::thread::sleep(Duration::from_millis(1));
                self.0.measure(clip, settings)
            })
        }
    }
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("journal");
    let made = std::cell::Cell::new(0);
    let run = |patience: usize, limit: f64| {
        let mut slow = Slow(Formula { space: space(), renderings: 0 });
        let limit = Some(Duration::from_secs_f64(limit));
        let outcome = run_with(&mut slow, &Run { patience, limit, ..whole(&file) });
        made.set(made.get() + slow.0.renderings);
        outcome
    };
    // Stopped every 20 renderings: a session alone never takes as long as the limit.
    let limit = 0.4;
    let mut sessions = 0;
    let outcome = loop {
        sessions += 1;
        match run(20, limit) {
            Err(PipelineError::Interrupted) => assert!(sessions < 60, "the limit never strikes"),
            other => break other.expect("a map"),
        }
    };
    assert!(sessions > 1, "{sessions}");
    assert!(outcome.cameras[0] < 40, "{:?} in {} renderings", outcome.cameras, made.get());

    // The first decision of a session knows how long a rendering takes: there is no time for 1,500.
    let _ = std::fs::remove_file(&file);
    while let Err(PipelineError::Interrupted) = run(1, 1.0) {
        let text = std::fs::read_to_string(&file).expect("a journal");
        if text.contains("decide ") {
            assert!(text.contains("decide 1500 renderings 0"), "{text}");
            return;
        }
    }
    panic!("no decision was made");
}

#[test]
fn a_search_is_as_large_as_its_time_allows() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("journal");
    let run = |limit: Option<Duration>| {
        let _ = std::fs::remove_file(&file);
        let outcome = run_once(&Run { limit, ..whole(&file) }).0.expect("a map");
        let text = std::fs::read_to_string(&file).expect("a journal");
        (outcome.pool.len(), text.lines().filter(|line| line.contains(" renderings ")).count())
    };
    let (whole, questions) = run(Some(Duration::from_secs(3600)));
    let (shortest, more_questions) = run(Some(Duration::ZERO));
    assert!(shortest <= 8 && whole > 8, "{shortest} and {whole} settings");
    // Asked once and never again on resuming; without a limit not at all.
    assert_eq!((questions, more_questions, run(None).1), (1, 2, 0));
}

#[test]
fn a_knob_that_acts_elsewhere_than_at_the_only_pilot_is_searched() {
    /// The idle knob acts in the half of the scene where the first pilot is not.
    struct Elsewhere(Formula, Option<bool>);
    impl Measure for Elsewhere {
        fn measure_all(
            &mut self,
            batches: &[Batch],
            done: &mut dyn FnMut(Measured) -> ControlFlow<()>,
        ) -> Result<(), String> {
            let Self(formula, first) = self;
            one_by_one(batches, done, |clip, settings| {
                let is_left = clip.last().is_some_and(|pose| pose.position.x < 4.0);
                let acts = *first.get_or_insert(is_left) != is_left;
                let lowered = if acts { 2 - settings.level(4) } else { 0 };
                let cost = formula.measure(clip, settings);
                CostPoint::new(cost.power.0, cost.error + 0.02 * lowered as f64)
            })
        }
    }
    let folder = tempfile::tempdir().expect("a folder");
    let [file, other] = ["idle", "acting"].map(|name| folder.path().join(name));
    let shortest = Run { limit: Some(Duration::ZERO), ..whole(&file) };
    let (idle, all) = run_once(&shortest);
    let mut measure = Elsewhere(Formula { space: space(), renderings: 0 }, None);
    let acting = run_with(&mut measure, &Run { journal: &other, ..shortest }).expect("a map");
    assert_eq!(idle.expect("a map").screening.without_effect, [4]);
    assert!(acting.screening.without_effect.is_empty() && acting.screening.effects[4][0] > 0.01);
    // One more rendering at each other pilot, where all knobs without effect are lowered at once.
    assert!(measure.0.renderings <= all + 5, "{} and {all}", measure.0.renderings);
}

#[test]
fn without_cameras_there_is_one_clear_error() {
    let folder = tempfile::tempdir().expect("a folder");
    let space = space();
    let mut formula = Formula { space: space.clone(), renderings: 0 };
    let subject = Subject {
        space: &space,
        layout: &layout(),
        bounds: &BOUNDS,
        lens: (1.0, 1.5),
        idle: Watts(0.0),
    };
    let setup = Setup {
        measure: &mut formula,
        journal: Journal::open(
            &folder.path().join("journal"),
            &JournalHeader::default(),
            Existing::Resume,
        )
        .expect("a journal"),
        cameras: &CameraSet::default(),
        clip: (2, 15.0),
        shard: (0, 1),
        limit: None,
        report: &mut |_| ControlFlow::Continue(()),
    };
    let error =
        run(&subject, &PipelineConfig::default(), setup).expect_err("no cameras").to_string();
    assert!(error.contains("bounds and paths"), "{error}");
}
