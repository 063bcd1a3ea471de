//! Cross-validation of estimates: costs of their selections at held-out cameras.

use frugal_core::frontier::CameraView;

use super::Smoother;
use super::estimate::{Keys, Pyramid};
use super::training::{Estimate, Training};

/// Number of folds.
const FOLDS: u32 = 8;
/// Exchange rates of the selections, in units of the greatest mean power per unit of error: those
/// of error budgets from a few hundredths to a few thousandths.
const RATES: [f64; 7] = [2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0];

/// Least saving of the best depth that justifies a larger map, as a share of the shared frontier's
/// loss.
///
/// A standard error is not asked for: estimates are shrunk towards the shared one, so a division that
/// was not needed loses little, while a few dozen cameras are too few to prove one that is.
const LEAST_SAVING: f64 = 0.02;

/// Losses at held-out cameras: cost of the selected settings above the optimum, as a share of it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Losses {
    /// By camera, with the shared frontier.
    pub shared: Vec<f64>,
    /// By depth, then by camera.
    pub by_depth: Vec<Vec<f64>>,
}

impl Losses {
    /// Losses of every depth's estimates at cameras held out.
    pub(super) fn of(training: &Training, held_out: &HeldOut) -> Self {
        let count = training.cameras();
        let power = |camera: usize| {
            training.costs(camera).iter().map(|cost| cost.power.0).fold(0.0, f64::max)
        };
        let scale = (0..count).map(power).sum::<f64>() / count.max(1) as f64;
        let losses = |estimates: &Vec<Estimate>| {
            let of = |(camera, estimate)| loss(training, camera, estimate, scale);
            estimates.iter().enumerate().map(of).collect()
        };
        Self {
            shared: losses(&held_out.shared),
            by_depth: held_out.by_depth.iter().map(losses).collect(),
        }
    }

    /// The greatest depth whose loss at `cameras` is within one standard error of the least, and no
    /// more than that of the shared frontier; `None` where the shared frontier is as good.
    ///
    /// One decision for all cameras: a single node has too few. The deepest within the tolerance,
    /// because estimates are smoothed over cameras and too fine a division loses little. Evaluated
    /// at cameras on tracks, which are near each other as at run time: cameras in free space have
    /// no neighbours, and at them no depth helps.
    pub(super) fn deepest(&self, cameras: &[usize]) -> Option<usize> {
        let among = |losses: &Vec<f64>| {
            cameras.iter().filter_map(|camera| losses.get(*camera).copied()).collect::<Vec<f64>>()
        };
        let by_depth: Vec<Vec<f64>> = self.by_depth.iter().map(among).collect();
        let shared = among(&self.shared);
        let all = || std::iter::once(&shared).chain(&by_depth);
        let mean = |losses: &[f64]| losses.iter().sum::<f64>() / losses.len().max(1) as f64;
        let best = all().min_by(|a, b| mean(a).total_cmp(&mean(b)))?;
        if mean(&shared) - mean(best) < LEAST_SAVING * mean(&shared) {
            return None;
        }
        let is_near = |losses: &Vec<f64>| {
            let (more, error) = difference(losses, best);
            more <= error && mean(losses) <= mean(&shared)
        };
        (0..by_depth.len()).rev().find(|depth| is_near(&by_depth[*depth]))
    }
}

/// Mean of the paired difference of losses, and its standard error.
fn difference(losses: &[f64], others: &[f64]) -> (f64, f64) {
    let differences: Vec<f64> =
        losses.iter().zip(others).map(|(loss, other)| loss - other).collect();
    let count = differences.len() as f64;
    if count < 2.0 {
        return (0.0, 0.0);
    }
    let mean = differences.iter().sum::<f64>() / count;
    let squares: f64 = differences.iter().map(|difference| (difference - mean).powi(2)).sum();
    (mean, (squares / (count - 1.0) / count).sqrt())
}

/// Held-out and kept cameras of each fold; groups are never split, and no fold holds out all
/// cameras.
fn folds(training: &Training) -> impl Iterator<Item = (Vec<usize>, Vec<usize>)> + '_ {
    let fold =
        |camera: usize| training.group(camera).wrapping_mul(2_654_435_769) >> 16 & (FOLDS - 1);
    let splits = (0..FOLDS)
        .map(move |number| (0..training.cameras()).partition(|camera| fold(*camera) == number));
    splits.filter(|(out, kept): &(Vec<usize>, Vec<usize>)| !out.is_empty() && !kept.is_empty())
}

