//! The report of `frugal evaluate`.

use frugal_search::evaluate::{EvaluationResult, FrameRecord, RunResult};

use crate::evaluate::{TABLE_HEADERS, headline, notes, table_row};

use super::{Axis, Curve, GREY, Mark, Plot, RED, RGBColor, Report, SERIES, provenance};

/// A page on `result`.
///
/// # Errors
/// When a plot fails.
pub(crate) fn evaluation_report(result: &EvaluationResult) -> Result<String, String> {
    let mut report =
        Report::new(&format!("Power and error along {} in {}", result.path, result.scene));
    report.section(&format!("{}, path {}: {}", result.scene, result.path, result.asked));
    report.paragraph(&headline(result));
    report.paragraph(&format!(
        "{} Watts are power at the target frame rate. Error is 1 − SSIM of a frame against the same frame at the highest settings: 0 is equal.",
        provenance(&result.meter)
    ));
    result.warnings.iter().for_each(|warning| report.warning(warning));
    let is_drawn = |name: &&str| result.runs.iter().any(|run| run.name == **name);
    let drawn = OVER_TIME.iter().copied().filter(is_drawn);
    report.legend(drawn.map(|name| (name, color(name))).chain(limit_entry(result)));
    report.plots(&plots(result)?);
    let (headers, rows) = table(result);
    report.table("Every run played the same frames.", &headers, &rows);
    for note in notes(result) {
        report.paragraph(&note);
    }
    Ok(report.render())
}

fn limit_entry(result: &EvaluationResult) -> Option<(&'static str, RGBColor)> {
    (result.budget.power_w.is_some() || result.budget.error.is_some())
        .then_some(("budget (dashed)", RED))
}

/// Runs drawn over time, where they exist: more curves could not be told apart.
const OVER_TIME: [&str; 4] = ["frugal", "trained-constant", "oracle", "maximum"];

fn color(run: &str) -> RGBColor {
    OVER_TIME.iter().position(|name| *name == run).map_or(GREY, |at| SERIES[at])
}

fn plots(result: &EvaluationResult) -> Result<Vec<(&'static str, String)>, String> {
    let budget = &result.budget;
    let marks: Vec<Mark> = result
        .runs
        .iter()
        .map(|run| Mark {
            name: run.name.clone(),
            at: (run.mean_power_w.0, run.mean_error),
            color: color(&run.name),
        })
        .collect();
    let means = Plot {
        label: "Mean error against mean power",
        marks: &marks,
        limit: budget.error,
        ..Plot::default()
    };
    let mut plots = vec![(
        "Mean error against mean power: a run is better than those above it and to its right",
        means.svg([Axis::POWER, Axis::ERROR])?,
    )];
    let over_time = |value: fn(&FrameRecord) -> f64| -> Vec<Curve> {
        let drawn = OVER_TIME.iter().filter_map(|name| {
            let run = result.runs.iter().find(|run| run.name == *name)?;
            let points = run.series.iter().map(|frame| (frame.time, value(frame))).collect();
            let width = if *name == OVER_TIME[0] { 3 } else { 2 };
            Some(Curve { color: color(name), width, points })
        });
        drawn.filter(|curve| !curve.points.is_empty()).collect()
    };
    let mut add = |label, curves: Vec<Curve>, limit, axis| -> Result<(), String> {
        if !curves.is_empty() {
            let plot = Plot { label, curves: &curves, limit, ..Plot::default() };
            plots.push((label, plot.svg([Axis::TIME, axis])?));
        }
        Ok(())
    };
    let watts = budget.power_w.map(|watts| watts.0);
    let power = over_time(|frame| frame.power.0);
    add("Power along the path", power, watts, Axis::linear("power, W"))?;
    add("Error along the path", over_time(|frame| frame.error), budget.error, Axis::ERROR)?;
    Ok(plots)
}

/// The columns of the printed table, and the settings.
fn table(result: &EvaluationResult) -> (Vec<&'static str>, Vec<Vec<String>>) {
    let row = |run: &RunResult| {
        let settings =
            run.settings.as_ref().map_or("vary".to_owned(), |settings| settings.replace(',', ", "));
        table_row(run).into_iter().chain([settings]).collect()
    };
    let headers = TABLE_HEADERS.into_iter().chain(["settings"]);
    (headers.collect(), result.runs.iter().map(row).collect())
}

#[cfg(test)]
mod tests {
    use frugal_search::testing::formula::judged;

    use super::*;

    #[test]
    fn a_report_contains_request_results_and_conditions() {
        let mut result = judged(Some("60%"), Some(0.05));
        result.scene = "<court>".to_owned();
        let html = evaluation_report(&result).unwrap();
        for text in [
            "power at most 60%, error at most 0.05",
            "was not measured. It was computed by the model formula",
            "&lt;court&gt;",
            "resolution-only",
            "10 frames at 5 fps",
            "16×12",
        ] {
            assert!(html.contains(text), "{text}");
        }
        assert_eq!(html.matches("<svg ").count(), 3);
        // Read back from JSON, an evaluation has no frames, and still a report.
        let json = serde_json::to_string(&result).unwrap();
        let bare = evaluation_report(&serde_json::from_str(&json).unwrap()).unwrap();
        assert_eq!(bare.matches("<svg ").count(), 1);
    }
}
