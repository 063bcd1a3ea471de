//! Exchange rates between power and error under an error budget.
//!
//! An error budget limits the mean error of the rendered frames. A mean takes the least power when
//! a watt reduces the error equally everywhere: each camera minimises P + λe with one exchange rate
//! λ (Everett 1963, "Generalized Lagrange multiplier method for solving problems of optimum
//! allocation of resources"). A limit on every frame's error (Wang et al. 2016, equation 3.3)
//! spends most where error is most expensive to reduce.
//!
//! Held-out cameras calibrate the λ of each budget: the least at which the mean predicted error,
//! plus an upper confidence bound on the error of predictions, is within the budget
//! (risk-controlling sets; Bates, Angelopoulos, Lei, Malik, Jordan 2021). In play the controller
//! steers λ so that the mean prediction stays at the target.

use serde::{Deserialize, Serialize};

/// A calibrated error budget with its exchange rate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ErrorRate {
    /// Budget of the mean error, 1 − SSIM; finite, above 0.
    pub budget: f64,
    /// Exchange rate λ, in watts per unit of error; finite, at least 0. Higher values select better and
    /// more expensive settings.
    pub watts_per_error: f64,
    /// Mean predicted error at which the measured error just meets the budget: the controller's
    /// target for the mean of its predictions. 1 − SSIM, finite, above 0. `None` where the map has
    /// none: the budget itself is then the target.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub predicted: Option<f64>,
}

/// Exchange rates by budget: budgets strictly increase, rates never increase. Empty in maps without
/// calibration.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct ErrorRates(pub Vec<ErrorRate>);

impl ErrorRates {
    /// The largest calibrated budget that is at most `budget` (1 − SSIM). No interpolation: a frontier's
    /// errors are discrete.
    fn within(&self, budget: f64) -> Option<&ErrorRate> {
        let within = self.0.partition_point(|known| known.budget <= budget);
        within.checked_sub(1).and_then(|last| self.0.get(last))
    }

    /// Rate that keeps `budget` at the calibration cameras, in watts per unit of error. Infinite below the
    /// smallest calibrated budget, where only the best settings are safe. `None` without calibration, or
    /// where `budget` is NaN.
    pub fn rate(&self, budget: f64) -> Option<f64> {
        if self.0.is_empty() || budget.is_nan() {
            return None;
        }
        Some(self.within(budget).map_or(f64::INFINITY, |known| known.watts_per_error))
    }

    /// Mean predicted error (1 − SSIM) at which `budget` is just met: that of the largest
    /// calibrated budget within it, scaled in proportion. 0 below the smallest calibrated budget, where
    /// only the best settings are safe. `None` where it is unknown, or `budget` is not finite.
    pub fn target(&self, budget: f64) -> Option<f64> {
        if !budget.is_finite() || self.0.is_empty() {
            return None;
        }
        let Some(known) = self.within(budget) else { return Some(0.0) };
        known.predicted.map(|predicted| predicted * budget / known.budget)
    }

    /// Whether budgets strictly increase, rates never increase, and all values are in their ranges.
    pub fn is_sound(&self) -> bool {
        let number = |rate: &ErrorRate| {
            let predicted = rate.predicted.is_none_or(|error| error > 0.0 && error.is_finite());
            rate.budget > 0.0
                && rate.budget.is_finite()
                && rate.watts_per_error >= 0.0
                && rate.watts_per_error.is_finite()
                && predicted
        };
        self.0.iter().all(number)
            && self.0.windows(2).all(|two| {
                two[0].budget < two[1].budget && two[0].watts_per_error >= two[1].watts_per_error
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rates(pairs: &[(f64, f64)]) -> ErrorRates {
        ErrorRates(
            pairs
                .iter()
                .map(|(budget, watts_per_error)| ErrorRate {
                    budget: *budget,
                    watts_per_error: *watts_per_error,
                    predicted: None,
                })
                .collect(),
        )
    }

    #[test]
    fn a_budget_gets_the_target_of_the_next_lower_calibrated_one() {
        let rates = rates(&[(0.01, 1000.0), (0.04, 10.0), (0.1, 0.0)]);
        assert!(rates.is_sound());
        assert_eq!(
            [0.005, 0.01, 0.0399, 0.04, 0.5].map(|budget| rates.rate(budget)),
            [f64::INFINITY, 1000.0, 1000.0, 10.0, 0.0].map(Some)
        );
        assert_eq!((rates.rate(f64::NAN), ErrorRates::default().rate(0.1)), (None, None));
        let mut with_target = rates.clone();
        with_target.0[0].predicted = Some(0.008);
        assert_eq!(
            [0.005, 0.01, 0.02, 0.05].map(|budget| with_target.target(budget)),
            [Some(0.0), Some(0.008), Some(0.016), None]
        );
        assert_eq!(
            [f64::NAN, f64::INFINITY].map(|budget| with_target.target(budget)),
            [None, None]
        );
        assert_eq!([0.0, -1.0].map(|budget| rates.target(budget)), [Some(0.0); 2]);
        assert_eq!(ErrorRates::default().target(0.1), None);
    }

    #[test]
    fn rates_out_of_order_or_range_are_invalid() {
        assert!(ErrorRates::default().is_sound());
        for invalid in [
            rates(&[(0.01, 1.0), (0.01, 0.5)]),
            rates(&[(0.01, 1.0), (0.02, 2.0)]),
            rates(&[(0.0, 1.0)]),
            rates(&[(0.01, -1.0)]),
            rates(&[(f64::NAN, 1.0)]),
            rates(&[(0.01, f64::INFINITY)]),
        ] {
            assert!(!invalid.is_sound(), "{invalid:?}");
        }
    }
}
