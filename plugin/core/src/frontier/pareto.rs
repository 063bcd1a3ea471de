//! Cost points, dominance, and the Pareto frontier of one camera with its look-ups by budget.
//!
//! Wang et al. 2016, equations 3.2 and 3.3, section 3.4.1.

#[cfg(feature = "bevy")]
use bevy_reflect::Reflect;
use serde::{Deserialize, Serialize};

use crate::knobs::KnobLevels;
use crate::units::Watts;

/// Power and error of settings at one camera.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "bevy", derive(Reflect))]
pub struct CostPoint {
    /// Power at the target frame rate, in watts; finite and at least 0 in a valid map.
    pub power: Watts,
    /// 1 − SSIM against the same camera at the best settings, 0 to 2, no unit: 0 is identical, 1
    /// uncorrelated, 2 the worst possible.
    pub error: f64,
}

impl CostPoint {
    /// A cost point of `power_w` watts and `error` (1 − SSIM). Accepts any number.
    pub const fn new(power_w: f64, error: f64) -> Self {
        Self { power: Watts(power_w), error }
    }

    /// Whether both numbers are finite.
    pub fn is_finite(self) -> bool {
        self.power.0.is_finite() && self.error.is_finite()
    }

    /// Pareto dominance: whether this point is better in one objective and at least as good in the
    /// other (Wang et al. 2016, section 3.4.1). NaN never dominates.
    pub fn dominates(self, other: Self) -> bool {
        (self.power <= other.power && self.error < other.error)
            || (self.power < other.power && self.error <= other.error)
    }
}

/// Settings with their cost.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FrontierPoint {
    /// The settings.
    pub settings: KnobLevels,
    /// Their power and error.
    pub cost: CostPoint,
}

/// Pareto frontier: non-dominated settings in power and error. Power strictly increases, error
/// strictly decreases.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Frontier {
    points: Vec<FrontierPoint>,
}

impl Frontier {
    /// The frontier of any points. Drops dominated points, points that are not finite, and all but
    /// one of equal cost.
    pub fn from_points(points: impl IntoIterator<Item = FrontierPoint>) -> Self {
        let mut points: Vec<_> =
            points.into_iter().filter(|point| point.cost.is_finite()).collect();
        // Among equal costs the smallest settings are kept, so that the result does not depend on
        // the input order.
        points.sort_by(|a, b| {
            let cost = a
                .cost
                .power
                .0
                .total_cmp(&b.cost.power.0)
                .then(a.cost.error.total_cmp(&b.cost.error));
            cost.then(a.settings.cmp(&b.settings))
        });
        let mut least_error = f64::INFINITY;
        points.retain(|point| {
            let better = point.cost.error < least_error;
            if better {
                least_error = point.cost.error;
            }
            better
        });
        Self { points }
    }

    /// The points, in order of increasing power.
    pub fn points(&self) -> &[FrontierPoint] {
        &self.points
    }

    /// Whether the frontier has no point: nothing is known of this camera.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// The point of least error with power at most `budget`, in watts (equation 3.2). `None` where
    /// no point is that cheap, or `budget` is NaN.
    pub fn least_error_within(&self, budget: Watts) -> Option<&FrontierPoint> {
        let within = self.points.partition_point(|point| point.cost.power <= budget);
        self.points[..within].last()
    }

    /// The point of least power with error at most `budget`, 1 − SSIM (equation 3.3). `None` where
    /// no point is that good, or `budget` is NaN.
    pub fn least_power_within(&self, budget: f64) -> Option<&FrontierPoint> {
        if budget.is_nan() {
            return None;
        }
        let worse = self.points.partition_point(|point| point.cost.error > budget);
        self.points.get(worse)
    }

    /// The point that minimises power + `rate` × error, with `rate` in watts per unit of error; the
    /// best settings where `rate` is infinite. `None` where the frontier is empty, or `rate` is NaN.
    ///
    /// Of all selections with one rate, these have the least power for their mean error (Everett
    /// 1963).
    ///
    /// A linear search over a few dozen points: a binary search would need the convex hull and save
    /// a few nanoseconds.
    pub fn least_sum(&self, rate: f64) -> Option<&FrontierPoint> {
        if rate.is_nan() {
            return None;
        }
        if rate == f64::INFINITY {
            return self.points.last();
        }
        let sum = |point: &FrontierPoint| point.cost.power.0 + rate * point.cost.error;
        self.points.iter().min_by(|a, b| sum(a).total_cmp(&sum(b)))
    }

