//! The outcome of a search in words.

use frugal_search::pipeline::Extent;

use crate::report::{SearchSummary, search_facts};

/// Prints the facts of a search, and what a longer one would do better.
pub(super) fn print_outcome(searched: &SearchSummary) {
    for (name, value) in search_facts(searched) {
        println!("{name:<34} {value}");
    }
    let SearchSummary { outcome, cameras, .. } = searched;
    let wanted = [cameras.training.len(), cameras.calibration.len()];
    if outcome.cameras[0] < wanted[0] || outcome.cameras[1] < wanted[1] {
        println!(
            "the time limit ended the run before all cameras: a longer one gives a better map"
        );
    }
    if outcome.fitted.shared.points().len() < 2 {
        println!(
            "the map has one setting: no knob saves power here. Search with the app's own --size, and with its lights and effects"
        );
    }
    let (extent, whole, (made, seconds)) = (outcome.extent, Extent::WHOLE, outcome.effort);
    if extent != whole && made > 0 {
        let minutes = (seconds / made as f64 * Extent::WHOLE_RENDERINGS as f64 / 60.0).ceil();
        println!(
            "a short search: {} pilot cameras and at most {} settings; with {minutes} minutes it would have {} and {}",
            extent.pilots, extent.pool, whole.pilots, whole.pool
        );
    }
}
