//! `frugal search`: number of renderings that searches need, on recorded sweeps.

use std::fmt::Write as _;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use bevy_frugal_gi::power::Provenance;
use serde::Serialize;

use super::arguments::{check_outputs, json, write};
use super::{CliError, progress};
use crate::pipeline::Extent;
use crate::search_bench::{Goal, MethodResult, Recorded, SearchRuns, Spread, run as run_searches};
use crate::table::{ASSUMED_LAYOUT, SweepTable};

#[derive(clap::Args, Debug)]
pub(super) struct Arguments {
    /// The table, as `frugal sweep --csv` writes it
    #[arg(value_name = "TABLE")]
    table: PathBuf,
    /// Runs of each method, from seeds 0, 1, …
    #[arg(long, value_name = "N", default_value_t = 20, value_parser = clap::value_parser!(u64).range(1..))]
    seeds: u64,
    /// Table of another camera of the same scene, whose readings are known in advance; repeat for
    /// more
    #[arg(long, value_name = "TABLE")]
    known: Vec<PathBuf>,
    /// Errors at which the least known power is compared with the table's
    #[arg(long, value_name = "E1,E2,…", value_delimiter = ',', default_value = "0.01,0.02,0.04", value_parser = error, allow_hyphen_values = true)]
    errors: Vec<f64>,
    /// Tolerance above the table's least power
    #[arg(long, value_name = "PERCENT", default_value = "5%", value_parser = share, allow_hyphen_values = true)]
    within: f64,
    /// Result for programs
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// The result for programs.
#[derive(Serialize)]
struct SearchResult<'a> {
    table: &'a Path,
    known: &'a [PathBuf],
    combinations: usize,
    seeds: u64,
    within: f64,
    goals: &'a [Goal],
    methods: &'a [MethodResult],
}

pub(super) fn run(arguments: &Arguments) -> Result<(), CliError> {
    check_outputs([arguments.json.as_ref()])?;
    let known_knobs = crate::stage::every_knob()?;
    let read = |path: &PathBuf| SweepTable::open(path, &known_knobs).map_err(CliError::usage);
    let table = read(&arguments.table)?;
    let others = arguments.known.iter().map(read).collect::<Result<Vec<_>, _>>()?;
    let fault = |path: &Path, error: &dyn std::fmt::Display| {
        CliError::usage(format!("{}: {error}", path.display()))
    };
    let recorded = Recorded::new(&table, &others)
        .map_err(|(number, error)| fault(&arguments.known[number], &error))?;
    let runs = SearchRuns {
        errors: arguments.errors.clone(),
        within: arguments.within,
        seeds: arguments.seeds,
        batch: Extent::WHOLE.batch,
    };
    let goals = runs.goals(&recorded).map_err(|error| fault(&arguments.table, &error))?;
    println!("{}", heading(&arguments.table, &table, &recorded));
    let bar =
        progress::bar(runs.seeds * if others.is_empty() { 3 } else { 4 }).with_message("searches");
    let methods = run_searches(&recorded, &runs, &goals, &|| {
        bar.inc(1);
        if progress::interrupted() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    bar.finish_and_clear();
    let methods = methods.ok_or_else(|| CliError::failed("interrupted: nothing was written"))?;
    print!("{}", text(&runs, &goals, &methods));
    let Some(path) = &arguments.json else { return Ok(()) };
    let combinations = recorded.costs.len();
    let (table, known) = (&arguments.table, &arguments.known);
    let result = SearchResult {
        table,
        known,
        combinations,
        seeds: runs.seeds,
        within: runs.within,
        goals: &goals,
        methods: &methods,
    };
    write(path, &json(&result)?)
}

fn heading(path: &Path, table: &SweepTable, recorded: &Recorded) -> String {
    let (held, all) = (recorded.costs.len(), recorded.space.combinations());
    let mut text = format!(
        "{}: {held} of {all} combinations of {} knobs",
        path.display(),
        recorded.space.len()
    );
    if let Some(meter) = &table.facts.meter {
        let how = match meter.provenance {
            Provenance::Measured => "measured",
            Provenance::Modelled => "modelled",
        };
        let _ = write!(text, "; power is {how} by {}", meter.name);
    }
    if table.facts.layout().is_none() {
        let [width, height] = ASSUMED_LAYOUT.size;
        let _ = write!(
            text,
            "; it does not say what it was rendered at, so work is that of {width}x{height} with one light and a sky"
        );
    }
    text
}

/// A row for each goal and method.
fn text(runs: &SearchRuns, goals: &[Goal], methods: &[MethodResult]) -> String {
    let (percent, seeds) = (100.0 * runs.within, runs.seeds);
    let mut text = format!(
        "Renderings until the least known power is within {percent:.3} % of the table's, {seeds} seeds:\n\n"
    );
    let heads =
        ["best W", "reached", "25 %", "median", "75 %"].map(|head| format!("{head:>10}")).concat();
    let _ = writeln!(text, "{:8}{:12}{heads}", "error", "method");
    for (index, goal) in goals.iter().enumerate() {
        for method in methods {
            let (result, name) = (&method.goals[index], method.method.name());
            let _ = write!(
                text,
                "{:<8}{name:12}{:10.3}{:>10}",
                goal.error,
                goal.best_w,
                format!("{:.0} %", 100.0 * result.reached)
            );
            let Spread { lower_quartile, median, upper_quartile } = result.spread;
            let count = |count: f64| format!("{count:.1}");
            let counts = [lower_quartile, median, upper_quartile]
                .map(|value| format!("{:>10}", value.map_or("-".to_owned(), count)));
            let _ = writeln!(text, "{}", counts.concat());
        }
    }
    for method in methods.iter().filter(|method| method.missing > 0) {
        let _ = writeln!(
            text,
            "{} requested up to {} combinations that the table lacks",
            method.method.name(),
            method.missing
        );
    }
    text
}

/// A number above 0.
fn error(text: &str) -> Result<f64, String> {
    let number =
        text.trim().parse().ok().filter(|number: &f64| number.is_finite() && *number > 0.0);
    number.ok_or_else(|| "an error must be a finite number above 0".to_owned())
}

/// `5%`.
fn share(text: &str) -> Result<f64, String> {
    let number = text.trim().strip_suffix('%').and_then(|number| number.trim().parse().ok());
    let percent = number.filter(|percent: &f64| percent.is_finite() && *percent >= 0.0);
    percent
        .map(|percent| percent / 100.0)
        .ok_or_else(|| "expected a percentage of 0 or more, as in 5%".to_owned())
}
