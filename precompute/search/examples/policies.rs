//! Plays every policy on the records of docs/data/records: `cargo run --release -p frugal_search --features
//! testing --example policies [FOLDER] [--json FILE]`. Prints, for each path and power budget, errors and what
//! became of the budget. The file holds the same, and the medians of other searches' records, in FOLDER/seed-*.

#[path = "shared/mod.rs"]
mod shared;

use frugal_core::control::ControlSettings;
use frugal_core::frontier::FrontierMap;
use frugal_search::evaluate::{
    Baselines, BudgetRequest, EvaluationResult, PowerBudget, RunResult, Trial,
};
use frugal_search::testing::{RecordFile, read_records};
use serde::Serialize;
use shared::{Arguments, lines, rounded, write};

const SHARES: [f64; 9] = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9];
const ERRORS: [f64; 5] = [0.006, 0.01, 0.018, 0.03, 0.05];

/// A path under a power budget.
#[derive(Serialize)]
struct PowerRow {
    scene: String,
    path: String,
    /// Share of the range from the cheapest to the best settings' mean power.
    budget: f64,
    range_w: [f64; 2],
    limit_w: f64,
    frugal: Played,
    trained: Played,
    best: Played,
    turns: Played,
    shared: Played,
    oracle: Played,
    reactive: Played,
    windows_over: f64,
    switches_per_minute: f64,
}

/// A path under an error budget.
#[derive(Serialize)]
struct ErrorRow {
    scene: String,
    path: String,
    error_budget: f64,
    frugal: Played,
    /// With an error meter, its power included.
    measured: Played,
    trained: Played,
    oracle: Played,
}

/// A path by the map of another seed: frugal's error ÷ a policy's, medians of the budgets from 30 %.
#[derive(Serialize)]
struct SeedRow {
    scene: String,
    path: String,
    seed: u64,
    trained: f64,
    best: f64,
    turns: f64,
    shared: f64,
    /// Share of the way from the best constant to the oracle.
    way: f64,
    windows_over: f64,
}

impl SeedRow {
    /// From the rows of the path.
    fn new(seed: u64, rows: &[PowerRow]) -> Self {
        let median = |of: &dyn Fn(&PowerRow) -> f64| {
            let mut values: Vec<f64> = rows[2..].iter().map(of).collect();
            values.sort_by(f64::total_cmp);
            rounded(values[values.len() / 2], 3)
        };
        let ratio = |of: fn(&PowerRow) -> &Played| median(&|row| row.frugal.error / of(row).error);
        Self {
            scene: rows[0].scene.clone(),
            path: rows[0].path.clone(),
            seed,
            trained: ratio(|row| &row.trained),
            best: ratio(|row| &row.best),
            turns: ratio(|row| &row.turns),
            shared: ratio(|row| &row.shared),
            way: median(&|row| {
                (row.best.error - row.frugal.error) / (row.best.error - row.oracle.error)
            }),
            windows_over: rows[2..].iter().map(|row| row.windows_over).fold(0.0, f64::max),
        }
    }
}

/// Mean power and error of a policy.
#[derive(Serialize)]
struct Played {
    w: f64,
    error: f64,
}

