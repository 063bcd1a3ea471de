//! A frame renderer whose power and error are formulas, for tests.

use std::ops::ControlFlow;

use frugal_core::control::ControlSettings;
use frugal_core::frontier::{
    Bounds, Capture, CostPoint, Frontier, FrontierMap, FrontierPoint, SceneIdentity, Thresholds,
};
use frugal_core::knobs::{Knob, KnobLevels, KnobSpace};
use frugal_core::power::{MeterInfo, Provenance};
use frugal_core::testing;
use frugal_core::units::Watts;
use frugal_search::journal::{Existing, Journal, JournalHeader};
use frugal_trace::metrics::Picture;
use glam::{Quat, Vec3};

use super::{
    Baselines, BudgetRequest, EvaluationResult, PathPlan, PathRecord, Pose, Trial,
    settings_to_record,
};
use crate::stage::{FrameRenderer, RenderedFrame};

/// Power: 1 W + 0.5 W, 0.4 W and 0.2 W for each level of the three knobs, + 0.01 W for each metre
/// along X. Images are uniformly grey: 200, minus 10 for each missing level.
#[derive(Default)]
pub(crate) struct Fake {
    /// Names of all runs so far.
    pub(crate) runs: Vec<String>,
    /// Additional watts of each run over the one before.
    pub(crate) drift: f64,
    /// The frame, counted over all runs, whose power is NaN.
    pub(crate) broken_at: Option<usize>,
    /// Frames rendered over all runs.
    pub(crate) frames: usize,
}

pub(crate) fn space() -> KnobSpace {
    KnobSpace::new(vec![
        Knob::new("gi_vpl_count", [0.0, 32.0, 64.0]),
        Knob::labelled(
            "resolution_scale",
            [(0.5, "50%"), (0.6, "60%"), (0.7, "70%"), (0.8, "80%"), (0.9, "90%"), (1.0, "100%")],
        ),
        Knob::labelled("antialiasing", [(0.0, "off"), (1.0, "FXAA")]),
    ])
    .unwrap()
}

pub(crate) fn meter() -> MeterInfo {
    MeterInfo {
        name: "formula".into(),
        provenance: Provenance::Modelled,
        description: "a formula over the levels".into(),
    }
}

pub(crate) fn path() -> PathPlan {
    PathPlan::sample("tour", 2.0, 5.0, |time| Pose {
        position: Vec3::X * time as f32,
        rotation: Quat::IDENTITY,
    })
    .unwrap()
}

/// Power at x = 0 without drift.
pub(crate) fn power(settings: KnobLevels) -> f64 {
    1.0 + 0.5 * settings.level(0) as f64
        + 0.4 * settings.level(1) as f64
        + 0.2 * settings.level(2) as f64
}

/// 1 − SSIM of two uniform greys.
pub(crate) fn error(settings: KnobLevels) -> f64 {
    let (a, b) = (200.0, f64::from(grey(settings)));
    1.0 - (2.0 * a * b + 6.5025) / (a * a + b * b + 6.5025)
}

/// The map of these costs: one frontier everywhere.
pub(crate) fn map(space: KnobSpace) -> FrontierMap {
    let point = |settings| FrontierPoint {
        settings,
        cost: CostPoint::new(power(settings), error(settings)),
    };
    let shared = Frontier::from_points(space.iter().map(point));
    FrontierMap {
        scene: SceneIdentity { name: "fake".into(), fingerprint: "00ff".into() },
        capture: Capture {
            size: [16, 12],
            frames_per_second: 5.0,
            vertical_fov: 60.0,
            exposure_ev100: 12.0,
        },
        meter: meter(),
        thresholds: Thresholds { power_w: 0.1, error: 0.001 },
        seed: 0,
        knobs: space,
        bounds: Bounds { min: [0.0; 3], max: [4.0; 3] },
        octree: testing::cube(vec![shared.clone()]),
        shared,
        ..testing::map(0)
    }
}

/// A record of the path for a comparison.
pub(crate) fn recorded(map: &FrontierMap, baselines: Baselines) -> PathRecord {
    let folder = tempfile::tempdir().unwrap();
    let (file, header) = (folder.path().join("journal"), JournalHeader::default());
    let (mut journal, _) = Journal::open(&file, &header, Existing::Refuse).unwrap();
    let mut record = PathRecord::restore(&path(), &map.knobs, &[]);
    let settings = settings_to_record(map, baselines);
    record
        .extend(&mut [Fake::default()], &settings, &mut journal, &mut |_| ControlFlow::Continue(()))
        .unwrap();
    record
}

/// Conditions of a comparison.
pub(crate) fn trial<'a>(
    record: &'a PathRecord,
    map: &'a FrontierMap,
    baselines: Baselines,
) -> Trial<'a> {
    Trial {
        scene: "court.scene.ron",
        record,
        map,
        lens: (1.0, 4.0 / 3.0),
        size: [16, 12],
        meter: &map.meter,
        control: ControlSettings::default(),
        baselines,
    }
}

/// A quick comparison under a budget.
pub(crate) fn judged(power: Option<&str>, error: Option<f64>) -> EvaluationResult {
    let map = map(space());
    let record = recorded(&map, Baselines::Quick);
    let budget = BudgetRequest { power: power.map(|text| text.parse().unwrap()), error };
    trial(&record, &map, Baselines::Quick).judge(&budget)
}

fn grey(settings: KnobLevels) -> u8 {
    let levels = (0..3).map(|knob| settings.level(knob) as u8).sum::<u8>();
    200 - 10 * (8 - levels)
}

impl FrameRenderer for Fake {
    type Error = std::fmt::Error;

    fn begin_run(&mut self, name: &str, _: &Pose, _: KnobLevels) -> Result<(), Self::Error> {
        self.runs.push(name.to_owned());
        Ok(())
    }

    fn render_frame(
        &mut self,
        pose: &Pose,
        settings: KnobLevels,
    ) -> Result<RenderedFrame, Self::Error> {
        let mut watts = power(settings)
            + 0.01 * f64::from(pose.position.x)
            + self.drift * (self.runs.len() - 1) as f64;
        if self.broken_at == Some(self.frames) {
            watts = f64::NAN;
        }
        self.frames += 1;
        Ok(RenderedFrame {
            picture: Picture::from_fn(16, 12, |_, _| [grey(settings); 3]),
            power: Watts(watts),
        })
    }
}
