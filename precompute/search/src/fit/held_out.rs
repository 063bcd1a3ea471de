//! Estimates for each camera from the others, and the costs of their selections there.

use frugal_core::frontier::CostPoint;

use super::estimate::{Keys, Pyramid};
use super::training::{Estimate, Training};

/// Number of folds.
const FOLDS: u32 = 8;
/// Exchange rates of the selections, in units of the greatest mean power per unit of error: those
/// of error budgets from a few hundredths to a few thousandths.
const RATES: [f64; 7] = [2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0];

/// Held-out and kept cameras of each fold; groups are never split, and no fold holds out all
/// cameras.
fn folds(training: &Training) -> impl Iterator<Item = (Vec<usize>, Vec<usize>)> + '_ {
    let fold = |camera: usize| {
        training.cameras[camera].group.wrapping_mul(2_654_435_769) >> 16 & (FOLDS - 1)
    };
    let splits = (0..FOLDS)
        .map(move |number| (0..training.cameras()).partition(|camera| fold(*camera) == number));
    splits.filter(|(out, kept): &(Vec<usize>, Vec<usize>)| !out.is_empty() && !kept.is_empty())
}

/// Estimates of each camera's costs from the cameras of other folds: the shared one, and that of the
/// camera's address in the octree, each by camera. `depths`: of the octree's leaf of each camera.
pub(super) fn held_out(training: &Training, keys: &Keys, depths: &[usize]) -> [Vec<Estimate>; 2] {
    let mut estimates = [0; 2].map(|_| vec![Estimate::default(); training.cameras()]);
    for (out, kept) in folds(training) {
        let pyramid = Pyramid::new(training, keys, kept);
        for camera in out {
            let depth = depths[camera];
            estimates[0][camera] = pyramid.shared.clone();
            estimates[1][camera] = pyramid.address(keys.addresses[depth][camera], depth);
        }
    }
    estimates
}

/// Mean loss of estimates over the cameras on tracks, where there are enough: cost of the selected
/// settings above the optimum, as a share of it.
pub(super) fn mean_loss(training: &Training, estimates: &[Estimate]) -> f64 {
    let cameras = training.representative();
    let power =
        |camera: usize| training.costs(camera).iter().map(|cost| cost.power.0).fold(0.0, f64::max);
    let scale = (0..training.cameras()).map(power).sum::<f64>() / training.cameras().max(1) as f64;
    let losses = cameras.iter().map(|one| loss(training, *one, &estimates[*one], scale));
    losses.sum::<f64>() / cameras.len().max(1) as f64
}

/// Mean over the rates of the selection's cost at `camera` above the optimum there.
fn loss(training: &Training, camera: usize, estimate: &Estimate, scale: f64) -> f64 {
    let costs = training.costs(camera);
    let at_rate = |rate: f64| {
        let value = |cost: &CostPoint| cost.power.0 + rate * scale * cost.error;
        let least = |costs: &[CostPoint]| {
            (0..costs.len()).min_by(|a, b| value(&costs[*a]).total_cmp(&value(&costs[*b])))
        };
        match (least(&estimate.costs), least(costs)) {
            (Some(picked), Some(best)) => value(&costs[picked]) / value(&costs[best]) - 1.0,
            _ => 0.0,
        }
    };
    RATES.iter().map(|rate| at_rate(*rate)).sum::<f64>() / RATES.len() as f64
}
