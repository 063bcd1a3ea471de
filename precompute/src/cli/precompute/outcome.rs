//! The outcome of a search in words.

use frugal_search::pipeline::{Extent, describe};

use crate::report::SearchSummary;

/// Prints effort, losses, size of the map and accuracy of its figures.
pub(super) fn print_outcome(searched: &SearchSummary) {
    let SearchSummary { map, outcome, cameras } = searched;
    let (made, seconds) = outcome.effort;
    println!(
        "{} renderings ({made} in this run, {seconds:.0} s) at {} training and {} calibration cameras; a pool of {} settings",
        outcome.renderings,
        outcome.cameras[0],
        outcome.cameras[1],
        outcome.pool.len()
    );
    let wanted = [cameras.training.len(), cameras.calibration.len()];
    if outcome.cameras[0] < wanted[0] || outcome.cameras[1] < wanted[1] {
        println!(
            "the time limit ended the run: {} training and {} calibration cameras were planned; a longer one gives a better map",
            wanted[0], wanted[1]
        );
    }
    let extent = outcome.extent;
    if extent != Extent::WHOLE && made > 0 {
        let minutes = seconds / made as f64 * Extent::WHOLE_RENDERINGS as f64 / 60.0;
        println!(
            "a short search: {} pilot cameras and at most {} settings; with {minutes:.0} minutes it would have {} and {}",
            extent.pilots,
            extent.pool,
            Extent::WHOLE.pilots,
            Extent::WHOLE.pool
        );
    }
    println!("{}", describe(&outcome.fitted.report));
    println!(
        "{} nodes, {} corners, {} frontiers",
        map.octree.nodes.len(),
        map.octree.corners.len(),
        map.octree.frontiers.len()
    );
    let quality = outcome.cost_quality;
    println!(
        "power is by the cost model: its error at held-out readings is {:.1} % in the mean, {:.1} % at the 90th percentile",
        100.0 * quality.mean_absolute_error,
        100.0 * quality.ninth_decile
    );
    let fixed: Vec<&str> = outcome
        .screening
        .without_effect
        .iter()
        .map(|knob| map.knobs.knobs()[*knob].name.as_str())
        .collect();
    if !fixed.is_empty() {
        println!(
            "knobs without effect on any image, fixed at their cheapest: {}",
            fixed.join(", ")
        );
    }
    println!("errors in play, as a share of those of short clips: {}", outcome.played);
    match map.error_rates.0.first() {
        Some(least) => println!(
            "error budgets from {} up are calibrated; the best settings rendered twice differ by {:.4}",
            least.budget, outcome.noise
        ),
        None => println!("no error budget is calibrated: each frame's error is limited instead"),
    }
}
