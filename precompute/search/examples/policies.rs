//! Plays every policy on the records of docs/data/records: `cargo run --release -p frugal_search --example
//! policies [FOLDER]`. Prints, for each path and power budget, errors and what became of the budget.

use std::path::Path;

use frugal_core::control::ControlSettings;
use frugal_core::frontier::FrontierMap;
use frugal_search::evaluate::{
    Baselines, BudgetRequest, EvaluationResult, PowerBudget, RecordFile, RunResult, Trial,
    read_records,
};

const SHARES: [f64; 9] = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9];
const ERRORS: [f64; 5] = [0.006, 0.01, 0.018, 0.03, 0.05];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let default = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/data/records");
    let folder = std::env::args().nth(1).unwrap_or_else(|| default.to_owned());
    for (record, map) in read_records(Path::new(&folder))? {
        print(&record, &map)?;
    }
    Ok(())
}

fn print(file: &RecordFile, map: &FrontierMap) -> Result<(), String> {
    let record = file.record(&map.knobs)?;
    let trial = Trial {
        scene: &file.scene,
        record: &record,
        map,
        lens: (file.lens[0], file.lens[1]),
        size: file.size,
        meter: &map.meter,
        control: ControlSettings::default(),
        baselines: Baselines::All,
        default: map.knobs.highest(),
        meter_interval: |_| std::time::Duration::from_secs(10),
    };
    println!("\n{}, {}: error by policy", file.scene, file.path);
    println!(
        "budget  frugal trained  best   mixed  shared oracle reactive | of trained, way, used, over, switches/min"
    );
    let mut ratios = Vec::new();
    for share in SHARES {
        let power = Some(PowerBudget::Share(share));
        let result = trial.judge(&BudgetRequest { power, ..Default::default() });
        let ours = run(&result, "frugal");
        let error = |name: &str| run(&result, name).mean_error;
        let limit = result.budget.power_w.map_or(f64::NAN, |limit| limit.0);
        let ratio = ours.mean_error / error("trained-constant");
        let way =
            (error("best-constant") - ours.mean_error) / (error("best-constant") - error("oracle"));
        ratios.push((ratio, way));
        println!(
            "{:>5.0} %  {:.4} {:.4} {:.4} {:.4} {:.4} {:.4} {:.4} | {ratio:.2} {:>4.0} % {:.3} {:.3} {:.1}",
            100.0 * share,
            ours.mean_error,
            error("trained-constant"),
            error("best-constant"),
            error("mixed-constants"),
            error("shared-frontier"),
            error("oracle"),
            error("reactive"),
            100.0 * way,
            ours.mean_power_w.0 / limit,
            ours.windows_over.unwrap_or(f64::NAN),
            60.0 * ours.switches as f64 / (ours.series.len() as f64 / result.fps),
        );
    }
    let median = |of: fn(&(f64, f64)) -> f64| {
        let mut values: Vec<f64> = ratios[2..].iter().map(of).collect();
        values.sort_by(f64::total_cmp);
        values[values.len() / 2]
    };
    println!(
        "median from 30 to 90 %: {:.2} of the trained constant's error, {:.0} % of the way",
        median(|it| it.0),
        100.0 * median(|it| it.1)
    );
    println!("error budget  frugal W, error | trained W, error | oracle W");
    for error in ERRORS {
        let result = trial.judge(&BudgetRequest { error: Some(error), ..Default::default() });
        let [ours, trained, oracle] =
            ["frugal", "trained-constant", "oracle"].map(|name| run(&result, name));
        println!(
            "{error:.3}  {:.3} {:.4} | {:.3} {:.4} | {:.3}",
            ours.mean_power_w.0,
            ours.mean_error,
            trained.mean_power_w.0,
            trained.mean_error,
            oracle.mean_power_w.0
        );
    }
    Ok(())
}

fn run<'a>(result: &'a EvaluationResult, name: &str) -> &'a RunResult {
    let named = |run: &&RunResult| run.name == name;
    result.runs.iter().find(named).unwrap_or(&result.runs[0])
}
