//! `frugal inspect`: summary of a map, presets from it, and a check of its power against an older
//! map.

use std::path::{Path, PathBuf};

use frugal_core::frontier::FrontierMap;

use super::CliError;
use super::arguments::{check_outputs, check_report, json, write, write_report};
use super::input::read_map;
use crate::inspect::{MapComparison, compare, comparison_table, presets, presets_table};
use crate::report::{map_facts, map_report};
use frugal_search::evaluate::PowerBudget;

#[derive(clap::Args, Debug)]
pub(super) struct Arguments {
    /// The map
    #[arg(value_name = "MAP")]
    map: PathBuf,
    /// Folder for a page with images
    #[arg(long, value_name = "DIR")]
    report: Option<PathBuf>,
    /// Presets to write: battery, low, medium, high and ultra, from the map's shared frontier
    #[arg(long, value_name = "FILE")]
    presets: Option<PathBuf>,
    /// Older map to compare power at equal error with; the exit status is 3 if it rose by more than
    /// the tolerance
    #[arg(long, value_name = "OLD", conflicts_with_all = ["report", "presets"])]
    compare: Option<PathBuf>,
    /// Compare although the watts are of two devices, or of two models of power: a difference of the
    /// devices then looks like one of the builds
    #[arg(long, requires = "compare")]
    any_device: bool,
    /// Tolerated rise of power at equal error
    #[arg(long, value_name = "P%", default_value = "1%", value_parser = tolerance, requires = "compare", allow_hyphen_values = true)]
    tolerance: f64,
    /// Comparison for programs
    #[arg(long, value_name = "FILE", requires = "compare")]
    json: Option<PathBuf>,
}

/// `1.5%`, as a share.
fn tolerance(text: &str) -> Result<f64, String> {
    match PowerBudget::read(text) {
        Some(PowerBudget::Share(share)) if (0.0..=1.0).contains(&share) => Ok(share),
        _ => Err("expected a percentage from 0% to 100%, as in 1%".to_owned()),
    }
}

/// The comparison as JSON.
#[derive(serde::Serialize)]
struct Gate<'a> {
    old: &'a Path,
    new: &'a Path,
    tolerance: f64,
    rose: bool,
    #[serde(flatten)]
    comparison: &'a MapComparison,
}

pub(super) fn run(arguments: &Arguments) -> Result<(), CliError> {
    check_outputs([arguments.presets.as_ref(), arguments.json.as_ref()])?;
    check_report(arguments.report.as_ref())?;
    match &arguments.compare {
        Some(old) => compare_maps(arguments, old),
        None => summarise(arguments),
    }
}

/// Prints the map's summary, and writes the requested files.
fn summarise(arguments: &Arguments) -> Result<(), CliError> {
    let (map, text) = read_map(&arguments.map)?;
    // Checked before anything is printed or written: a map without presets is invalid input.
    let presets = arguments
        .presets
        .as_ref()
        .map(|path| presets_of(&map, &arguments.map).map(|both| (path, both)))
        .transpose()?;
    for (name, value) in map_facts(&map) {
        println!("{name:<10} {value}");
    }
    println!("file       {} bytes", text.len());
    if let Some((path, (table, file))) = presets {
        print!("\n{table}");
        write(path, file.as_bytes())?;
    }
    if let Some(folder) = &arguments.report {
        let file = ("file", arguments.map.display().to_string());
        write_report(folder, &map_report(&map, &[file]).map_err(CliError::failed)?)?;
    }
    Ok(())
}

/// The map's presets as a table and as a file.
fn presets_of(map: &FrontierMap, path: &Path) -> Result<(String, String), CliError> {
    let presets = presets(map).map_err(|error| CliError::in_file(path, error))?;
    let file = presets.to_ron().map_err(CliError::failed)?;
    Ok((presets_table(&presets), file))
}

/// Compares the map with an older one; a rise of power is an error with its own exit status, after
/// everything is written.
fn compare_maps(arguments: &Arguments, old: &Path) -> Result<(), CliError> {
    let ((old_map, _), (new_map, _)) = (read_map(old)?, read_map(&arguments.map)?);
    let comparison = compare(&old_map, &new_map, arguments.any_device).map_err(|error| {
        CliError::usage(format!("{} and {}: {error}", old.display(), arguments.map.display()))
    })?;
    print!("{}", comparison_table(&comparison));
    if !crate::device::is_same(&old_map.meter, &new_map.meter) {
        println!(
            "the watts are of two devices or models: {}; {}",
            old_map.meter.description, new_map.meter.description
        );
    }
    let (tolerance, rose) = (arguments.tolerance, comparison.rose_beyond(arguments.tolerance));
    if let Some(path) = &arguments.json {
        write(
            path,
            &json(&Gate { old, new: &arguments.map, tolerance, rose, comparison: &comparison })?,
        )?;
    }
    let (percent, tolerated) = (100.0 * comparison.change, format!("{:.2} %", 100.0 * tolerance));
    if rose {
        let message = format!(
            "power at equal error rose by {percent:.2} %, more than the {tolerated} tolerated"
        );
        return Err(CliError { status: 3, message });
    }
    println!("power at equal error changed by {percent:+.2} %; a rise of {tolerated} is tolerated");
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tolerances_are_percentages() {
        assert_eq!(
            [" 1%", "0%", "2.5 %", "100%"].map(tolerance),
            [Ok(0.01), Ok(0.0), Ok(0.025), Ok(1.0)]
        );
        assert!(
            ["", "%", "1", "0.01", "-1%", "NaN%", "inf%", "101%", "one%"]
                .into_iter()
                .all(|text| tolerance(text).is_err())
        );
    }
}
