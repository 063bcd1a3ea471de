//! Power and error by formulas over the levels of three knobs: a map of them, and a record along a path.
//!
//! Power: 1 W + 0.5 W, 0.4 W and 0.2 W for each level of the three knobs, + 0.01 W for each metre along
//! X. Error: that of uniform greys, 200 minus 10 for each missing level.

use frugal_core::control::ControlSettings;
use frugal_core::frontier::{
    Bounds, Capture, CostPoint, Frontier, FrontierMap, FrontierPoint, SceneIdentity, Thresholds,
};
use frugal_core::knobs::{Knob, KnobLevels, KnobSpace};
use frugal_core::power::{MeterInfo, Provenance};
use frugal_core::testing;
use glam::{Quat, Vec3};

use crate::evaluate::{
    Baselines, BudgetRequest, EvaluationResult, PathPlan, PathRecord, Pose, Trial,
    settings_to_record,
};
use crate::table::CostTable;

/// Mean watts of the metres along the path.
pub const ALONG: f64 = 0.009;

/// The three knobs.
pub fn space() -> KnobSpace {
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

/// The meter.
pub fn meter() -> MeterInfo {
    MeterInfo {
        name: "formula".into(),
        provenance: Provenance::Modelled,
        description: "a formula over the levels".into(),
    }
}

/// Two seconds along X.
pub fn path() -> PathPlan {
    let pose = |frame: u8| Pose {
        position: Vec3::X * (f64::from(frame) / 5.0) as f32,
        rotation: Quat::IDENTITY,
    };
    PathPlan::new("tour", 5.0, (0..10).map(pose)).unwrap()
}

/// Power at x = 0 without drift.
pub fn power(settings: KnobLevels) -> f64 {
    1.0 + 0.5 * settings.level(0) as f64
        + 0.4 * settings.level(1) as f64
        + 0.2 * settings.level(2) as f64
}

/// 1 − SSIM of two uniform greys.
pub fn error(settings: KnobLevels) -> f64 {
    let (a, b) = (200.0, f64::from(grey(settings)));
    1.0 - (2.0 * a * b + 6.5025) / (a * a + b * b + 6.5025)
}

/// The map of these costs: one frontier everywhere.
pub fn map(space: KnobSpace) -> FrontierMap {
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
pub fn recorded(map: &FrontierMap, baselines: Baselines) -> PathRecord {
    let settings = settings_to_record(map, baselines, map.knobs.highest());
    record_of(path(), map.knobs.clone(), &settings)
}

/// A record of `settings` along a path along X.
pub fn record_of(path: PathPlan, space: KnobSpace, settings: &[KnobLevels]) -> PathRecord {
    let mut table = CostTable::new(path.poses().len());
    for settings in space.canonical_once([space.highest()].iter().chain(settings).copied()) {
        for (frame, pose) in path.poses().iter().enumerate() {
            let watts = power(settings) + 0.01 * f64::from(pose.position.x);
            table.set(frame, settings, CostPoint::new(watts, error(settings)));
        }
    }
    PathRecord { path, space, table }
}

/// Conditions of a comparison.
pub fn trial<'a>(record: &'a PathRecord, map: &'a FrontierMap, baselines: Baselines) -> Trial<'a> {
    Trial {
        scene: "court.scene.ron",
        record,
        map,
        lens: (1.0, 4.0 / 3.0),
        size: [16, 12],
        meter: &map.meter,
        control: ControlSettings::default(),
        baselines,
        default: map.knobs.highest(),
    }
}

/// A quick comparison under a budget.
pub fn judged(power: Option<&str>, error: Option<f64>) -> EvaluationResult {
    let map = map(space());
    let record = recorded(&map, Baselines::Quick);
    let budget = BudgetRequest {
        power: power.map(|text| text.parse().unwrap()),
        error,
        ..Default::default()
    };
    trial(&record, &map, Baselines::Quick).judge(&budget)
}

/// The grey of an image.
pub fn grey(settings: KnobLevels) -> u8 {
    let levels = (0..3).map(|knob| settings.level(knob) as u8).sum::<u8>();
    200 - 10 * (8 - levels)
}
