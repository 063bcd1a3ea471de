//! A finished search, and what its report reads of it.

use frugal_core::control::{Budget, select};
use frugal_core::frontier::{CostPoint, FrontierMap};
use frugal_core::knobs::KnobLevels;
use frugal_search::cameras::{CameraSet, MovingCamera};
use frugal_search::pipeline::Outcome;

/// A finished search.
#[derive(Debug)]
pub(crate) struct SearchSummary {
    /// Its map.
    pub map: FrontierMap,
    /// Its outcome.
    pub outcome: Outcome,
    /// Its cameras.
    pub cameras: CameraSet,
}

/// Mean over the training cameras.
pub(super) fn mean_cost(outcome: &Outcome, settings: KnobLevels) -> Option<CostPoint> {
    let table = &outcome.training;
    table.mean(table.column(settings)?, 0..table.rows())
}

/// The training cameras that were rendered, each with its row in the table.
pub(super) fn training_cameras(
    summary: &SearchSummary,
) -> impl Iterator<Item = (usize, &MovingCamera)> {
    let (outcome, cameras) = (&summary.outcome, &summary.cameras);
    let cameras = outcome.training_cameras.iter().map(|camera| cameras.training.get(*camera));
    cameras.enumerate().filter_map(|(row, camera)| Some((row, camera?)))
}

/// The settings selected at the camera of `row`, by a frontier fitted without it.
pub(super) fn selected(summary: &SearchSummary, row: usize, budget: &Budget) -> Option<KnobLevels> {
    let frontier = summary.outcome.fitted.held_out.get(row)?;
    let rate = budget.error.and_then(|error| summary.map.error_rates.rate(error));
    match rate {
        Some(rate) => frontier.least_sum(rate).map(|point| point.settings),
        None => select(frontier, budget).map(|choice| choice.settings),
    }
}
