//! Whether finer estimates pay: what they pick, held against cameras that took no part in them.

use bevy_frugal_gi::frontier::Frontier;

use super::Smoother;
use super::estimate::{Estimate, Keys, Pyramid, Training};

/// Parts that the cameras are divided into.
const FOLDS: u32 = 8;
/// Exchange rates at which picks are judged, in units of the greatest mean power per unit of error: those of error budgets from a few
/// hundredths to a few thousandths.
const RATES: [f64; 7] = [2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0];

/// What picks cost at held-out cameras: how far above the best pick, as a share of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Losses {
    /// By camera, picked from what all cameras share.
    pub shared: Vec<f64>,
    /// By depth, then by camera.
    pub by_depth: Vec<Vec<f64>>,
}

impl Losses {
    /// Cross-validated losses of every depth.
    pub fn cross_validated(training: &Training, smoother: &Smoother<'_>, keys: &Keys) -> Self {
        let count = training.cameras();
        let depths = keys.addresses.len();
        let mut losses = Self { shared: vec![0.0; count], by_depth: vec![vec![0.0; count]; depths] };
        let power = |camera: usize| training.costs(camera).iter().map(|cost| cost.power.0).fold(0.0, f64::max);
        let scale = (0..count).map(power).sum::<f64>() / count.max(1) as f64;
        for (out, kept) in folds(training) {
            let pyramid = Pyramid::new(training, smoother, keys, &kept);
            for camera in out {
                losses.shared[camera] = loss(training, camera, &pyramid.shared, scale);
                for (depth, by_camera) in losses.by_depth.iter_mut().enumerate() {
                    by_camera[camera] = loss(training, camera, &pyramid.address(keys, keys.addresses[depth][camera], depth), scale);
                }
            }
        }
        losses
    }

    /// Mean and standard error of what `cameras` save where they go from `coarse` to `fine` losses.
    pub(super) fn saving(coarse: &[f64], fine: &[f64], cameras: &[usize]) -> (f64, f64) {
        let savings: Vec<f64> = cameras.iter().map(|camera| coarse[*camera] - fine[*camera]).collect();
        let count = savings.len() as f64;
        if count < 2.0 {
            return (0.0, f64::INFINITY);
        }
        let mean = savings.iter().sum::<f64>() / count;
        let squares: f64 = savings.iter().map(|saving| (saving - mean).powi(2)).sum();
        (mean, (squares / (count - 1.0) / count).sqrt())
    }
}

/// Cameras that are held out, and those that are kept, in turn; whole groups, and never all of them.
fn folds(training: &Training) -> impl Iterator<Item = (Vec<usize>, Vec<usize>)> + '_ {
    let fold = |camera: usize| training.group(camera).wrapping_mul(2_654_435_769) >> 16 & (FOLDS - 1);
    let parts = (0..FOLDS).map(move |part| (0..training.cameras()).partition(|camera| fold(*camera) == part));
    parts.filter(|(out, kept): &(Vec<usize>, Vec<usize>)| !out.is_empty() && !kept.is_empty())
}

/// For each camera the frontier of its address at its depth, from the cameras of other folds; from all of them together without depths.
pub(super) fn held_out(training: &Training, smoother: &Smoother<'_>, keys: &Keys, depths: Option<&[usize]>) -> Vec<Frontier> {
    let mut frontiers = vec![Frontier::default(); training.cameras()];
    for (out, kept) in folds(training) {
        let pyramid = Pyramid::new(training, smoother, keys, &kept);
        for camera in out {
            let estimate = depths.map(|depths| depths[camera]).map(|depth| pyramid.address(keys, keys.addresses[depth][camera], depth));
            frontiers[camera] = training.frontier(estimate.as_ref().unwrap_or(&pyramid.shared));
        }
    }
    frontiers
}

/// Mean over the rates of what the estimate's pick costs at `camera`, above the best pick there.
fn loss(training: &Training, camera: usize, estimate: &Estimate, scale: f64) -> f64 {
    let costs = training.costs(camera);
    let at_rate = |rate: f64| {
        let value = |cost: &bevy_frugal_gi::frontier::CostPoint| cost.power.0 + rate * scale * cost.error;
        let least =
            |costs: &[bevy_frugal_gi::frontier::CostPoint]| (0..costs.len()).min_by(|a, b| value(&costs[*a]).total_cmp(&value(&costs[*b])));
        match (least(&estimate.costs), least(costs)) {
            (Some(picked), Some(best)) => value(&costs[picked]) / value(&costs[best]) - 1.0,
            _ => 0.0,
        }
    };
    RATES.iter().map(|rate| at_rate(*rate)).sum::<f64>() / RATES.len() as f64
}
