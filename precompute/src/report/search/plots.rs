//! Plots of a search: cameras, error at equal power, influence of knobs, calibration.

use frugal_core::control::Budget;
use frugal_core::frontier::{CostPoint, Frontier, FrontierPoint};
use frugal_core::knobs::KnobLevels;
use frugal_search::cameras::MovingCamera;

use super::summary::{SearchSummary, mean_cost, selected, training_cameras};
use crate::report::plan::Plan;
use crate::report::{Axis, Bar, Color, Curve, Plot, ReportError, bars, staircase};

/// The error budget under which settings are selected.
pub(super) const PLAN_BUDGET: f64 = 0.02;
/// Greatest number of settings with colours of their own.
const COLORS: usize = Color::SERIES.len();

/// Cameras from above, each a wedge in its direction, and the legend of their colours.
pub(super) fn plan(summary: &SearchSummary) -> (String, Vec<(String, Color)>) {
    let budget = Budget::error(PLAN_BUDGET);
    let played: Vec<(MovingCamera, Option<KnobLevels>)> = training_cameras(summary)
        .map(|(row, camera)| (*camera, selected(summary, row, &budget)))
        .collect();
    let mut counts: Vec<(KnobLevels, usize)> = Vec::new();
    for settings in played.iter().filter_map(|(_, settings)| *settings) {
        match counts.iter_mut().find(|(known, _)| *known == settings) {
            Some((_, count)) => *count += 1,
            None => counts.push((settings, 1)),
        }
    }
    counts.sort_by_key(|(settings, count)| (std::cmp::Reverse(*count), settings.bits()));
    let color = |settings: Option<KnobLevels>| {
        counts
            .iter()
            .take(COLORS)
            .position(|(known, _)| Some(*known) == settings)
            .map_or(Color::GREY, |rank| Color::SERIES[rank])
    };
    let legend = counts.iter().take(COLORS).enumerate().map(|(rank, (settings, count))| {
        let power = mean_cost(&summary.outcome, *settings).map_or(f64::NAN, |cost| cost.power.0);
        (format!("{power:.2} W, {count} cameras"), Color::SERIES[rank])
    });
    let mut legend: Vec<_> = legend.collect();
    if counts.len() > COLORS {
        legend.push(("other settings".to_owned(), Color::GREY));
    }
    let (min, max) = (summary.map.bounds.min, summary.map.bounds.max);
    let mut plan = Plan::new("Cameras from above", min, max);
    plan.outline(min, max);
    for camera in summary.cameras.calibration.iter().take(summary.outcome.cameras[1]) {
        plan.ring(camera.pose.position);
    }
    for (camera, settings) in &played {
        plan.wedge(camera.pose.position, camera.pose.forward(), color(*settings));
    }
    (plan.finish(), legend)
}

/// Exchange rates of error against power, watts per unit of error, from 10 to the power of −2 to 6.
fn rates() -> impl Iterator<Item = f64> {
    (0..=160).map(|step| 10f64.powf(-2.0 + 0.05 * f64::from(step)))
}

/// Mean error against mean power over the training cameras: by view at one exchange rate, from
/// frontiers fitted without that view, and of constant settings.
pub(super) fn equal_power(summary: &SearchSummary) -> Result<String, ReportError> {
    let table = &summary.outcome.training;
    let constants: Vec<CostPoint> = (0..table.settings().len())
        .filter_map(|column| table.mean(column, 0..table.rows()))
        .collect();
    let mean = |rate: f64| {
        let costs: Option<Vec<CostPoint>> = (0..table.rows())
            .map(|row| {
                let frontier = summary.outcome.fitted.held_out.get(row)?;
                table.get(row, frontier.least_sum(rate)?.settings)
            })
            .collect();
        let costs = costs.filter(|costs| !costs.is_empty())?;
        let mean = |value: fn(&CostPoint) -> f64| {
            costs.iter().map(value).sum::<f64>() / costs.len() as f64
        };
        Some((mean(|cost| cost.power.0), mean(|cost| cost.error)))
    };
    let by_view =
        Curve { color: Color::BLUE, width: 2, points: rates().filter_map(mean).collect() };
    let points =
        constants.iter().map(|cost| FrontierPoint { settings: KnobLevels::default(), cost: *cost });
    let best = staircase(&Frontier::from_points(points));
    let best = Curve { color: Color::SERIES[1], width: 2, points: best };
    let plot = Plot {
        label: "Mean error at equal mean power",
        curves: &[by_view, best],
        ..Plot::default()
    };
    plot.svg([Axis::POWER, Axis::ERROR])
}

/// A bar for each knob with effect.
pub(super) fn influence(summary: &SearchSummary) -> Result<String, ReportError> {
    let (space, screening) = (&summary.map.knobs, &summary.outcome.screening);
    let mut rows: Vec<Bar> = Vec::new();
    for (index, knob) in space.knobs().iter().enumerate() {
        if screening.without_effect.contains(&index) {
            continue;
        }
        let value = screening.effects.get(index).into_iter().flatten().copied().fold(0.0, f64::max);
        rows.push(Bar { name: knob.name.clone(), value, color: Color::BLUE });
    }
    rows.sort_by(|a, b| b.value.total_cmp(&a.value).then_with(|| a.name.cmp(&b.name)));
    bars("Influence of knobs", "error, 1 − SSIM", &rows, 3)
}

/// Budgets, and the predicted errors that keep them.
pub(super) fn calibration(summary: &SearchSummary) -> Result<String, ReportError> {
    let known = summary.map.error_rates.0.iter();
    let points: Vec<(f64, f64)> =
        known.filter_map(|rate| Some((rate.budget, rate.predicted?))).collect();
    let straight = points.iter().map(|(budget, _)| (*budget, *budget)).collect();
    let curves = [
        Curve { color: Color::BLUE, width: 2, points },
        Curve { color: Color::GREY, width: 1, points: straight },
    ];
    let plot = Plot { label: "Calibration of error budgets", curves: &curves, ..Plot::default() };
    plot.svg(["error budget", "predicted error"].map(|name| Axis { name, is_log: true }))
}
