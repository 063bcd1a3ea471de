//! A killed run, simulated at every byte of its journal.

use std::collections::BTreeSet;
use std::convert::Infallible;
use std::fs;

use bevy::math::Vec3;
use bevy_frugal_gi::frontier::ViewDirection;
use bevy_frugal_gi::knobs::{Knob, KnobSpace};
use bevy_frugal_gi::units::Watts;

use super::*;
use crate::search::{SearchConfig, Unwatched};
use crate::subdivide::{CameraSpace, SubdivideConfig, Subdivision, Threshold, subdivide};

/// Deterministic costs, one mode of two that is best on each side, and a refinement that changes them.
#[derive(Default)]
struct Field {
    calls: usize,
}

impl Evaluate for Field {
    type Error = Infallible;

    fn sees(&mut self, camera: SampleCamera) -> Result<bool, Infallible> {
        // One view along one edge: a small journal, so that every byte of it can be tried.
        let along_x = camera.position.y == 0.0 && camera.position.z == 0.0;
        Ok(along_x && camera.view == ViewDirection::PositiveX)
    }

    fn evaluate(&mut self, camera: SampleCamera, settings: RenderSettings) -> Result<CostPoint, Infallible> {
        self.calls += 1;
        let (quality, mode) = (settings.level(0) as f64, settings.level(1));
        let wasted = if mode == usize::from(camera.position.x > 0.5) { 0.0 } else { 0.5 };
        Ok(CostPoint::new(1.0 + quality + wasted, (1.0 - quality) / 10.0))
    }

    fn refine(&mut self, _: SampleCamera, _: RenderSettings, so_far: CostPoint) -> Result<CostPoint, Infallible> {
        self.calls += 1;
        Ok(CostPoint { power: so_far.power + Watts(0.25), ..so_far })
    }
}

fn header() -> JournalHeader {
    JournalHeader { scene: "cornell 1f".into(), knob_space: 7, capture: "320x180".into(), meter: "work".into(), seed: 3 }
}

fn map(journal: Journal) -> (Subdivision, usize) {
    let space = KnobSpace::new(vec![Knob::new("quality", [0.0, 1.0]), Knob::new("mode", [0.0, 1.0])]).expect("a valid space");
    let config = SubdivideConfig {
        levels: 1,
        power_threshold: Threshold::Absolute(Watts(0.6)),
        search: SearchConfig { seed: 3, ..SearchConfig::default() },
        ..SubdivideConfig::default()
    };
    let mut journaled = Journaled::new(Field::default(), journal);
    let cameras = CameraSpace { min: Vec3::ZERO, max: Vec3::ONE };
    let subdivision = subdivide(&space, cameras, &config, &mut journaled, &mut Unwatched).expect("a map");
    (subdivision, journaled.into_inner().calls)
}

#[test]
fn a_run_killed_at_any_byte_ends_with_the_same_map() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("run.journal");
    let (whole, calls) = map(Journal::create(&path, &header()).expect("a fresh journal"));
    assert!(whole.octree.levels == 1 && calls > 15);
    let bytes = fs::read(&path).expect("the journal");
    let mut records_seen = BTreeSet::new();
    for end in 0..=bytes.len() {
        fs::write(&path, &bytes[..end]).expect("can be written");
        let journal = Journal::resume(&path, &header()).expect("resumes anywhere");
        let known = journal.len();
        // The whole run after every record's end, and the reading of the file at every byte.
        if records_seen.insert(known) || end + 1 == bytes.len() {
            let (resumed, made) = map(journal);
            assert_eq!(resumed.octree, whole.octree, "cut at {end}");
            assert_eq!(made, calls - known, "what is recorded is not asked again");
            assert_eq!(fs::read(&path).expect("the journal"), bytes, "the journal is whole again");
        }
    }
    assert_eq!(records_seen.len(), calls + 1);
}

