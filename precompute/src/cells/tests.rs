//! The whole of it, in a synthetic field.

use std::cell::Cell;
use std::collections::BTreeSet;
use std::convert::Infallible;
use std::rc::Rc;

use bevy::math::Vec3;
use bevy_frugal_gi::frontier::{
    Bounds, Capture, Corner, Correction, CostPoint, Frontier, FrontierMap, FrontierPoint, Octree, SceneIdentity, Thresholds,
};
use bevy_frugal_gi::knobs::{Knob, KnobSpace, RenderSettings};
use bevy_frugal_gi::power::{MeterInfo, Provenance};

use super::{
    Measure, Promise, RandomCameras, RemeasureConfig, Remeasured, Spread, cameras, correction, find_cells, hold_to_promise, remeasure,
};
use crate::scene::CameraPose;
use crate::search::{Monitor, Unwatched};

/// Levels of the only knob; the last is the best.
const LEVELS: u8 = 16;

fn settings(level: u8) -> RenderSettings {
    RenderSettings::default().with_level(0, level.into())
}

/// What `level` costs at a corner.
fn at_corner(level: u8) -> CostPoint {
    let share = f64::from(level) / f64::from(LEVELS - 1);
    CostPoint::new(1.0 + 3.0 * share, 0.3 * (1.0 - share).powi(2))
}

fn frontier(levels: impl IntoIterator<Item = u8>) -> Frontier {
    Frontier::from_points(levels.into_iter().map(|level| FrontierPoint { settings: settings(level), cost: at_corner(level) }))
}

/// A leaf, 8 m long, with the same frontier at all corners and views, each of which could become another.
fn map(frontier: &Frontier) -> FrontierMap {
    let corner = |number: u16| {
        let at = [number >> 2 & 1, number >> 1 & 1, number & 1];
        Corner { at, frontiers: std::array::from_fn(|view| u32::from(number) * 6 + view as u32) }
    };
    FrontierMap {
        version: FrontierMap::VERSION,
        scene: SceneIdentity::default(),
        capture: Capture { size: [320, 180], frames_per_second: 30.0, vertical_fov: 60.0, exposure_ev100: 12.0 },
        meter: MeterInfo { name: "none".into(), provenance: Provenance::Modelled, description: "a formula".into() },
        thresholds: Thresholds { power_w: 0.5, error: 0.005 },
        seed: 0,
        knobs: KnobSpace::new(vec![Knob::new("quality", (0..LEVELS).map(f64::from))]).expect("a valid space"),
        bounds: Bounds { min: [-4.0; 3], max: [4.0; 3] },
        correction: Correction::default(),
        octree: Octree { levels: 0, nodes: vec![0], corners: (0..8).map(corner).collect(), frontiers: vec![frontier.clone(); 48] },
    }
}

/// Cameras in open space at which everything costs what `factors` says: times in power, times in error.
struct Field<F> {
    factors: F,
    seen: Vec<(CameraPose, RenderSettings)>,
    measured: Rc<Cell<usize>>,
}

impl<F: Fn(Vec3, RenderSettings) -> [f64; 2]> Field<F> {
    fn new(factors: F) -> Self {
        Self { factors, seen: Vec::new(), measured: Rc::default() }
    }
}

impl<F: Fn(Vec3, RenderSettings) -> [f64; 2]> Measure for Field<F> {
    type Error = Infallible;

    fn sees(&self, camera: &CameraPose) -> bool {
        // Corners are in walls.
        camera.position.abs().max_element() < 3.5
    }

    fn measure(&mut self, camera: &CameraPose, settings: RenderSettings) -> Result<CostPoint, Infallible> {
        self.seen.push((*camera, settings));
        self.measured.set(self.measured.get() + 1);
        let [power, error] = (self.factors)(camera.position, settings);
        let cost = at_corner(settings.level(0) as u8);
        Ok(CostPoint::new(cost.power.0 * power, cost.error * error))
    }
}

/// Says stop after so many measurements.
struct Until {
    measured: Rc<Cell<usize>>,
    limit: usize,
}

impl Monitor for Until {
    fn keep_going(&mut self) -> bool {
        self.measured.get() < self.limit
    }

    fn seconds(&mut self) -> f64 {
        0.0
    }

