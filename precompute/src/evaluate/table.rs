//! Evaluations as text: the table of `frugal evaluate`, and every frame as CSV.

use std::fmt::Write as _;
use std::io;

use frugal_core::knobs::KnobSpace;

use frugal_search::evaluate::{EvaluationResult, RunResult};

/// Heads of the columns of [`table`].
pub(crate) const TABLE_HEADERS: [&str; 7] =
    ["run", "mean W", "mean error", "max error", "over budget", "switches", "met"];

/// The row of a run.
pub(crate) fn table_row(run: &RunResult) -> [String; 7] {
    [
        run.name.clone(),
        format!("{:.3}", run.mean_power_w.0),
        format!("{:.4}", run.mean_error),
        format!("{:.4}", run.max_error),
        run.frames_over_budget.to_string(),
        run.switches.to_string(),
        if run.met { "yes" } else { "no" }.to_owned(),
    ]
}

/// What was played, metered and asked for.
pub(crate) fn headline(result: &EvaluationResult) -> String {
    let EvaluationResult { scene, path, frames, fps, size: [width, height], meter, .. } = result;
    let limit = result.budget.power_w.map(|limit| format!(" (power {:.3} W)", limit.0));
    format!(
        "{scene}, path {path}: {frames} frames at {fps} fps, {width}×{height}. Power is {} by {}. Budget: {}{}.",
        meter.provenance,
        meter.name,
        result.asked,
        limit.unwrap_or_default()
    )
}

/// `result` as plain text; every line ends with a line break.
pub(crate) fn table(result: &EvaluationResult) -> String {
    let rows: Vec<[String; 7]> = result.runs.iter().map(table_row).collect();
    let heads = TABLE_HEADERS.map(str::to_owned);
    let width = |column: usize| {
        let cells = rows.iter().chain([&heads]).map(|row| row[column].len());
        cells.max().unwrap_or(0)
    };
    let widths: [usize; 7] = std::array::from_fn(width);
    let rules = widths.map(|width| "-".repeat(width));
    let mut text = headline(result) + "\n\n";
    for row in [&heads, &rules].into_iter().chain(&rows) {
        let cells = row.iter().zip(widths).enumerate().map(|(column, (cell, width))| {
            // Names and words to the left, numbers to the right.
            if column == 0 || column == 6 {
                format!("{cell:<width$}")
            } else {
                format!("{cell:>width$}")
            }
        });
        let _ = writeln!(text, "{}", cells.collect::<Vec<_>>().join("  ").trim_end());
    }
    text.push('\n');
    for note in notes(result) {
        let _ = writeln!(text, "{note}");
    }
    for warning in &result.warnings {
        let _ = writeln!(text, "warning: {warning}");
    }
    text
}

/// What the table does not say of a result, as sentences.
pub(crate) fn notes(result: &EvaluationResult) -> Vec<String> {
    let mut notes = Vec::new();
    if let Some(check) = &result.spot_check {
        notes.push(format!(
            "The frugal run rendered: {:.3} W, {:.4}; simulated from the record: {:.3} W, {:.4}. Both go along the path once, the table's runs there and back.",
            check.mean_power_w.0,
            check.mean_error,
            check.recorded_mean_power_w.0,
            check.recorded_mean_error
        ));
        notes.push(format!(
            "The maximum played again after it: {:+.1}% power, mean error {:.4} against itself.",
            100.0 * result.drift.relative,
            result.drift.repeat_mean_error
        ));
    }
    if let Some(share) = result.runs.first().and_then(|run| run.windows_over) {
        notes.push(format!(
            "The frugal run is over the power budget by 2 % in {:.1} % of all {:.0} s.",
            100.0 * share,
            result.budget.horizon_s
        ));
    }
    let of_run = |run: &RunResult| Some(format!("{}: {}.", run.name, run.note.as_ref()?));
    notes.extend(result.runs.iter().filter_map(of_run));
    notes
}

/// Writes a row for every frame of every run: run, frame, time in seconds, power in watts, error,
/// the prediction of both (empty without one), settings packed and in words.
///
/// # Errors
/// When `to` cannot be written.
pub(crate) fn frames_csv(
    result: &EvaluationResult,
    space: &KnobSpace,
    to: impl io::Write,
) -> Result<(), csv::Error> {
    let mut writer = csv::Writer::from_writer(to);
    let columns =
        "run,frame,time_s,power_w,error,predicted_power_w,predicted_error,settings_bits,settings";
    writer.write_record(columns.split(','))?;
    for run in &result.runs {
        for (number, frame) in run.series.iter().enumerate() {
            let predicted =
                |value: Option<f64>| value.map(|value| value.to_string()).unwrap_or_default();
            writer.write_record([
                run.name.clone(),
                number.to_string(),
                frame.time.to_string(),
                frame.power.0.to_string(),
                frame.error.to_string(),
                predicted(frame.predicted.map(|cost| cost.power.0)),
                predicted(frame.predicted.map(|cost| cost.error)),
                frame.settings.bits().to_string(),
                space.describe(frame.settings),
            ])?;
        }
    }
    writer.flush()?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use frugal_search::testing::formula::{judged, space};

    use super::*;

    fn result() -> EvaluationResult {
        let mut result = judged(Some("10%"), None);
        let real = result.runs[0].series.clone();
        result.add_check(&real, &real, Default::default());
        result
    }

    #[test]
    fn columns_are_aligned_and_nothing_is_left_out() {
        let result = result();
        let text = table(&result);
        let lines: Vec<&str> = text.lines().collect();
        assert!(
            lines[0].contains("10 frames at 5 fps, 16×12. Power is modelled by formula"),
            "{text}"
        );
        assert!(lines[0].contains("power at most 10% (power 1.329 W)"), "{text}");
        let ends = |line: &str| line.find("error").map(|at| at + "error".len());
        assert_eq!(lines[2].len(), lines[3].len());
        assert_eq!(ends(lines[2]), Some("trained-constant  mean W  mean error".len()));
        assert_eq!(
            lines[4..11].iter().map(|line| line.split_whitespace().count()).collect::<Vec<_>>(),
            [7; 7]
        );
        let power = format!("{:.3}", result.runs[0].mean_power_w.0);
        assert!(lines[4].starts_with(&format!("frugal             {power} ")), "{text}");
        assert!(text.contains("resolution-only: no resolution meets the budget"), "{text}");
        assert!(text.contains(&format!("simulated from the record: {power} W")), "{text}");
        assert!(lines.iter().all(|line| line.trim_end() == *line));
    }

    #[test]
    fn csv_has_a_row_for_every_frame() {
        let mut bytes = Vec::new();
        frames_csv(&result(), &space(), &mut bytes).unwrap();
        let mut reader = csv::Reader::from_reader(&bytes[..]);
        let rows: Vec<csv::StringRecord> = reader.records().map(Result::unwrap).collect();
        // Seven runs of fifteen ways there and back.
        assert_eq!(rows.len(), 7 * 15 * 20);
        let of = |run: &str| rows.iter().find(|row| &row[0] == run).expect("a row");
        assert_eq!(&of("minimum")[8], "gi_vpl_count=0,resolution_scale=50%,antialiasing=off");
        assert_eq!(&of("minimum")[5], "", "a fixed policy predicts nothing");
        assert_ne!(&of("frugal")[5], "");
    }
}
