//! Cost points, dominance, and the Pareto frontier of one camera with its look-ups by budget.
//!
//! Wang et al. 2016, equations 3.2 and 3.3, section 3.4.1.
//!
//! A file has a frontier as a list of `(settings, watts, error)`. Field names would make a map's file
//! several times longer. Watts keep four significant digits and errors six decimals: both are finer
//! than any meter or image metric that fills a map (Wang et al. 2016, section 3.7.1, quote ±5 % for
//! theirs).

use serde::de::{Deserializer, Error as _};
use serde::ser::Serializer;
use serde::{Deserialize, Serialize};

use crate::knobs::{Knob, KnobLevels, KnobSpace};
use crate::units::Watts;

/// Power and error of settings at one camera.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "bevy", derive(bevy_reflect::Reflect))]
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
            let power = a.cost.power.0.total_cmp(&b.cost.power.0);
            let cost = power.then(a.cost.error.total_cmp(&b.cost.error));
            cost.then(a.settings.cmp(&b.settings))
        });
        let mut least_error = f64::INFINITY;
        points.retain(|point| {
            let is_better = point.cost.error < least_error;
            least_error = least_error.min(point.cost.error);
            is_better
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

    /// Power and error of `settings` where they are a point of the frontier.
    pub fn exact(&self, settings: KnobLevels) -> Option<CostPoint> {
        let mut points = self.points().iter();
        points.find(|point| point.settings == settings).map(|point| point.cost)
    }

    /// Power and error of any `settings` of `space`. Exact for a point of the frontier; else
    /// interpolated, by the distance in levels, between the most expensive point with no higher level and
    /// the cheapest with no lower level. `None` where the frontier is empty.
    ///
    /// Allocates nothing. Linear in points × knobs, so it is for settings in transition only.
    pub fn estimate(&self, space: &KnobSpace, settings: KnobLevels) -> Option<CostPoint> {
        if let Some(exact) = self.exact(settings) {
            return Some(exact);
        }
        let points = self.points();
        let is_below = |low: KnobLevels, high: KnobLevels| {
            (0..space.len()).all(|knob| low.level(knob) <= high.level(knob))
        };
        let below = |point: &&FrontierPoint| is_below(point.settings, settings);
        let above = |point: &&FrontierPoint| is_below(settings, point.settings);
        let low = points.iter().rev().find(below).or(points.first())?;
        let high = points.iter().find(above).or(points.last())?;
        let (from_low, to_high) =
            (distance(space, low.settings, settings), distance(space, settings, high.settings));
        let share = from_low / (from_low + to_high).max(f64::MIN_POSITIVE);
        let power = low.cost.power + (high.cost.power - low.cost.power) * share;
        let error = low.cost.error + (high.cost.error - low.cost.error) * share;
        Some(CostPoint { power, error })
    }

    /// The frontier as stored in a file: watts rounded to four significant digits, errors to six
    /// decimals. Points that rounding makes equal or dominated are dropped. Rounding is idempotent.
    #[must_use]
    pub fn rounded(&self) -> Self {
        Self::from_points(self.points().iter().map(|point| {
            // Formatting rounds correctly in decimal; multiplication and division by powers of ten
            // do not. Both texts always parse.
            let power = format!("{:.3e}", point.cost.power.0).parse().unwrap_or(point.cost.power.0);
            let error: f64 = format!("{:.6}", point.cost.error).parse().unwrap_or(point.cost.error);
            // Adding zero turns −0, which would print as such, into 0.
            FrontierPoint { settings: point.settings, cost: CostPoint::new(power, error + 0.0) }
        }))
    }
}

/// Sum over the knobs of the distance as a share of the knob's levels.
fn distance(space: &KnobSpace, a: KnobLevels, b: KnobLevels) -> f64 {
    let of_knob = |(index, knob): (usize, &Knob)| {
        let steps = knob.levels.len().saturating_sub(1).max(1);
        a.level(index).abs_diff(b.level(index)) as f64 / steps as f64
    };
    space.knobs().iter().enumerate().map(of_knob).sum()
}

impl Serialize for Frontier {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let stored = |point: &FrontierPoint| (point.settings, point.cost.power, point.cost.error);
        serializer.collect_seq(self.rounded().points().iter().map(stored))
    }
}

impl<'de> Deserialize<'de> for Frontier {
    /// Rejects points that are not finite, or not in order of increasing power and decreasing
    /// error: this crate did not write such a file, and a silent repair would hide that.
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let stored = Vec::<(KnobLevels, f64, f64)>::deserialize(deserializer)?;
        let point = |(settings, power, error)| FrontierPoint {
            settings,
            cost: CostPoint::new(power, error),
        };
        let points: Vec<FrontierPoint> = stored.into_iter().map(point).collect();
        if let Some(CostPoint { power, error }) =
            points.iter().map(|it| it.cost).find(|cost| !cost.is_finite())
        {
            return Err(D::Error::custom(format_args!(
                "a frontier point of {} W and error {error}: both must be finite",
                power.0
            )));
        }
        let falls = |two: &&[FrontierPoint]| {
            two[0].cost.power >= two[1].cost.power || two[0].cost.error <= two[1].cost.error
        };
        if let Some(CostPoint { power, error }) =
            points.windows(2).find(falls).map(|two| two[1].cost)
        {
            return Err(D::Error::custom(format_args!(
                "a frontier point of {} W and error {error} is dominated by the one before, or out of order",
                power.0
            )));
        }
        Ok(Self::from_points(points))
    }
}

#[cfg(test)]
#[path = "pareto_tests.rs"]
mod tests;