    fn remaining_seconds(&mut self) -> Option<f64> {
        Some(1.0)
    }
}

fn run(map: &mut FrontierMap, measure: &mut impl Measure<Error = Infallible>) -> Remeasured {
    let Ok(done) = remeasure(map, &RemeasureConfig::default(), measure, &mut Unwatched, &mut |_, _| {});
    map.validate().expect("a valid map");
    done
}

#[test]
fn promises_are_kept_where_corners_were_wrong() {
    // Wrong by another factor on each side, and by a few per cent from camera to camera.
    let factors = |position: Vec3, _| {
        let wobble = 1.0 + 0.04 * f64::from((17.0 * position.y).sin());
        if position.x < 0.0 { [1.3 * wobble, 2.5 * wobble] } else { [0.8 * wobble, 1.4 * wobble] }
    };
    let searched = frontier(0..LEVELS);
    let mut map = map(&searched);
    let mut field = Field::new(factors);
    let done = run(&mut map, &mut field);
    assert_eq!((done.cameras, done.measurements), (3 * done.frontiers, 15 * done.frontiers));
    assert!(done.frontiers >= 32, "most views that are not straight up or down are somebody's: {done:?}");

    let before = vec![searched; 48];
    let Ok(promises) = hold_to_promise(&map, &before, [64, 1], &mut field, &mut Unwatched, &mut |_| {});
    assert!(promises.len() > 2 * 64 && promises.len() <= 3 * 64, "{}", promises.len());
    let ratios =
        |promised: fn(&Promise) -> CostPoint| Spread::of(promises.iter().map(move |p| (promised(p), p.measured))).map(Option::unwrap);
    let [power, error] = ratios(|promise| promise.searched.expect("all were searched"));
    assert!(power.high > 1.25 && error.high > 2.2, "{power} {error}");
    let [power, error] = ratios(|promise| promise.promised);
    for spread in [power, error] {
        assert!((spread.median - 1.0).abs() < 0.03 && (1.0..1.08).contains(&spread.high), "{power} {error}");
    }
    assert!(correction(&promises).error < 1.1);
    for frontier in &map.octree.frontiers {
        assert_eq!(frontier.points().last().map(|point| (point.settings, point.cost.error)), Some((settings(LEVELS - 1), 0.0)));
    }
}

#[test]
fn the_same_seed_gives_the_same_map() {
    let with = |seed| {
        let mut map = map(&frontier(0..LEVELS));
        let config = RemeasureConfig { seed, ..Default::default() };
        let factors = |position: Vec3, _| [1.0 + 0.1 * f64::from(position.x), 2.0 + 0.1 * f64::from(position.z)];
        let Ok(_) = remeasure(&mut map, &config, &mut Field::new(factors), &mut Unwatched, &mut |_, _| {});
        map
    };
    assert_eq!(with(1), with(1));
    assert_ne!(with(1), with(2));
}

#[test]
fn every_cell_gets_a_camera_before_any_gets_its_second() {
    let mut map = map(&frontier(0..LEVELS));
    let mut field = Field::new(|_, _| [1.0, 1.0]);
    let cells = find_cells(&map, 3, &mut RandomCameras::new(map.bounds, 0), |camera| field.sees(camera), || true).len();
    // Under a limit three points of each frontier are measured: all first cameras and a few more.
    let mut monitor = Until { measured: field.measured.clone(), limit: 3 * cells + 7 };
    let Ok(done) = remeasure(&mut map, &RemeasureConfig::default(), &mut field, &mut monitor, &mut |_, _| {});
    assert_eq!(done.measurements, 3 * cells + 7);
    let first: BTreeSet<_> = field.seen.iter().take(3 * cells).map(|(camera, _)| cameras::frontier_at(&map, camera)).collect();
    assert_eq!((first.len(), done.frontiers), (cells, cells));
    map.validate().expect("a valid map");
}