/// For each camera the estimates of its addresses from the cameras of other folds.
pub(super) struct HeldOut {
    /// The shared one, by camera.
    shared: Vec<Estimate>,
    /// By depth, then by camera.
    by_depth: Vec<Vec<Estimate>>,
}

impl HeldOut {
    /// Estimates of every depth. In each fold the unrendered views, too, are predicted without the
    /// cameras that are held out.
    pub(super) fn new(training: &Training, views: &[CameraView], keys: &Keys) -> Self {
        let none = vec![Estimate::default(); training.cameras()];
        let mut estimates =
            Self { by_depth: vec![none.clone(); keys.addresses.len()], shared: none };
        for (out, mut kept) in folds(training) {
            let known = training.without(&out);
            let smoother = Smoother::new(&known, views);
            kept.extend(known.cameras()..known.views());
            let pyramid = Pyramid::new(&known, &smoother, keys, &kept);
            for camera in out {
                estimates.shared[camera] = pyramid.shared.clone();
                for (depth, by_camera) in estimates.by_depth.iter_mut().enumerate() {
                    by_camera[camera] = pyramid.address(keys, keys.addresses[depth][camera], depth);
                }
            }
        }
        estimates
    }

    /// The estimate of each camera's address at its depth; the shared one without depths.
    pub(super) fn at(&self, depths: Option<&[usize]>) -> Vec<Estimate> {
        let of = |(camera, shared): (usize, &Estimate)| match depths {
            Some(depths) => self.by_depth[depths[camera]][camera].clone(),
            None => shared.clone(),
        };
        self.shared.iter().enumerate().map(of).collect()
    }
}

/// Mean over the rates of the selection's cost at `camera` above the optimum there.
fn loss(training: &Training, camera: usize, estimate: &Estimate, scale: f64) -> f64 {
    let costs = training.costs(camera);
    let at_rate = |rate: f64| {
        let value =
            |cost: &frugal_core::frontier::CostPoint| cost.power.0 + rate * scale * cost.error;
        let least = |costs: &[frugal_core::frontier::CostPoint]| {
            (0..costs.len()).min_by(|a, b| value(&costs[*a]).total_cmp(&value(&costs[*b])))
        };
        match (least(&estimate.costs), least(costs)) {
            (Some(picked), Some(best)) => value(&costs[picked]) / value(&costs[best]) - 1.0,
            _ => 0.0,
        }
    };
    RATES.iter().map(|rate| at_rate(*rate)).sum::<f64>() / RATES.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [usize; 4] = [0, 1, 2, 3];

    /// Losses of four cameras that vary by up to a tenth about these means.
    fn losses(shared: f64, by_depth: &[f64]) -> Losses {
        let vary = |mean: &f64| {
            [-0.1, 0.05, 0.1, -0.05].iter().map(|part| mean * (1.0 + part)).collect::<Vec<f64>>()
        };
        // The order alternates with depth, so that differences have a spread.
        let depth = |(index, mean): (usize, &f64)| {
            let mut losses = vary(mean);
            losses.rotate_left(index);
            losses
        };
        Losses { shared: vary(&shared), by_depth: by_depth.iter().enumerate().map(depth).collect() }
    }

    #[test]
    fn the_octree_is_as_deep_as_losses_allow() {
        assert_eq!(
            losses(0.2, &[0.1, 0.1, 0.1]).deepest(&ALL),
            Some(2),
            "equal depths: the deepest"
        );
        assert_eq!(
            losses(0.2, &[0.1, 0.101, 0.3]).deepest(&ALL),
            Some(1),
            "a depth that costs much more is too deep"
        );
        assert_eq!(
            losses(0.1, &[0.3, 0.3]).deepest(&ALL),
            None,
            "one frontier for all is far better"
        );
        assert_eq!(
            Losses { shared: vec![], by_depth: vec![vec![]; 2] }.deepest(&[]),
            Some(1),
            "no cameras: no evidence"
        );
    }
}
