//! What a map selects for an error budget at a view.

use bevy_frugal_gi::control::{Budget, ErrorPrice, select};
use bevy_frugal_gi::frontier::{CameraView, Frontier, FrontierMap, look_up_in};
use bevy_frugal_gi::knobs::KnobLevels;

/// The controller's selection where the budget's pace rests at its calibrated rate; the best settings
/// where the map holds no frontier.
pub(super) fn settings(map: &FrontierMap, view: &CameraView, budget: f64) -> KnobLevels {
    let found = look_up_in(&map.octree, &map.bounds, view).map(|found| found.frontier);
    let frontier: &Frontier = found.filter(|frontier| !frontier.is_empty()).unwrap_or(&map.shared);
    let price = ErrorPrice::of_budget(&map.error_rates, budget);
    let choice = select(frontier, &Budget::error(budget), price);
    map.knobs.canonical(choice.map_or_else(|| map.knobs.highest(), |choice| choice.settings))
}
