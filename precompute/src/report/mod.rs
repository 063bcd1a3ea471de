//! Reports: one self-contained HTML file each, with embedded plots, for light and dark mode and for
//! phones.
//!
//! A [`Report`] is a title and sections.
//!
//! | part | job |
//! |---|---|
//! | `page` | the page: headings, tables, figures, escaping, style |
//! | `plot` | SVG plots: curves and names over linear or logarithmic axes |
//! | `evaluation` | `frugal evaluate` |
//! | `map` | `frugal inspect` |
//! | `search` | `frugal precompute`: cameras, error at equal power, influence of knobs, effort |
//! | `control_log` | `frugal plot-log` |
mod control_log;
mod evaluation;
mod map;
mod page;
mod plot;
mod search;

use frugal_core::frontier::FrontierPoint;
use frugal_core::knobs::KnobSpace;
use frugal_core::power::{MeterInfo, Provenance};
use plotters::style::RGBColor;

pub(crate) use control_log::{
    control_log_report, facts as control_log_facts, heading as control_log_heading,
};
pub(crate) use evaluation::evaluation_report;
pub(crate) use map::{map_facts, map_report, map_section};
pub(crate) use page::Report;
use plot::{Axis, BLUE, Curve, GREY, Mark, Plot, RED, SERIES, escape, staircase};
pub(crate) use search::{SearchSummary, search_facts, search_section};

/// A name and a value.
pub(crate) type Fact = (&'static str, String);

/// A share as a percentage.
fn percent(share: f64) -> String {
    format!("{:.1} %", 100.0 * share)
}

/// Describes the power meter in a sentence.
fn provenance(meter: &MeterInfo) -> String {
    let how = match meter.provenance {
        Provenance::Measured => "measured, by the meter",
        Provenance::Modelled => "not measured. It was computed by the model",
    };
    format!("Power was {how} {}: {}.", meter.name, meter.description)
}

/// Adds a table of cost points: only knobs that differ get a column.
fn settings_table(report: &mut Report, caption: &str, space: &KnobSpace, points: &[FrontierPoint]) {
    let label = |knob: usize, point: &FrontierPoint| {
        let level = space.knobs()[knob].levels.get(point.settings.level(knob));
        level.map_or("?", |level| level.label.as_str()).to_owned()
    };
    let level = |knob: usize| points.iter().map(move |point| point.settings.level(knob));
    let (same, varying): (Vec<usize>, Vec<usize>) =
        (0..space.len()).partition(|knob| level(*knob).all(|it| Some(it) == level(*knob).next()));
    let name = |knob: &usize| space.knobs()[*knob].name.as_str();
    let headers: Vec<&str> =
        ["power, W", "error"].into_iter().chain(varying.iter().map(name)).collect();
    let rows = points.iter().map(|point| {
        let cost = [format!("{:.3}", point.cost.power.0), format!("{:.4}", point.cost.error)];
        cost.into_iter().chain(varying.iter().map(|knob| label(*knob, point))).collect::<Vec<_>>()
    });
    report.table(caption, &headers, &rows.collect::<Vec<_>>());
    if let Some(first) = points.first().filter(|_| !same.is_empty()) {
        let same = same.iter().map(|knob| format!("{}={}", name(knob), label(*knob, first)));
        let same = same.collect::<Vec<_>>().join(", ");
        report.paragraph(&format!("All of these have {same}."));
    }
}