#[test]
fn a_changed_or_missing_byte_is_an_error_or_a_clean_continuation() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("run.journal");
    let (whole, _) = map(Journal::create(&path, &header()).expect("a fresh journal"));
    let bytes = fs::read(&path).expect("the journal");
    let first_line = bytes.iter().position(|byte| *byte == b'\n').expect("a header");
    for index in (0..bytes.len()).step_by(3) {
        let flipped: Vec<u8> = bytes.iter().enumerate().map(|(at, byte)| if at == index { byte ^ 1 } else { *byte }).collect();
        let without: Vec<u8> = bytes.iter().enumerate().filter(|(at, _)| *at != index).map(|(_, byte)| *byte).collect();
        for damaged in [flipped, without] {
            fs::write(&path, &damaged).expect("can be written");
            match Journal::resume(&path, &header()) {
                Ok(journal) => {
                    assert!(index > first_line, "a damaged header is not taken for another");
                    if index % 5 == 0 {
                        assert_eq!(map(journal).0.octree, whole.octree);
                    }
                }
                Err(JournalError::NotAJournal { .. }) => assert!(index <= first_line),
                Err(error) => panic!("{error}"),
            }
        }
    }
}

#[test]
fn a_missing_line_is_found() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("run.journal");
    map(Journal::create(&path, &header()).expect("a fresh journal"));
    let text = fs::read_to_string(&path).expect("the journal");
    let without: Vec<&str> = text.lines().enumerate().filter(|(line, _)| *line != 4).map(|(_, line)| line).collect();
    fs::write(&path, without.join("\n") + "\n").expect("can be written");
    assert_eq!(Journal::resume(&path, &header()).expect("readable").len(), 3);
}

#[test]
fn another_run_s_journal_is_refused_with_what_differs() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("run.journal");
    drop(Journal::create(&path, &header()).expect("a fresh journal"));
    let cases = [
        ("scene", JournalHeader { scene: "courtyard".into(), ..header() }),
        ("knobs", JournalHeader { knob_space: 8, ..header() }),
        ("capture", JournalHeader { capture: "640x360".into(), ..header() }),
        ("meter", JournalHeader { meter: "nvml".into(), ..header() }),
        ("seed", JournalHeader { seed: 4, ..header() }),
    ];
    for (field, other) in cases {
        let error = Journal::resume(&path, &other).expect_err("another run");
        assert!(error.to_string().contains(field) && error.to_string().contains("run.journal"), "{error}");
    }
    fs::write(&path, "something else entirely, and longer than nothing\n").expect("can be written");
    assert!(matches!(Journal::resume(&path, &header()), Err(JournalError::NotAJournal { .. })));
    assert!(Journal::create(&path, &header()).expect("starts anew").is_empty());
}

#[test]
fn two_runs_cannot_write_one_journal() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("run.journal");
    let first = Journal::create(&path, &header()).expect("a fresh journal");
    assert!(matches!(Journal::resume(&path, &header()), Err(JournalError::InUse { .. })));
    drop(first);
    assert!(Journal::resume(&path, &header()).is_ok());
}

#[test]
fn allowances_are_repeated_and_failures_are_not_recorded() {
    struct Failing;
    impl Evaluate for Failing {
        type Error = &'static str;
        fn sees(&mut self, _: SampleCamera) -> Result<bool, &'static str> {
            Ok(true)
        }
        fn evaluate(&mut self, _: SampleCamera, _: RenderSettings) -> Result<CostPoint, &'static str> {
            Err("device lost")
        }
    }
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("run.journal");
    let camera = SampleCamera { position: Vec3::ZERO, view: ViewDirection::PositiveX };
    let mut journaled = Journaled::new(Failing, Journal::create(&path, &header()).expect("a fresh journal"));
    assert!(matches!(journaled.allowance(camera, 31), Ok(31)));
    assert!(matches!(journaled.allowance(camera, 99), Ok(31)));
    let error = journaled.evaluate(camera, RenderSettings::default()).expect_err("fails");
    assert_eq!(error.to_string(), "device lost");
    drop(journaled);
    let journal = Journal::resume(&path, &header()).expect("resumes");
    assert_eq!(journal.len(), 1);
    assert!(matches!(Journaled::new(Failing, journal).allowance(camera, 5), Ok(31)));
}