    /// Hypervolume: the area dominated by the frontier and bounded by `reference`, in watts (error
    /// has no unit); at least 0. Larger is better.
    pub fn hypervolume(&self, reference: CostPoint) -> f64 {
        let inside = self
            .points
            .iter()
            .filter(|p| p.cost.power < reference.power && p.cost.error < reference.error);
        let mut area = 0.0;
        let mut error = reference.error;
        for point in inside {
            area += (reference.power.0 - point.cost.power.0) * (error - point.cost.error);
            error = point.cost.error;
        }
        area
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(bits: u128, power: f64, error: f64) -> FrontierPoint {
        FrontierPoint { settings: KnobLevels::from_bits(bits), cost: CostPoint::new(power, error) }
    }

    fn staircase() -> Frontier {
        Frontier::from_points([
            point(0, 1.0, 0.5),
            point(1, 2.0, 0.3),
            point(2, 2.5, 0.3), // dominated
            point(3, 4.0, 0.0),
            point(4, f64::NAN, 0.0),
            point(5, 3.0, f64::NAN),
            point(6, f64::INFINITY, 0.0),
        ])
    }

    #[test]
    fn dominated_and_non_finite_points_are_dropped() {
        let kept: Vec<_> = staircase().points().iter().map(|p| p.settings.bits()).collect();
        assert_eq!(kept, [0, 1, 3]);
    }

    #[test]
    fn both_searches_take_the_best_within_the_budget() {
        let frontier = staircase();
        let by_power = |watts| frontier.least_error_within(Watts(watts)).map(|p| p.settings.bits());
        assert_eq!(
            [0.0, 0.999, 1.0, 3.9, 4.0, f64::INFINITY].map(by_power),
            [None, None, Some(0), Some(1), Some(3), Some(3)]
        );
        assert_eq!([f64::NAN, f64::NEG_INFINITY, -1.0].map(by_power), [None; 3]);
        let by_error = |error| frontier.least_power_within(error).map(|p| p.settings.bits());
        assert_eq!(
            [0.0, 0.29, 0.3, 0.5, f64::INFINITY].map(by_error),
            [Some(3), Some(3), Some(1), Some(0), Some(0)]
        );
        assert_eq!([f64::NAN, f64::NEG_INFINITY, -1.0].map(by_error), [None; 3]);
        assert_eq!(Frontier::default().least_error_within(Watts(1.0)), None);
        assert_eq!(Frontier::default().least_power_within(1.0), None);
    }

    #[test]
    fn a_rate_selects_the_least_sum() {
        let frontier = staircase();
        let at = |rate| frontier.least_sum(rate).map(|p| p.settings.bits());
        // A watt buys 0.2 of error, and then 0.15.
        assert_eq!(
            [0.0, 4.9, 5.1, 6.6, 6.7, f64::INFINITY].map(at),
            [Some(0), Some(0), Some(1), Some(1), Some(3), Some(3)]
        );
        assert_eq!(
            (at(f64::NAN), at(-1.0), Frontier::default().least_sum(1.0)),
            (None, Some(0), None)
        );
    }

    #[test]
    fn hypervolume_of_a_staircase_is_the_area_of_its_steps() {
        // (5 - 1) * 0.5 + (5 - 2) * 0.2 + (5 - 4) * 0.3 with the reference at (5, 1).
        let area = staircase().hypervolume(CostPoint::new(5.0, 1.0));
        assert!((area - (4.0 * 0.5 + 3.0 * 0.2 + 1.0 * 0.3)).abs() < 1e-12, "{area}");
        // Points outside the reference do not count.
        let area = staircase().hypervolume(CostPoint::new(3.0, 0.4));
        assert!((area - (3.0 - 2.0) * 0.1).abs() < 1e-12, "{area}");
    }

    #[test]
    fn dominance_is_strict_and_ignores_nan() {
        let a = CostPoint::new(1.0, 0.1);
        assert!(!a.dominates(a));
        assert!(a.dominates(CostPoint::new(1.0, 0.2)));
        assert!(a.dominates(CostPoint::new(2.0, 0.1)));
        assert!(!a.dominates(CostPoint::new(0.5, 0.2)));
        assert!(!CostPoint::new(f64::NAN, 0.0).dominates(a));
    }
}
