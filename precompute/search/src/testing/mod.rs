//! The plugin's knobs, a synthetic renderer with a finished search on it, and records as data, for tests.

pub mod formula;
mod records;

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Duration;

use frugal_core::frontier::{Bounds, CostPoint};
use frugal_core::knobs::{Knob, KnobLevels, KnobSpace};
use frugal_core::units::Watts;
use frugal_trace::scene::CameraPose;
use glam::{Quat, Vec3};

use crate::cameras::{CameraSet, MovingCamera};
use crate::cost::{FrameLayout, Work, work_names};
use crate::journal::{Existing, Journal, JournalHeader, records_of};
use crate::pipeline::{Outcome, PipelineConfig, PipelineError, Progress, Setup, Subject, run};
use crate::table::{Batch, Measure, Measured};

pub use records::{RecordFile, read_records};

/// The plugin's knobs, all of them.
pub fn every_knob() -> KnobSpace {
    KnobSpace::new(plugin_knobs()).expect("a valid space")
}

/// The plugin's knobs without those that a scene has to opt in to.
pub fn knobs() -> KnobSpace {
    let is_common = |knob: &Knob| !["gi_bounces", "frame_rate"].contains(&knob.name.as_str());
    KnobSpace::new(plugin_knobs().into_iter().filter(is_common).collect()).expect("a valid space")
}

fn plugin_knobs() -> Vec<Knob> {
    let share = |percent: u32| (f64::from(percent) / 100.0, format!("{percent}%"));
    let [off, low, medium, high] = [(0.0, "off"), (0.25, "low"), (0.5, "medium"), (1.0, "high")];
    vec![
        Knob::new("gi_vpl_count", [0.0, 64.0, 128.0, 256.0, 512.0, 1024.0, 2048.0, 4096.0]),
        Knob::labelled(
            "gi_pixel_fraction",
            [(0.0625, "1/16"), (0.25, "1/4"), (0.5, "1/2"), (1.0, "1/1")],
        )
        .needing("gi_vpl_count", 1),
        Knob::labelled("gi_interleave", [(8.0, "8x8"), (4.0, "4x4"), (2.0, "2x2")])
            .needing("gi_vpl_count", 1),
        Knob::labelled(
            "gi_visibility",
            [(0.0, "none"), (1.0, "cached"), (2.0, "coarse"), (8.0, "fine")],
        )
        .needing("gi_vpl_count", 1),
        Knob::new("gi_environment_samples", [0.0, 8.0, 16.0, 32.0]).needing("gi_visibility", 1),
        Knob::labelled("gi_bounces", [(1.0, "1"), (2.0, "2"), (3.0, "3"), (9.0, "all")])
            .needing("gi_visibility", 1),
        Knob::new("rsm_resolution", [64.0, 128.0, 256.0]).needing("gi_vpl_count", 1),
        Knob::labelled("gi_refresh_period", [(0.125, "8"), (0.25, "4"), (0.5, "2"), (1.0, "1")])
            .needing("gi_vpl_count", 1),
        Knob::new("shadow_map_resolution", [256.0, 512.0, 1024.0, 2048.0]),
        Knob::new("shadow_cascades", [1.0, 2.0, 3.0, 4.0]),
        Knob::labelled(
            "ambient_occlusion",
            [(0.0, "off"), (4.0, "4"), (8.0, "8"), (16.0, "16"), (32.0, "32")],
        ),
        Knob::labelled(
            "antialiasing",
            [
                (0.0, "off"),
                (1.0, "FXAA"),
                (4.0, "SMAA 4"),
                (8.0, "SMAA 8"),
                (16.0, "SMAA 16"),
                (32.0, "SMAA 32"),
            ],
        ),
        Knob::labelled("texture_detail", [(-2.0, "+2"), (-1.0, "+1"), (-0.5, "+0.5"), (0.0, "0")]),
        Knob::labelled("post_processing", [off, low, medium, high]),
        Knob::labelled("resolution_scale", [50, 60, 70, 80, 90, 100].map(share)),
        Knob::labelled("effects", [off, low, medium, high]),
        Knob::labelled("view_distance", [25, 50, 75, 100].map(share)),
        Knob::labelled(
            "frame_rate",
            [
                (30.0, "30"),
                (40.0, "40"),
                (60.0, "60"),
                (90.0, "90"),
                (120.0, "120"),
                (1e6, "unlimited"),
            ],
        ),
    ]
}

pub(crate) const BOUNDS: Bounds = Bounds { min: [0.0; 3], max: [8.0; 3] };

pub(crate) fn space() -> KnobSpace {
    let levels = |count: u32| (0..count).map(f64::from);
    KnobSpace::new(vec![
        Knob::new("gi_vpl_count", [0.0, 64.0, 256.0, 1024.0, 4096.0]),
        Knob::new("gi_pixel_fraction", [0.0625, 0.25, 0.5, 1.0]).needing("gi_vpl_count", 1),
        Knob::new("shadow_map_resolution", [256.0, 512.0, 1024.0, 2048.0]),
        Knob::new("fur", levels(3)),
        Knob::new("idle", levels(3)),
    ])
    .expect("a valid space")
}

pub(crate) fn layout() -> FrameLayout {
    FrameLayout { size: [160, 90], maps: 1, point_lights: 0, has_sky: false }
}

