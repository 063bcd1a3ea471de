//! The report of `frugal plot-log`: what a controller did in an app.

use bevy_frugal_gi_tools::control_log::ControlSample;

use super::{Axis, BLUE, Curve, Fact, GREY, Plot, RED, RGBColor, Report, percent};
use crate::control_log::{CameraLog, changes};

/// Most points of a curve; neighbouring ones of a longer log are joined.
const MOST_POINTS: usize = 1000;

/// A page with a section for each of `logs`; `name`: the file's.
///
/// # Errors
/// When a plot fails.
pub(crate) fn control_log_report(name: &str, logs: &[CameraLog]) -> Result<String, String> {
    let mut report = Report::new(&format!("Budgets of an app: {name}"));
    for log in logs {
        section(&mut report, log)?;
    }
    Ok(report.render())
}

/// Name of a log: its run and camera.
pub(crate) fn heading(log: &CameraLog) -> String {
    format!("run {}, camera {}", log.run, log.camera)
}

/// Figures of a log, with names.
pub(crate) fn facts(log: &CameraLog) -> Vec<Fact> {
    let number = |value: Option<f64>, unit: &str, decimals: usize| {
        value.map_or("unknown".to_owned(), |value| format!("{value:.decimals$}{unit}"))
    };
    let statuses: Vec<String> = log
        .statuses()
        .iter()
        .map(|(status, share)| format!("{status} {}", percent(*share)))
        .collect();
    let mut facts = vec![
        ("Duration", format!("{:.1} s, {} samples", log.seconds(), log.samples.len())),
        ("Status", statuses.join(", ")),
        ("Predicted power", number(log.mean(|sample| sample.predicted_w), " W", 3)),
    ];
    let meter =
        log.samples.iter().map(|sample| sample.meter.as_str()).find(|name| !name.is_empty());
    if let Some(meter) = meter {
        let metered = number(log.mean(|sample| sample.metered_w), " W", 3);
        facts.push(("Metered power", format!("{metered} of the whole app, by {meter}")));
    }
    let (windows, over) = log.windows_over();
    if windows > 0 {
        let share = percent(over as f64 / windows as f64);
        facts.push((
            "Over budget",
            format!("{over} of {windows} windows of 1 s by more than 2 %: {share}"),
        ));
    }
    facts.push(("Predicted error", number(log.mean(|sample| sample.predicted_error), "", 4)));
    let measured: Vec<f64> =
        log.samples.iter().filter_map(|sample| sample.measured_error).collect();
    if !measured.is_empty() {
        let mean = measured.iter().sum::<f64>() / measured.len() as f64;
        facts.push((
            "Measured error",
            format!("{mean:.4}, mean of {} measurements", measured.len()),
        ));
    }
    if let Some(budget) = log.mean(|sample| sample.error_budget) {
        facts.push(("Error budget", number(Some(budget), "", 4)));
    }
    let frame = number(log.mean(|sample| sample.frame_ms), " ms", 2);
    let longest = number(log.longest_frame_ms(), " ms", 1);
    facts.push(("Frame time", format!("{frame}, at most {longest} after the first")));
    facts.push(("Switches", number(log.switches_per_second(), " a second", 2)));
    facts
}

fn section(report: &mut Report, log: &CameraLog) -> Result<(), String> {
    report.section(&heading(log));
    report.facts(&facts(log));
    let plot = |label: &'static str, axis: Axis<'_>, curves: Vec<Curve>| {
        let plot = Plot { label, curves: &curves, ..Plot::default() };
        (!curves.is_empty()).then(|| Ok((label, plot.svg([Axis::TIME, axis])?)))
    };
    let of =
        |color: RGBColor, value: fn(&ControlSample) -> Option<f64>| curve(log, color, value, mean);
    let power_limit = |sample: &ControlSample| {
        let own = sample.power_budget_w;
        [own, sample.app_budget_w].into_iter().flatten().reduce(f64::min)
    };
    let power = of(BLUE, |sample| sample.predicted_w)
        .into_iter()
        .chain(limits(log, power_limit))
        .chain(of(GREY, |sample| sample.metered_w));
    let error = of(BLUE, |sample| sample.predicted_error)
        .into_iter()
        .chain(limits(log, |sample| sample.error_budget))
        .chain(of(GREY, |sample| sample.measured_error));
    let longest = curve(log, GREY, |sample| sample.longest_frame_ms, greatest);
    let frame = of(BLUE, |sample| sample.frame_ms).into_iter().chain(longest);
    let plots = [
        plot("Power", Axis::linear("power, W"), power.collect()),
        plot("Error", Axis::ERROR, error.collect()),
        // An app loads for seconds, beside which all its frames would be one line.
        plot("Frame time", Axis::logarithmic("frame, ms"), frame.collect()),
    ];
    let plots = plots.into_iter().flatten().collect::<Result<Vec<_>, String>>()?;
    if !plots.is_empty() {
        report.legend([
            ("predicted; mean frame", BLUE),
            ("budget", RED),
            ("metered, measured; longest frame", GREY),
        ]);
        report.plots(&plots);
    }
    let row = |(name, changes, levels): (&str, usize, Vec<(&str, f64)>)| {
        let levels = levels.iter().take(6);
        let levels = levels.map(|(level, share)| format!("{level} {:.0} %", 100.0 * share));
        vec![name.to_owned(), changes.to_string(), levels.collect::<Vec<_>>().join(", ")]
    };
    let rows: Vec<Vec<String>> = changes(&log.samples).into_iter().map(row).collect();
    if rows.is_empty() {
        report.paragraph("No knob changed.");
    } else {
        report.table("Knobs that changed", &["knob", "changes", "levels, share of time"], &rows);
    }
    Ok(())
}

