//! Errors away from the tracks.
//!
//! A track has cameras every few steps, and error budgets are calibrated on it. Elsewhere errors are
//! predicted over metres. There a budget selects the settings whose errors are underestimated most
//! (Smith and Winkler 2006, "The optimizer's curse"), which are those that err seldom and then badly:
//! coarse visibility, say, that leaks light in one passage. So away from the tracks each setting's error is multiplied by what held-out cameras there say of it: the ratio of
//! measured to predicted errors, plus what the mean along a path may exceed it by.

use frugal_core::frontier::CostPoint;

use super::calibrate::QUANTILE;
use super::regression::Viewpoint;
use super::smooth::Smoother;
use super::training::{Estimate, Training};

/// Weight of cameras on tracks, in cameras at the exact viewpoint, below which a viewpoint counts as
/// away from them.
const FAMILIAR: f64 = 0.5;
/// Number of views of a path whose errors differ from their predictions independently of each other:
/// neighbouring views go wrong together. Lower values give a larger margin.
const INDEPENDENT_VIEWS: f64 = 4.0;
/// Greatest factor: a larger ratio has other causes than distance.
const MOST: f64 = 3.0;
/// Greatest error, 1 − SSIM.
const WORST: f64 = 2.0;
/// Fewest held-out cameras that say something of the margin.
const FEWEST: usize = 8;

/// Factors on the errors of settings away from the tracks, each at least 1; empty for none.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Margin(Vec<f64>);

impl Margin {
    /// From the cameras that are `away` from the tracks, each with the estimate that was made without
    /// it.
    pub(super) fn of(training: &Training, held_out: &[Estimate], away: &[bool]) -> Self {
        let away: Vec<usize> = (0..training.cameras())
            .filter(|camera| away[*camera] && !held_out[*camera].costs.is_empty())
            .collect();
        if away.len() < FEWEST {
            return Self::default();
        }
        let settings = held_out[away[0]].costs.len();
        let of_setting = |setting: usize| {
            let pairs: Vec<(f64, f64)> = away
                .iter()
                .map(|camera| {
                    let error = |costs: &[CostPoint]| costs[setting].error;
                    (error(&held_out[*camera].costs), error(training.costs(*camera)))
                })
                .collect();
            factor(&pairs).map_or(1.0, |factor| factor.clamp(1.0, MOST))
        };
        Self((0..settings).map(of_setting).collect())
    }

    /// Mean over settings.
    pub(super) fn mean(&self) -> f64 {
        if self.0.is_empty() { 1.0 } else { self.0.iter().sum::<f64>() / self.0.len() as f64 }
    }

    /// An estimate with the margin on its errors.
    pub(super) fn applied(&self, mut estimate: Estimate) -> Estimate {
        for (cost, factor) in estimate.costs.iter_mut().zip(&self.0) {
            *cost = CostPoint::new(cost.power.0, (cost.error * factor).min(WORST));
        }
        estimate
    }
}

/// Ratio of measured to predicted errors, plus what the mean along a path may exceed it by; `pairs`:
/// predicted and measured. `None` without an error.
fn factor(pairs: &[(f64, f64)]) -> Option<f64> {
    let count = pairs.len() as f64;
    let mean = |value: &dyn Fn(&(f64, f64)) -> f64| pairs.iter().map(value).sum::<f64>() / count;
    let (predicted, measured) = (mean(&|pair| pair.0), mean(&|pair| pair.1));
    let ratio = measured / predicted;
    let deviation = mean(&|pair| (pair.1 - ratio * pair.0).powi(2)).sqrt();
    let spread = QUANTILE * deviation / measured / INDEPENDENT_VIEWS.sqrt();
    Some(ratio * (1.0 + spread)).filter(|factor| factor.is_finite())
}

/// Whether a viewpoint is away from the tracks; `tracks`: the cameras on them. Never without tracks.
pub(super) fn is_away(smoother: &Smoother<'_>, tracks: &[usize], viewpoint: &Viewpoint) -> bool {
    let near = |camera: &usize| f64::from((-viewpoint.steps(&smoother.viewpoint(*camera))).exp());
    !tracks.is_empty() && tracks.iter().map(near).sum::<f64>() < FAMILIAR
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_factor_is_the_ratio_and_the_spread_of_a_paths_mean() {
        assert_eq!(factor(&[(0.01, 0.012), (0.02, 0.024)]).map(|f| (f * 1e6).round()), Some(1.2e6));
        // Residuals of a fifth of the mean: 1.28 × 0.2 ÷ √4 above 1.
        let spread = factor(&[(0.01, 0.012), (0.01, 0.008)]).expect("pairs");
        assert!((spread - 1.128).abs() < 1e-3, "{spread}");
        for odd in [vec![], vec![(0.0, 0.1)], vec![(f64::NAN, 0.1)], vec![(0.1, f64::INFINITY)]] {
            assert_eq!(factor(&odd), None);
        }
    }

    #[test]
    fn a_margin_raises_errors_and_leaves_power() {
        let margin = Margin(vec![1.5, 1.2]);
        let estimate = Estimate {
            costs: vec![CostPoint::new(3.0, 0.02), CostPoint::new(1.0, 1.9)],
            weight: 2.0,
        };
        let raised = margin.applied(estimate.clone());
        assert_eq!(raised.costs, [CostPoint::new(3.0, 0.03), CostPoint::new(1.0, 2.0)]);
        assert_eq!((margin.mean(), Margin::default().mean()), (1.35, 1.0));
        assert_eq!(Margin::default().applied(estimate.clone()), estimate);
    }
}