/// Power follows work; indirect light matters where x < 4, shadows elsewhere.
pub(crate) struct Formula {
    pub(crate) space: KnobSpace,
    pub(crate) renderings: usize,
}

pub(crate) fn cost(space: &KnobSpace, pose: &CameraPose, settings: KnobLevels) -> CostPoint {
    let settings = space.canonical(settings);
    let names = work_names(space);
    let price = |name: &str| match name {
        "frame" => 1.0,
        "pairs" => 4e-7,
        "rays" => 3e-5,
        "gathered pixels" => 5e-5,
        "shadow texels" => 2e-7,
        "fur=1 pixels" => 2e-5,
        "fur=2 pixels" => 6e-5,
        _ => 0.0,
    };
    let power: f64 = Work::of(space, settings, &layout())
        .0
        .iter()
        .zip(&names)
        .map(|(work, name)| work * price(name))
        .sum();
    let missing = |knob: usize| {
        let top = space.knobs()[knob].levels.len() - 1;
        (top - settings.level(knob)) as f64 / top as f64
    };
    let dark = if pose.position.x < 4.0 { 3.0 } else { 0.5 };
    let indirect = if settings.level(0) == 0 {
        0.2
    } else {
        0.05 * missing(0).powi(2) + 0.02 * missing(1).powi(2)
    };
    CostPoint::new(
        power * if pose.position.x < 4.0 { 1.1 } else { 0.9 },
        dark * indirect + 0.03 / dark * missing(2).powi(2) + 0.01 * missing(3),
    )
}

impl Formula {
    pub(crate) fn measure(&mut self, clip: &[CameraPose], settings: KnobLevels) -> CostPoint {
        self.renderings += 1;
        cost(&self.space, clip.last().expect("a pose"), settings)
    }
}

impl Measure for Formula {
    fn measure_all(
        &mut self,
        batches: &[Batch],
        done: &mut dyn FnMut(Measured) -> ControlFlow<()>,
    ) -> Result<(), String> {
        one_by_one(batches, done, |clip, settings| self.measure(clip, settings))
    }
}

/// Measures batches in order.
pub(crate) fn one_by_one(
    batches: &[Batch],
    done: &mut dyn FnMut(Measured) -> ControlFlow<()>,
    mut measure: impl FnMut(&[CameraPose], KnobLevels) -> CostPoint,
) -> Result<(), String> {
    for (batch, Batch { clip, settings }) in batches.iter().enumerate() {
        for settings in settings.iter().copied() {
            let cost = measure(clip, settings);
            if done(Measured { batch, settings, cost }).is_break() {
                return Ok(());
            }
        }
    }
    Ok(())
}

pub(crate) fn cameras() -> CameraSet {
    let camera = |index: usize| {
        let unit = |prime: usize| (index * prime % 101) as f32 / 101.0 * 7.8 + 0.1;
        let pose = CameraPose {
            position: Vec3::new(unit(37), unit(53), unit(71)),
            rotation: Quat::from_rotation_y(index as f32),
        };
        MovingCamera { pose, velocity: Vec3::ZERO, turn: Vec3::ZERO, group: index as u32 }
    };
    CameraSet {
        training: (0..40).map(camera).collect(),
        calibration: (100..130).map(camera).collect(),
    }
}

pub(crate) struct Run<'a> {
    pub(crate) journal: &'a Path,
    pub(crate) shard: (usize, usize),
    /// Journals of other shards.
    pub(crate) others: &'a [PathBuf],
    /// Number of renderings after which the run is stopped.
    pub(crate) patience: usize,
    pub(crate) limit: Option<Duration>,
}

pub(crate) fn run_once(setup: &Run<'_>) -> (Result<Outcome, PipelineError>, usize) {
    let mut formula = Formula { space: space(), renderings: 0 };
    (run_with(&mut formula, setup), formula.renderings)
}

pub(crate) fn run_with(
    measure: &mut dyn Measure,
    setup: &Run<'_>,
) -> Result<Outcome, PipelineError> {
    let (space, cameras) = (space(), cameras());
    let header = JournalHeader::default().with("seed", 0);
    let (journal, mut records) =
        Journal::open(setup.journal, &header, Existing::Resume).expect("a journal");
    for other in setup.others {
        records.extend(records_of(other, &header).expect("one run's"));
    }
    let mut left = setup.patience;
    let mut report = |_: &Progress<'_>| {
        left = left.saturating_sub(1);
        if left == 0 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let subject = Subject {
        space: &space,
        layout: &layout(),
        bounds: &BOUNDS,
        lens: (1.0, 1.5),
        idle: Watts(0.0),
    };
    let config = PipelineConfig::default();
    run(
        &subject,
        &config,
        Setup {
            measure,
            journal: (journal, records),
            cameras: &cameras,
            clip: (2, 15.0),
            shard: setup.shard,
            limit: setup.limit,
            report: &mut report,
        },
    )
}

/// A finished search, for tests of what is made of one.
pub fn searched() -> (KnobSpace, Bounds, CameraSet, Outcome) {
    let folder = tempfile::tempdir().expect("a folder");
    let outcome = run_once(&whole(&folder.path().join("whole"))).0.expect("a map");
    (space(), BOUNDS, cameras(), outcome)
}

pub(crate) fn whole(journal: &Path) -> Run<'_> {
    Run { journal, shard: (0, 1), others: &[], patience: usize::MAX, limit: None }
}
