//! Cost of settings that are on no frontier, as in a transition between two that are.

use super::{CostPoint, Frontier, FrontierPoint};
use crate::knobs::{KnobLevels, KnobSpace};

impl Frontier {
    /// Power and error of any `settings` of `space`. Exact for a point of the frontier; else
    /// interpolated, by the distance in levels, between the most expensive point with no higher level and
    /// the cheapest with no lower level. `None` where the frontier is empty.
    ///
    /// Allocates nothing. Linear in points × knobs, so it is for settings in transition only.
    pub fn estimate(&self, space: &KnobSpace, settings: KnobLevels) -> Option<CostPoint> {
        let points = self.points();
        if let Some(exact) = points.iter().find(|point| point.settings == settings) {
            return Some(exact.cost);
        }
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
}

/// Sum over the knobs of the distance as a share of the knob's levels.
fn distance(space: &KnobSpace, a: KnobLevels, b: KnobLevels) -> f64 {
    let of_knob = |(index, knob): (usize, &crate::knobs::Knob)| {
        let steps = knob.levels.len().saturating_sub(1).max(1);
        a.level(index).abs_diff(b.level(index)) as f64 / steps as f64
    };
    space.knobs().iter().enumerate().map(of_knob).sum()
}

#[cfg(test)]
mod tests {
    use crate::frontier::Frontier;
    use crate::knobs::KnobLevels;
    use crate::testing;

    fn at(samples: usize, scale: usize) -> KnobLevels {
        KnobLevels::default().with_level(0, samples).with_level(1, scale)
    }

    #[test]
    fn points_are_exact_and_settings_between_lie_between() {
        // (0, 0): 1 W / 0.2; (2, 0): 2 W / 0.05; (4, 2): 4 W / 0.
        let (frontier, space) = (testing::frontier(1.0), testing::space());
        let estimate = |settings| frontier.estimate(&space, settings).expect("a cost");
        for point in frontier.points() {
            assert_eq!(estimate(point.settings), point.cost);
        }
        let mut before = 1.0;
        for settings in [at(1, 0), at(3, 0), at(3, 1), at(4, 1)] {
            let power = estimate(settings).power.0;
            assert!(power > before && power < 4.0, "{power} W at {settings:?}");
            before = power;
        }
        assert_eq!(estimate(at(1, 0)).power.0, 1.5);
        // Comparable with no point but the ends.
        let odd = estimate(at(0, 2)).power.0;
        assert!((1.0..=4.0).contains(&odd), "{odd}");
        assert_eq!(Frontier::default().estimate(&space, at(0, 0)), None);
        // Levels that the space lacks are no danger.
        assert!(estimate(KnobLevels::from_bits(u128::MAX)).is_finite());
    }
}
