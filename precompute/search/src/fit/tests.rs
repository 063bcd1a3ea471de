//! Fits to synthetic scenes with known optimal maps.

use frugal_core::frontier::{Bounds, CameraView, CostPoint, ErrorRates, Octree, ViewDirection};
use frugal_core::knobs::KnobLevels;
use frugal_trace::scene::CameraPose;
use glam::{Quat, Vec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::cameras::MovingCamera;
use crate::table::CostTable;

const BOUNDS: Bounds = Bounds { min: [0.0; 3], max: [8.0, 8.0, 8.0] };
const SETTINGS: u128 = 24;

fn settings() -> Vec<KnobLevels> {
    (0..SETTINGS).map(KnobLevels::from_bits).collect()
}

/// Even settings suit one kind of view, odd ones the other; `noise` is relative.
fn cost(
    settings: KnobLevels,
    kind: bool,
    difficulty: f64,
    noise: f64,
    random: &mut ChaCha8Rng,
) -> CostPoint {
    let quality = (settings.bits() / 2) as f64 / (SETTINGS / 2 - 1) as f64;
    let suits = settings.bits().is_multiple_of(2) == kind;
    let mut noisy = |value: f64| value * (1.0 + noise * random.random_range(-1.0..1.0));
    let power = noisy(1.0 + 9.0 * quality * quality);
    CostPoint::new(
        power,
        noisy(difficulty * 0.1 * (1.0 - quality).powi(2) * if suits { 1.0 } else { 2.5 }),
    )
}

struct Scene {
    cameras: Vec<MovingCamera>,
    views: Vec<CameraView>,
    table: CostTable,
}

impl Scene {
    fn new(count: usize) -> Self {
        Self { cameras: Vec::new(), views: Vec::new(), table: CostTable::new(count) }
    }

    /// The next camera, at rest at `pose`, with what `cost` says of each setting.
    fn add(&mut self, pose: CameraPose, group: u32, mut cost: impl FnMut(KnobLevels) -> CostPoint) {
        let (row, CameraPose { position, rotation }) = (self.cameras.len(), pose);
        self.cameras.push(MovingCamera { pose, velocity: Vec3::ZERO, turn: Vec3::ZERO, group });
        self.views.push(CameraView { position, rotation, vertical_fov: 1.0, aspect: 1.5 });
        for settings in settings() {
            self.table.set(row, settings, cost(settings));
        }
    }
}

/// `count` cameras at random positions; `kind` classifies a position.
fn scene(count: usize, seed: u64, noise: f64, kind: impl Fn(Vec3) -> bool) -> Scene {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut scene = Scene::new(count);
    for row in 0..count {
        let position = Vec3::from_array(std::array::from_fn(|_| random.random_range(0.1..7.9)));
        let rotation = Quat::from_rotation_y(random.random_range(0.0..std::f32::consts::TAU));
        let difficulty = random.random_range(0.7..1.4);
        scene.add(CameraPose { position, rotation }, row as u32, |settings| {
            cost(settings, kind(position), difficulty, noise, &mut random)
        });
    }
    scene
}

fn fitted(scene: &Scene) -> Fitted {
    let (training, rows) = Training::new(&scene.table, &scene.cameras, &settings());
    assert_eq!(rows.len(), scene.cameras.len());
    fit(&training, &scene.views, &BOUNDS, &FitConfig::default())
}

#[test]
fn where_all_cameras_are_alike_they_share_one_frontier() {
    for seed in 0..5 {
        let fitted = fitted(&scene(120, seed, 0.1, |_| true));
        assert_eq!(fitted.octree.validate(), Ok(()));
        assert!(
            fitted.octree.frontiers.len() <= 60
                && fitted.report.octree_loss <= fitted.report.shared_loss,
            "{:?}",
            fitted.report
        );
        assert!(fitted.shared.points().len() > 5);
    }
}

#[test]
fn halves_of_a_scene_that_differ_get_frontiers_of_their_own() {
    let is_near = |position: Vec3| position.x < 4.0;
    let fitted = fitted(&scene(200, 1, 0.05, is_near));
    assert_eq!(fitted.octree.validate(), Ok(()));
    assert!(fitted.report.octree_loss < 0.4 * fitted.report.shared_loss, "{:?}", fitted.report);
    // Most settings of the frontiers at each end are of the suitable kind; addresses without
    // cameras have coarser estimates.
    for (x, parity) in [(0, 0), (1 << fitted.octree.levels, 1)] {
        let corners = fitted.octree.corners.iter().filter(|corner| corner.at[0] == x);
        let frontiers = corners
            .flat_map(|corner| ViewDirection::ALL.map(|view| fitted.octree.frontier(corner, view)));
        let (mut suits, mut all) = (0, 0);
        for point in frontiers.flatten().flat_map(|frontier| frontier.points()) {
            suits += usize::from(point.settings.bits() % 2 == parity);
            all += 1;
        }
        assert!(suits * 3 > all * 2, "{suits} of {all} at x = {x}");
    }
}

#[test]
fn a_map_of_many_cameras_that_all_differ_stays_small() {
    let scene = scene(300, 3, 0.1, |position| position.x % 4.0 > 2.0);
    let fitted = fitted(&scene);
    assert_eq!(fitted.octree.validate(), Ok(()));
    assert!(fitted.octree.corners.len() > 50, "{:?}", fitted.report);
    assert!(
        (10..=64).contains(&fitted.octree.frontiers.len()),
        "{}",
        fitted.octree.frontiers.len()
    );
    let bytes = ron::to_string(&fitted.octree).expect("serialisable").len();
    assert!(bytes < 50_000, "{bytes} bytes");
}

#[test]
fn no_camera_and_one_camera_are_maps_too() {
    let nothing = fitted(&Scene::new(0));
    assert!(nothing.shared.is_empty() && nothing.octree.validate() == Ok(()));
    let one = fitted(&scene(1, 3, 0.0, |_| true));
    assert_eq!((one.octree.validate(), one.octree.frontiers.len()), (Ok(()), 1));
    assert_eq!(one.octree.frontiers[0], one.shared.rounded());
}

#[test]
fn cameras_that_lack_a_reading_take_no_part() {
    let mut scene = scene(6, 2, 0.0, |_| true);
    scene.table.set(2, KnobLevels::from_bits(3), CostPoint::new(f64::NAN, 0.0));
    scene.table.set(4, KnobLevels::from_bits(5), CostPoint::new(0.0, 0.1));
    let (training, rows) = Training::new(&scene.table, &scene.cameras, &settings());
    assert_eq!((training.cameras(), rows), (4, vec![0, 1, 3, 5]));
}

/// Mean error at fresh cameras of the settings selected under a budget.
fn played(octree: &Octree, rates: &ErrorRates, budget: f64, seed: u64) -> f64 {
    let scene = scene(400, seed, 0.02, |_| true);
    let frontier = &octree.frontiers[0];
    let known = rates.0.iter().rfind(|known| known.budget <= budget);
    let rate = known.map_or(f64::INFINITY, |known| known.watts_per_error);
    let settings = frontier.least_sum(rate).expect("a frontier").settings;
    (0..400).filter_map(|row| Some(scene.table.get(row, settings)?.error)).sum::<f64>() / 400.0
}

#[test]
fn calibrated_budgets_hold_at_cameras_that_were_never_seen() {
    let (mut kept, mut all) = (0, 0);
    for seed in 0..20 {
        let train = scene(60, seed, 0.02, |_| true);
        let fitted = fitted(&train);
        let held_out = scene(30, 1000 + seed, 0.02, |_| true);
        let (frontier, table) = (&fitted.octree.frontiers[0], &held_out.table);
        let cameras: Vec<_> = (0..30).map(|row| Calibration { frontier, table, row }).collect();
        let rates = calibrate(&cameras);
        assert!(rates.is_sound() && rates.0.len() > 8, "{rates:?}");
        for budget in [0.01, 0.02, 0.04] {
            all += 1;
            let error = played(&fitted.octree, &rates, budget, 5000 + seed);
            kept += usize::from(error <= budget);
        }
    }
    assert!(kept * 10 >= all * 9, "{kept} of {all}");
}

#[test]
fn without_cameras_nothing_is_calibrated_and_few_support_little() {
    assert_eq!(calibrate(&[]), ErrorRates::default());
    let train = scene(40, 9, 0.0, |_| true);
    let fitted = fitted(&train);
    let camera = || Calibration { frontier: &fitted.shared, table: &train.table, row: 0 };
    assert_eq!(calibrate(&[camera()]), ErrorRates::default(), "one says nothing of the spread");
    assert!(!calibrate(&[camera(), camera(), camera()]).0.is_empty());
    let unknown = calibrate(&[Calibration { table: &CostTable::new(1), ..camera() }]);
    assert!(unknown.is_sound());
}
