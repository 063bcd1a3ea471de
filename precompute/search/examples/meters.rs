//! The controller with meters that are late, of another device, or lost, on the records of docs/data/records:
//! `cargo run -p frugal_search --features testing --example meters [FOLDER] [--json FILE]`.

#[path = "shared/mod.rs"]
mod shared;

use std::collections::VecDeque;

use frugal_core::control::{Budget, ControlSettings};
use frugal_core::frontier::CostPoint;
use frugal_core::units::Watts;
use frugal_search::evaluate::{BudgetRequest, Choice, Controller, Policy, Pose, PowerBudget};
use frugal_search::testing::read_records;
use serde::Serialize;
use shared::{Arguments, lines, rounded, write};

/// Metered watts of the device for each watt of the map.
const HUNGRIER: f64 = 1.4;
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

/// The controller on a device with a meter.
struct Metered<'a> {
    controller: Controller<'a>,
    /// What the meter has not yet reported.
    pending: VecDeque<CostPoint>,
    /// Frames by which it is late.
    late: usize,
    /// Frames until it is lost.
    left: usize,
    /// Frames until the device is hungrier; before, it takes the map's watts.
    until: usize,
}

impl Policy for Metered<'_> {
    fn decide(&mut self, frame: usize, dt: f64, pose: &Pose) -> Choice {
        self.controller.decide(frame, dt, pose)
    }

    fn observe(&mut self, cost: CostPoint) {
        let power = cost.power * if self.until == 0 { HUNGRIER } else { 1.0 };
        self.until = self.until.saturating_sub(1);
        self.pending.push_back(CostPoint { power, ..cost });
        self.left = self.left.saturating_sub(1);
        if self.pending.len() > self.late
            && let Some(reported) = self.pending.pop_front().filter(|_| self.left > 0)
        {
            self.controller.observe(reported);
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
        for (name, late, lost_at, until) in [
            ("on time", 0.0, f64::MAX, 0.0),
            ("30 s late", 30.0, f64::MAX, 0.0),
            ("lost after 60 s", 0.0, 60.0, 0.0),
            ("hungrier half way", 0.0, f64::MAX, 0.5 * SECONDS),
        ] {
            print!("{:>9} {:>6}, {name:>17}:", file.scene, file.path);
            for share in [0.3, 0.5, 0.7] {
                let limit = HUNGRIER * (low + share * (high - low));
                let request = BudgetRequest {
                    power: Some(PowerBudget::Power(Watts(limit))),
                    ..Default::default()
                };
                let budget = request.resolve(Watts(low), Watts(high));
                let settings = ControlSettings::default();
                let mut policy = Metered {
                    controller: Controller::new(map, &budget, file.lens.into(), settings),
                    pending: VecDeque::new(),
                    late: (late * file.fps) as usize,
                    left: (lost_at * file.fps) as usize,
                    until: (until * file.fps) as usize,
                };
                let series = record.simulate_for(&mut policy, SECONDS);
                // What counts is a device that is hungrier, a minute later.
                let from = ((until + LEARNING) * file.fps) as usize;
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
