//! The controller with meters that are late, of another device, or lost, on the records of docs/data/records:
//! `cargo run -p frugal_search --example meters [FOLDER] [--json FILE]`.

#[path = "shared/mod.rs"]
mod shared;

use std::collections::VecDeque;

use frugal_core::control::{
    Budget, CameraController, ControlSettings, ErrorFeedback, Inputs, PowerModel,
};
use frugal_core::frontier::{CameraView, CostPoint, FrontierMap};
use frugal_core::knobs::KnobLevels;
use frugal_core::units::Watts;
use frugal_search::evaluate::{Choice, Policy, Pose, read_records};
use serde::Serialize;
use shared::{Arguments, lines, rounded, write};

/// Metered watts of the device for each watt of the map.
const HUNGRIER: f64 = 1.4;
/// Interval of a reading, seconds.
const INTERVAL: f64 = 1.0;
/// Seconds in which the correction is learnt, which do not count.
const LEARNING: f64 = 60.0;
const SECONDS: f64 = 360.0;

/// A meter on a path under a power budget.
#[derive(Serialize)]
struct Row<'a> {
    scene: &'a str,
    path: &'a str,
    meter: &'a str,
    /// Share of the range from the cheapest to the best settings' mean power.
    budget: f64,
    /// Mean power ÷ budget.
    used: f64,
    windows_over: f64,
}

/// The controller of a camera on a device with a meter.
struct Metered<'a> {
    map: &'a FrontierMap,
    lens: [f32; 2],
    budget: Budget,
    controller: CameraController,
    model: PowerModel,
    last: Option<KnobLevels>,
    /// Metered watts for each of the record.
    gain: f64,
    late: f64,
    lost_at: f64,
    now: f64,
    dt: f64,
    sum: (f64, f64),
    pending: VecDeque<(f64, f64, f64)>,
}

impl Policy for Metered<'_> {
    fn decide(&mut self, _: usize, dt: f64, pose: &Pose) -> Choice {
        (self.dt, self.now) = (dt, self.now + dt);
        let inputs = Inputs {
            store: self.map,
            view: CameraView {
                position: pose.position,
                rotation: pose.rotation,
                vertical_fov: self.lens[0],
                aspect: self.lens[1],
            },
            budget: self.budget,
            delta_seconds: dt,
            current: Some(self.last.unwrap_or_default()),
            correction: self.model.correction(),
            mean_correction: self.model.mean_correction(),
            errors: ErrorFeedback::default(),
            settings: ControlSettings::default(),
        };
        let Some(found) = self.controller.step(&inputs) else {
            return Choice::from(self.last.unwrap_or_default());
        };
        self.model.predict(found.uncorrected, dt);
        self.last = Some(found.applied);
        Choice { settings: found.applied, target: found.target, predicted: Some(found.predicted) }
    }

    fn observe(&mut self, cost: CostPoint) {
        self.sum = (self.sum.0 + cost.power.0 * self.gain * self.dt, self.sum.1 + self.dt);
        if self.sum.1 >= INTERVAL - 1e-9 {
            self.pending.push_back((self.now + self.late, self.sum.0 / self.sum.1, self.sum.1));
            self.sum = (0.0, 0.0);
        }
        while self.pending.front().is_some_and(|(at, ..)| *at <= self.now + 1e-9) {
            let Some((_, watts, seconds)) = self.pending.pop_front() else { return };
            if self.now < self.lost_at {
                self.model.read(Watts(watts), seconds);
            }
        }
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments = Arguments::read()?;
    let records = read_records(&arguments.folder)?;
    let mut rows = Vec::new();
    println!(
        "of the power budget used, and windows of 30 s over by 2 %, after a minute; device of {HUNGRIER} W a watt of the map"
    );
    for (file, map) in &records {
        let record = file.record(&map.knobs)?;
        let [Watts(low), Watts(high)] = record.power_range();
        for (name, late, lost_at) in [
            ("on time", 0.0, f64::MAX),
            ("30 s late", 30.0, f64::MAX),
            ("lost after 60 s", 0.0, 60.0),
        ] {
            print!("{:>9} {:>6}, {name:>15}:", file.scene, file.path);
            for share in [0.3, 0.5, 0.7] {
                let limit = HUNGRIER * (low + share * (high - low));
                let mut policy = Metered {
                    map,
                    lens: file.lens,
                    budget: Budget::power(Watts(limit)),
                    controller: CameraController::default(),
                    model: PowerModel::default(),
                    last: None,
                    gain: HUNGRIER,
                    late,
                    lost_at,
                    now: 0.0,
                    dt: 0.0,
                    sum: (0.0, 0.0),
                    pending: VecDeque::new(),
                };
                let series = record.simulate_for(&mut policy, SECONDS);
                let from = (LEARNING * file.fps) as usize;
                let powers: Vec<f64> =
                    series[from..].iter().map(|frame| HUNGRIER * frame.power.0).collect();
                let window = (Budget::HORIZON.as_secs_f64() * file.fps) as usize;
                let windows =
                    powers.windows(window).map(|it| it.iter().sum::<f64>() / window as f64);
                let over = windows.clone().filter(|mean| *mean > 1.02 * limit).count();
                let used = powers.iter().sum::<f64>() / powers.len() as f64 / limit;
                let part = over as f64 / windows.count().max(1) as f64;
                rows.push(Row {
                    scene: &file.scene,
                    path: &file.path,
                    meter: name,
                    budget: share,
                    used: rounded(used, 3),
                    windows_over: rounded(part, 4),
                });
                print!("  {:>3.0} %: {used:.3}, {:.1} %", 100.0 * share, 100.0 * part);
            }
            println!();
        }
    }
    if let Some(file) = arguments.json {
        write(&file, &records, &[("rows", lines(&rows)?)])?;
    }
    Ok(())
}
