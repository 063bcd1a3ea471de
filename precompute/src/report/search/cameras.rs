//! Cameras from above, and the settings that the controller selects at each.

use frugal_core::control::Budget;
use frugal_core::knobs::KnobLevels;
use frugal_search::cameras::MovingCamera;

use super::{SearchSummary, mean_cost, selected, training_cameras};
use crate::report::Color;
use crate::report::plan::Plan;

/// The error budget under which settings are selected.
pub(super) const PLAN_BUDGET: f64 = 0.02;
/// Greatest number of settings with colours of their own.
const COLORS: usize = Color::SERIES.len();

/// Cameras from above, each a wedge in its direction, and the legend of their colours.
pub(super) fn plan(summary: &SearchSummary<'_>) -> (String, Vec<(String, Color)>) {
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
        let power = mean_cost(summary.outcome, *settings).map_or(f64::NAN, |cost| cost.power.0);
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