impl Played {
    fn of(run: &RunResult) -> Self {
        Self { w: rounded(run.mean_power_w.0, 4), error: rounded(run.mean_error, 5) }
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments = Arguments::read()?;
    let records = read_records(&arguments.folder)?;
    let (mut powers, mut errors, mut seeds) = (Vec::new(), Vec::new(), Vec::new());
    for (record, map) in &records {
        seeds.push(print(record, map, &mut powers, &mut errors)?);
    }
    let mut others: Vec<_> = std::fs::read_dir(&arguments.folder)?
        .map(|entry| Ok(entry?.path()))
        .collect::<std::io::Result<_>>()?;
    others.retain(|folder| folder.is_dir());
    others.sort();
    for folder in others {
        for (record, map) in &read_records(&folder)? {
            seeds.push(print(record, map, &mut Vec::new(), &mut Vec::new())?);
        }
    }
    if let Some(file) = arguments.json {
        let tables = [
            ("power_budgets", lines(&powers)?),
            ("error_budgets", lines(&errors)?),
            ("seeds", lines(&seeds)?),
        ];
        write(&file, &records, &tables)?;
    }
    Ok(())
}

/// Prints what becomes of a path, and adds a row for each budget. Returns the medians.
fn print(
    file: &RecordFile,
    map: &FrontierMap,
    powers: &mut Vec<PowerRow>,
    errors: &mut Vec<ErrorRow>,
) -> Result<SeedRow, String> {
    let record = file.record(&map.knobs)?;
    let trial = Trial {
        scene: &file.scene,
        record: &record,
        map,
        lens: file.lens.into(),
        size: file.size,
        meter: &map.meter,
        control: ControlSettings::default(),
        baselines: Baselines::All,
        default: map.knobs.highest(),
    };
    println!("\n{}, {}: error by policy", file.scene, file.path);
    println!(
        "budget  frugal trained  best   mixed  shared oracle reactive | of trained, way, used, over, switches/min"
    );
    let [low, high] = record.power_range();
    let before = powers.len();
    for share in SHARES {
        let power = Some(PowerBudget::Share(share));
        let result = trial.judge(&BudgetRequest { power, ..Default::default() });
        let ours = run(&result, "frugal");
        let error = |name: &str| run(&result, name).mean_error;
        let limit = result.budget.power_w.map_or(f64::NAN, |limit| limit.0);
        let ratio = ours.mean_error / error("trained-constant");
        let way =
            (error("best-constant") - ours.mean_error) / (error("best-constant") - error("oracle"));
        let used = ours.mean_power_w.0 / limit;
        let over = ours.windows_over.unwrap_or(f64::NAN);
        let switches = 60.0 * ours.switches as f64 / (ours.series.len() as f64 / result.fps);
        let played = |name: &str| Played::of(run(&result, name));
        powers.push(PowerRow {
            scene: file.scene.clone(),
            path: file.path.clone(),
            budget: share,
            range_w: [low, high].map(|power| rounded(power.0, 4)),
            limit_w: rounded(limit, 4),
            frugal: played("frugal"),
            trained: played("trained-constant"),
            best: played("best-constant"),
            turns: played("mixed-constants"),
            shared: played("shared-frontier"),
            oracle: played("oracle"),
            reactive: played("reactive"),
            windows_over: rounded(over, 4),
            switches_per_minute: rounded(switches, 1),
        });
        println!(
            "{:>5.0} %  {:.4} {:.4} {:.4} {:.4} {:.4} {:.4} {:.4} | {ratio:.2} {:>4.0} % {used:.3} {over:.3} {switches:.1}",
            100.0 * share,
            ours.mean_error,
            error("trained-constant"),
            error("best-constant"),
            error("mixed-constants"),
            error("shared-frontier"),
            error("oracle"),
            error("reactive"),
            100.0 * way,
        );
    }
    let medians = SeedRow::new(map.seed, &powers[before..]);
    println!(
        "median from 30 to 90 %: {:.2} of the trained constant's error, {:.0} % of the way",
        medians.trained,
        100.0 * medians.way
    );
    println!("error budget  frugal W, error | with an error meter | trained W, error | oracle W");
    for error in ERRORS {
        let result = trial.judge(&BudgetRequest { error: Some(error), ..Default::default() });
        let [ours, measured, trained, oracle] =
            ["frugal", "frugal-measured", "trained-constant", "oracle"]
                .map(|name| run(&result, name));
        errors.push(ErrorRow {
            scene: file.scene.clone(),
            path: file.path.clone(),
            error_budget: error,
            frugal: Played::of(ours),
            measured: Played::of(measured),
            trained: Played::of(trained),
            oracle: Played::of(oracle),
        });
        println!(
            "{error:.3}  {:.3} {:.4} | {:.3} {:.4} | {:.3} {:.4} | {:.3}",
            ours.mean_power_w.0,
            ours.mean_error,
            measured.mean_power_w.0,
            measured.mean_error,
            trained.mean_power_w.0,
            trained.mean_error,
            oracle.mean_power_w.0
        );
    }
    Ok(medians)
}

fn run<'a>(result: &'a EvaluationResult, name: &str) -> &'a RunResult {
    let named = |run: &&RunResult| run.name == name;
    result.runs.iter().find(named).unwrap_or(&result.runs[0])
}