/// A value over time, of a long log `joined`; `None` where no sample has it.
fn curve(
    log: &CameraLog,
    color: RGBColor,
    value: impl Fn(&ControlSample) -> Option<f64>,
    joined: fn(&[(f64, f64)]) -> f64,
) -> Option<Curve> {
    let points: Vec<(f64, f64)> =
        log.samples.iter().filter_map(|sample| Some((sample.time_s, value(sample)?))).collect();
    let points = thinned(&points, joined);
    (!points.is_empty()).then_some(Curve { color, width: 2, points })
}

/// A limit over time: a curve for each time in which there is one.
fn limits(log: &CameraLog, limit: impl Fn(&ControlSample) -> Option<f64>) -> Vec<Curve> {
    let points = |samples: &[ControlSample]| -> Vec<(f64, f64)> {
        samples.iter().filter_map(|sample| Some((sample.time_s, limit(sample)?))).collect()
    };
    log.samples
        .chunk_by(|a, b| limit(a).is_some() == limit(b).is_some())
        .map(|samples| thinned(&points(samples), mean))
        .filter(|points| !points.is_empty())
        .map(|points| Curve { color: RED, width: 2, points })
        .collect()
}

/// At most [`MOST_POINTS`] points: neighbouring ones have one value, `joined`.
fn thinned(points: &[(f64, f64)], joined: fn(&[(f64, f64)]) -> f64) -> Vec<(f64, f64)> {
    let each = points.len().div_ceil(MOST_POINTS).max(1);
    points.chunks(each).map(|chunk| (chunk[chunk.len() / 2].0, joined(chunk))).collect()
}

fn mean(points: &[(f64, f64)]) -> f64 {
    points.iter().map(|point| point.1).sum::<f64>() / points.len() as f64
}

/// For what a mean would hide: one long frame among many.
fn greatest(points: &[(f64, f64)]) -> f64 {
    points.iter().map(|point| point.1).fold(f64::NEG_INFINITY, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control_log::cameras;

    fn log(count: usize) -> Vec<CameraLog> {
        let sample = |index: usize| ControlSample {
            time_s: 0.1 * index as f64,
            status: "met".into(),
            power_budget_w: Some(5.0),
            predicted_w: Some(4.5),
            metered_w: index.is_multiple_of(2).then_some(5.2),
            meter: "<rapl> (measured)".into(),
            frame_ms: Some(16.0),
            longest_frame_ms: Some(20.0),
            settings: format!("a={},b=1", index % 3),
            ..ControlSample::default()
        };
        cameras(&(0..count).map(sample).collect::<Vec<_>>())
    }

    #[test]
    fn the_page_has_figures_plots_and_knobs() {
        let page = control_log_report("<play>.csv", &log(100)).expect("a page");
        for text in [
            "&lt;play&gt;.csv",
            "run 1, camera 0",
            "met 100.0 %",
            "5.200 W of the whole app, by &lt;rapl&gt; (measured)",
            "10 of 10 windows of 1 s by more than 2 %: 100.0 %",
            "16.00 ms, at most 20.0 ms",
            "<td>a</td><td class=\"number\">99</td><td>0 34 %, 1 33 %, 2 33 %</td>",
        ] {
            assert!(page.contains(text), "{text}\n{page}");
        }
        // Power and frame time; no sample has an error.
        assert_eq!(page.matches("<svg ").count(), 2);
        assert!(!page.contains("<rapl>"), "escaped");
    }

    #[test]
    fn one_long_frame_shows_in_a_long_log_and_hides_no_others() {
        let mut log = log(3000);
        log[0].samples[1500].longest_frame_ms = Some(3000.0);
        let frames = curve(&log[0], GREY, |sample| sample.longest_frame_ms, greatest);
        let frames = frames.expect("a curve").points;
        assert!(frames.len() <= MOST_POINTS && frames[500].1 == 3000.0, "{:?}", frames[500]);
        let page = control_log_report("play.csv", &log).expect("a page");
        assert!(page.contains("\n1000\n") && !page.contains("\n2000\n"), "equal factors");
    }

    #[test]
    fn errors_measured_in_play_are_shown() {
        let mut log = log(100);
        for index in [3, 50, 70] {
            log[0].samples[index].measured_error = Some(0.01 * (index + 1) as f64);
        }
        let page = control_log_report("play.csv", &log).expect("a page");
        assert!(page.contains("0.4200, mean of 3 measurements"), "{page}");
        assert_eq!(page.matches("<svg ").count(), 3);
    }

    #[test]
    fn a_limit_has_a_curve_for_each_time_in_which_there_is_one() {
        let mut log = log(10).remove(0);
        log.samples[4].power_budget_w = None;
        let curves = limits(&log, |sample| sample.power_budget_w);
        assert_eq!(curves.iter().map(|curve| curve.points.len()).collect::<Vec<_>>(), [4, 5]);
        assert!(limits(&log, |sample| sample.error_budget).is_empty());
    }

    #[test]
    fn a_long_log_is_thinned_and_a_short_one_drawn() {
        let points: Vec<(f64, f64)> = (0..2500).map(|index| (f64::from(index), 1.0)).collect();
        let thin = thinned(&points, mean);
        assert!(thin.len() <= MOST_POINTS && thin[0] == (1.0, 1.0), "{:?}", thin[0]);
        assert!(control_log_report("one", &log(1)).is_ok());
        assert!(control_log_report("none", &[]).is_ok());
    }
}
