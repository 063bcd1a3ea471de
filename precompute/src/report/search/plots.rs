//! Plots of a search: cameras, costs, influence of knobs, regret at held-out cameras, calibration.

use frugal_core::control::{Budget, select};
use frugal_core::frontier::CostPoint;
use frugal_core::knobs::KnobLevels;
use frugal_core::units::Watts;
use frugal_search::cameras::MovingCamera;

use super::summary::{SearchSummary, mean_cost, selected, training_cameras};
use crate::report::plan::Plan;
use crate::report::{Bar, Color, Curve, ReportError, bars, cloud, curves, staircase};

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

/// Power budgets of the regret at held-out cameras, as shares of the range of power.
const REGRET_BUDGETS: [f64; 9] = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9];

/// Costs of the pool at every training camera, and the shared frontier.
pub(super) fn costs(summary: &SearchSummary) -> Result<String, ReportError> {
    let table = &summary.outcome.training;
    let points: Vec<(f64, f64)> = (0..table.settings().len())
        .flat_map(|column| table.known(column))
        .map(|(_, cost)| (cost.power.0, cost.error))
        .collect();
    let shared =
        Curve { color: Color::BLUE, width: 2, points: staircase(&summary.outcome.fitted.shared) };
    cloud("Costs of the pool", ["power, W", "error, 1 − SSIM"], &points, &[shared])
}

/// A bar for each knob with effect, and the names of the others.
pub(super) fn influence(summary: &SearchSummary) -> Result<(String, Vec<String>), ReportError> {
    let (space, screening) = (&summary.map.knobs, &summary.outcome.screening);
    let mut rows: Vec<Bar> = Vec::new();
    let mut without = Vec::new();
    for (index, knob) in space.knobs().iter().enumerate() {
        if screening.without_effect.contains(&index) {
            without.push(knob.name.clone());
            continue;
        }
        let value = screening.effects.get(index).into_iter().flatten().copied().fold(0.0, f64::max);
        rows.push(Bar { name: knob.name.clone(), value, color: Color::BLUE });
    }
    rows.sort_by(|a, b| b.value.total_cmp(&a.value).then_with(|| a.name.cmp(&b.name)));
    Ok((bars("Influence of knobs", "error, 1 − SSIM", &rows, 3)?, without))
}

/// Mean error of two selections at held-out cameras over that of the best selection, by budget.
pub(super) fn regret(summary: &SearchSummary) -> Result<String, ReportError> {
    let outcome = &summary.outcome;
    let table = &outcome.training;
    let mut ours = Curve { color: Color::BLUE, width: 2, points: Vec::new() };
    let mut shared = Curve { color: Color::GREY, width: 2, points: Vec::new() };
    let powers = outcome.fitted.shared.points();
    let Some((low, high)) = powers.first().zip(powers.last()) else {
        return curves("Regret", ["power budget, W", "share"], &[ours, shared], None);
    };
    for share in REGRET_BUDGETS {
        let watts = low.cost.power.0 + share * (high.cost.power.0 - low.cost.power.0);
        let budget = Budget::power(Watts(watts));
        let (mut least, mut picked, mut common) = (0.0, 0.0, 0.0);
        for (row, _) in training_cameras(summary) {
            let costs: Vec<CostPoint> = (0..table.settings().len())
                .filter_map(|column| table.at(row, column))
                .filter(|cost| cost.power.0 <= watts)
                .collect();
            let error = |settings: Option<KnobLevels>| Some(table.get(row, settings?)?.error);
            let one = select(&outcome.fitted.shared, &budget).map(|choice| choice.settings);
            let best = costs.iter().map(|cost| cost.error).fold(f64::INFINITY, f64::min);
            if let (Some(a), Some(b)) = (error(selected(summary, row, &budget)), error(one))
                && best.is_finite()
            {
                least += best;
                picked += a;
                common += b;
            }
        }
        if least > 0.0 {
            ours.points.push((watts, picked / least));
            shared.points.push((watts, common / least));
        }
    }
    curves(
        "Regret at held-out cameras",
        ["power budget, W", "error ÷ least"],
        &[ours, shared],
        Some(1.0),
    )
}

/// Budgets, and the predicted errors that keep them.
pub(super) fn calibration(summary: &SearchSummary) -> Result<String, ReportError> {
    let known = summary.map.error_rates.0.iter();
    let points: Vec<(f64, f64)> =
        known.filter_map(|rate| Some((rate.budget, rate.predicted?))).collect();
    let straight = points.iter().map(|(budget, _)| (*budget, *budget)).collect();
    cloud(
        "Calibration of error budgets",
        ["error budget", "predicted error"],
        &[],
        &[
            Curve { color: Color::BLUE, width: 2, points },
            Curve { color: Color::GREY, width: 1, points: straight },
        ],
    )
}
