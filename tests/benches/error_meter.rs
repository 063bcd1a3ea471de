//! What an error meter costs, and how its measurements spread.
//!
//! `make bench BENCH=error_meter ARGS='[--size WxH] [--count ROUNDS]'`
//!
//! `courtyard` along its tour, at settings below the best ones. Each round takes 24 frames without a
//! meter and 24 with one measurement, in turn. The cost of a measurement is the difference, in frames
//! of the camera without one and as a share of the cost of 1,200 frames: of one measurement every
//! 20 s at 60 frames per second. CPU time of all threads on a software adapter, else wall time. All
//! rows measure at the same places, so that their mean errors compare.

use std::time::Duration;

use bevy::ecs::entity::Entity;
use bevy::math::UVec2;
use bevy_frugal_gi::error_meter::{ErrorMeter, MeasuredError};
use frugal::scene::SceneDescription;
use frugal::stage::{Stage, StageOptions, adapter};
use frugal_tests::arguments::Arguments;
use frugal_tests::cost::{Clock, median, quantile};
use frugal_tests::set;
use frugal_tests::table::markdown;

/// Cheaper in all that a frame costs, pixels, VPLs, rays and maps; and of little error, beside which
/// noise of the reference counts.
const SETTINGS: [&str; 3] = [
    "max,resolution_scale=70%,gi_pixel_fraction=1/4,gi_vpl_count=1024,rsm_resolution=128",
    "max,gi_pixel_fraction=1/4",
    "max,gi_pixel_fraction=1/2",
];
/// Frames of a reading: a measurement and its arrival fit in.
const FRAMES: u32 = 24;
/// Frames from one measurement to the next: 20 s at 60 frames per second.
const PERIOD_FRAMES: f64 = 1200.0;
/// Seconds along the tour from frame to frame.
const STEP_SECONDS: f32 = 1.0 / 60.0;

struct Walk {
    stage: Stage,
    scene: SceneDescription,
    camera: Entity,
    time: f32,
    clock: Clock,
}

impl Walk {
    fn new(size: UVec2, settings: &str) -> Self {
        let scene = set::scene("courtyard");
        let mut stage = set::open(&scene, StageOptions { size, ..Default::default() });
        set::apply(&mut stage, settings);
        let camera = set::camera(&mut stage);
        let mut walk = Self { stage, scene, camera, time: 0.0, clock: Clock::suitable() };
        walk.stage.get_ready().unwrap_or_else(|error| panic!("{error}"));
        // The pipelines of the best settings, which the hidden camera takes.
        walk.reading(Some((1.0, 6)));
        walk
    }

    /// Milliseconds of all frames of a reading, and the error that was measured.
    fn reading(&mut self, meter: Option<(f32, u32)>) -> (f64, Option<f64>) {
        let mut camera = self.stage.world_mut().entity_mut(self.camera);
        if let Some((share, frames)) = meter {
            camera.insert(ErrorMeter { share, frames, period: Duration::MAX });
        }
        let path = &self.scene.paths["tour"];
        let mut milliseconds = 0.0;
        for _ in 0..FRAMES {
            self.time = (self.time + STEP_SECONDS) % path.duration();
            if let Some(pose) = path.sample(self.time) {
                self.stage.place(pose.position, pose.rotation);
            }
            milliseconds += self.clock.frames_ms(&mut self.stage, 1);
        }
        let mut camera = self.stage.world_mut().entity_mut(self.camera);
        let measured = camera.get::<MeasuredError>().and_then(|measured| measured.last);
        camera.remove::<ErrorMeter>();
        self.stage.frame();
        (milliseconds, measured)
    }
}

fn main() {
    let Some(adapter) = adapter() else {
        println!("no graphics adapter: nothing is measured");
        return;
    };
    let options =
        Arguments { size: UVec2::new(160, 90), samples: 0, count: 5, names: vec![] }.read();
    println!("Adapter: {}. `courtyard` at {}x{}.\n", adapter.name, options.size.x, options.size.y);
    for settings in SETTINGS {
        measure(&options, settings);
    }
}

fn measure(options: &Arguments, settings: &str) {
    let mut walk = Walk::new(options.size, settings);
    set::apply(&mut walk.stage, "max");
    walk.reading(None);
    let readings = (0..options.count.max(1)).map(|_| walk.reading(None).0);
    let best = median(readings.collect()) / f64::from(FRAMES);
    set::apply(&mut walk.stage, settings);
    walk.reading(None);
    println!("{settings}; {}; {best:.2} ms a frame at the best settings:\n", walk.clock.label());
    let mut rows = Vec::new();
    for (share, frames) in [(0.25, 12), (0.25, 6), (0.5, 6), (0.25, 4), (0.25, 3), (0.25, 2)] {
        walk.time = 0.0;
        let (mut costs, mut plain, mut errors) = (Vec::new(), Vec::new(), Vec::new());
        for _ in 0..options.count.max(1) {
            let (without, _) = walk.reading(None);
            let (with, error) = walk.reading(Some((share, frames)));
            costs.push(with - without);
            plain.push(without / f64::from(FRAMES));
            errors.extend(error);
        }
        let (cost, frame) = (median(costs.clone()), median(plain));
        let range = [0.25, 0.75].map(|at| quantile(&mut costs, at) / frame);
        rows.push(vec![
            format!("{share}"),
            format!("{frames}"),
            format!("{frame:.2}"),
            format!("{:.1} ({:.1} to {:.1})", cost / frame, range[0], range[1]),
            format!("{:.1}", cost / best),
            format!("{:.1} %", 100.0 * cost / frame / PERIOD_FRAMES),
            format!("{:.4}", errors.iter().sum::<f64>() / errors.len().max(1) as f64),
            format!("{} of {}", errors.len(), costs.len()),
        ]);
    }
    let header = [
        "share",
        "frames",
        "ms a frame",
        "frames that one measurement costs",
        "best frames",
        "every 20 s",
        "mean error",
        "measured",
    ];
    println!("{}", markdown(&header, &rows));
}