#[test]
fn readings_that_are_no_numbers_are_left_out() {
    let searched = frontier(0..LEVELS);
    let broken = |_, chosen: RenderSettings| if chosen == settings(0) { [f64::NAN; 2] } else { [2.0, 1.0] };
    let mut some = map(&searched);
    assert!(run(&mut some, &mut Field::new(broken)).frontiers > 0);
    let changed = some.octree.frontiers.iter().find(|frontier| **frontier != searched).expect("one was measured");
    assert!((changed.points()[0].cost.power.0 - 2.0).abs() < 1e-9, "as its neighbour: {changed:?}");

    let mut none = map(&searched);
    let broken = |_: Vec3, _: RenderSettings| [f64::NAN, f64::INFINITY];
    assert_eq!(run(&mut none, &mut Field::new(broken)).frontiers, 0);
    assert_eq!(none, map(&searched));
}

#[test]
fn without_cameras_nothing_changes() {
    struct Blind;
    impl Measure for Blind {
        type Error = Infallible;
        fn sees(&self, _: &CameraPose) -> bool {
            false
        }
        fn measure(&mut self, _: &CameraPose, _: RenderSettings) -> Result<CostPoint, Infallible> {
            unreachable!("it sees nothing")
        }
    }
    let mut blind = map(&frontier(0..LEVELS));
    assert_eq!(run(&mut blind, &mut Blind), Remeasured::default());
    assert_eq!(blind, map(&frontier(0..LEVELS)));
    let Ok(promises) = hold_to_promise(&blind, &[], [16, 0], &mut Blind, &mut Unwatched, &mut |_| {});
    assert_eq!(correction(&promises), Correction::default());

    let mut empty = map(&Frontier::default());
    assert_eq!(run(&mut empty, &mut Field::new(|_, _| [1.0, 1.0])), Remeasured::default());
}

#[test]
fn frontiers_that_end_before_the_best_settings_are_led_up_to_them() {
    // At the corner level 3 looks as good as the best.
    let flat = Frontier::from_points(
        [(1, 0.1), (3, 0.0)]
            .map(|(level, error)| FrontierPoint { settings: settings(level), cost: CostPoint { error, ..at_corner(level) } }),
    );
    let mut map = map(&flat);
    run(&mut map, &mut Field::new(|_, _| [1.0, 1.0]));
    let measured = map.octree.frontiers.iter().find(|frontier| **frontier != flat).expect("one was measured");
    let costs: Vec<_> = measured.points().iter().map(|point| point.cost).collect();
    assert_eq!(costs.len(), 3);
    for (cost, level) in costs.iter().zip([1, 3, LEVELS - 1]) {
        let true_cost = at_corner(level);
        assert!((cost.power - true_cost.power).0.abs() < 1e-9 && (cost.error - true_cost.error).abs() < 1e-9, "{costs:?}");
    }
}

#[test]
fn the_best_settings_may_turn_out_the_cheapest() {
    let mut map = map(&frontier([0, 4, LEVELS - 1]));
    run(&mut map, &mut Field::new(|_, chosen| if chosen == settings(LEVELS - 1) { [0.1, 0.0] } else { [1.0, 1.0] }));
    assert!(map.octree.frontiers.iter().any(|frontier| frontier.points().len() == 1));
}

/// Any frontier, any readings, cut off anywhere: the map stays valid, no frontier becomes empty.
#[test]
fn maps_stay_valid() {
    const FACTORS: [f64; 7] = [0.0, 1e-9, 0.5, 1.0, 1e6, f64::NAN, f64::INFINITY];
    let frontiers: [&[u8]; 6] = [&[0], &[LEVELS - 1], &[0, LEVELS - 1], &[3, 4], &[0, 1, 2], &[0, 3, 5, 7, 9, 11, 15]];
    for (case, (power, error)) in FACTORS.iter().flat_map(|power| FACTORS.map(|error| (*power, error))).enumerate() {
        for levels in frontiers {
            let mut map = map(&frontier(levels.iter().copied()));
            let mut field = Field::new(|_, _| [power, error]);
            let mut monitor = Until { measured: field.measured.clone(), limit: 3 * case };
            let config = RemeasureConfig { cameras: 1, ..Default::default() };
            let Ok(_) = remeasure(&mut map, &config, &mut field, &mut monitor, &mut |_, _| {});
            assert!(map.validate().is_ok(), "{levels:?} times {power} and {error}: {:?}", map.validate());
            assert!(map.octree.frontiers.iter().all(|frontier| !frontier.is_empty()), "{levels:?} times {power} and {error}");
        }
    }
}
