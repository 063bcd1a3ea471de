//! Dwell: how long a target stays before another takes its place.
//!
//! Where a camera turns to and fro across the border of two addresses, each frame's best point
//! alternates between two settings of nearly equal cost. A target therefore stays for a least time,
//! unless it breaks a limit. The first change after a rest does not wait.

use super::limits::Limits;
use crate::frontier::CostPoint;
use crate::knobs::KnobLevels;

/// Relative change of a limit from which it is another budget. What a battery or a meter says drifts.
const OTHER_LIMIT: f64 = 0.05;

/// The target in use, since when, and for which limits.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Dwell {
    target: Option<KnobLevels>,
    seconds: f64,
    power: Option<f64>,
    error: Option<f64>,
    /// Whether the limits of this frame are others than those of the frame before.
    pub(super) has_new_limits: bool,
}

impl Dwell {
    /// The target of this frame, `delta_seconds` after the last: `wanted`, or the one in use.
    /// `cost_of` is what settings cost here, in the watts of `limits`.
    pub(super) fn choose(
        &mut self,
        wanted: KnobLevels,
        limits: &Limits,
        delta_seconds: f64,
        dwell_seconds: f64,
        cost_of: impl FnOnce(KnobLevels) -> Option<CostPoint>,
    ) -> KnobLevels {
        self.seconds += if delta_seconds > 0.0 { delta_seconds } else { 0.0 };
        let limits = (limits.power.map(|limit| limit.0), limits.error);
        let is_other = differs(limits.0, self.power) || differs(limits.1, self.error);
        self.has_new_limits = is_other;
        if is_other {
            (self.power, self.error) = limits;
        }
        if self.target == Some(wanted) {
            return wanted;
        }
        // An error limit is one on the mean: what another view leaves unspent is spent here, and what
        // waits is paid elsewhere. On recorded tours dwelling cost a third of what addresses save.
        let limit = limits.0.filter(|limit| *limit < f64::INFINITY);
        let keeps = |cost: CostPoint| {
            limit.is_some_and(|limit| cost.power.0 <= limit)
                && limits.1.is_none_or(|limit| cost.error <= limit)
        };
        // Not `>=`, so that NaN does not wait for ever.
        let may_wait = !is_other && self.seconds < dwell_seconds;
        if let Some(held) = self.target.filter(|_| may_wait)
            && cost_of(held).is_some_and(keeps)
        {
            return held;
        }
        (self.target, self.seconds) = (Some(wanted), 0.0);
        wanted
    }

    /// Lets the next target in at once.
    pub(super) fn end(&mut self) {
        self.target = None;
    }
}

fn differs(now: Option<f64>, then: Option<f64>) -> bool {
    match (now, then) {
        (Some(now), Some(then)) => {
            // Equal infinities do not differ, and NaN, for which nothing is near, does.
            let is_near = (now - then).abs() <= OTHER_LIMIT * then.abs();
            now != then && !is_near
        }
        (now, then) => now.is_some() != then.is_some(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::Budget;
    use crate::units::Watts;

    fn limits(budget: Budget) -> Limits {
        budget.limits().expect("valid limits")
    }

    const LOW: KnobLevels = KnobLevels::from_bits(1);
    const HIGH: KnobLevels = KnobLevels::from_bits(2);

    fn cost(settings: KnobLevels) -> Option<CostPoint> {
        Some(if settings == LOW { CostPoint::new(5.0, 0.03) } else { CostPoint::new(6.0, 0.01) })
    }

    #[test]
    fn alternating_targets_change_once_a_second() {
        let (mut dwell, budget) = (Dwell::default(), limits(Budget::power(Watts(7.0))));
        let (mut last, mut changes) = (LOW, 0);
        for frame in 0..600 {
            let wanted = if (frame / 6) % 2 == 0 { LOW } else { HIGH };
            let target = dwell.choose(wanted, &budget, 1.0 / 60.0, 1.0, cost);
            changes += usize::from(target != last);
            last = target;
        }
        assert!((5..=10).contains(&changes), "{changes} in ten seconds");
    }

    #[test]
    fn the_first_change_a_broken_limit_another_budget_and_a_cut_do_not_wait() {
        let start = |budget: &Limits| {
            let mut dwell = Dwell::default();
            assert_eq!(dwell.choose(LOW, budget, 0.1, 1.0, cost), LOW);
            for _ in 0..20 {
                assert_eq!(dwell.choose(LOW, budget, 0.1, 1.0, cost), LOW);
            }
            assert_eq!(dwell.choose(HIGH, budget, 0.1, 1.0, cost), HIGH, "after a rest");
            dwell
        };
        let wide = limits(Budget::power(Watts(7.0)));
        assert_eq!(start(&wide).choose(LOW, &wide, 0.1, 1.0, cost), HIGH);
        let dearer = |_| Some(CostPoint::new(7.5, 0.01));
        assert_eq!(start(&wide).choose(LOW, &wide, 0.1, 1.0, dearer), LOW, "a broken limit");
        let near = limits(Budget::power(Watts(6.9)));
        assert_eq!(start(&wide).choose(LOW, &near, 0.1, 1.0, cost), HIGH, "a drifting limit");
        for other in [Budget::power(Watts(6.3)), Budget::default(), Budget::error(0.1)] {
            assert_eq!(start(&wide).choose(LOW, &limits(other), 0.1, 1.0, cost), LOW, "{other:?}");
        }
        let both = limits(Budget::both(Watts(7.0), 0.012));
        assert_eq!(start(&both).choose(LOW, &both, 0.1, 1.0, cost), HIGH);
        let worse = |_| Some(CostPoint::new(5.0, 0.03));
        assert_eq!(start(&both).choose(LOW, &both, 0.1, 1.0, worse), LOW, "a broken limit");
        let mean = limits(Budget::error(0.012));
        assert_eq!(start(&mean).choose(LOW, &mean, 0.1, 1.0, cost), LOW, "a limit on the mean");
        let mut cut = start(&wide);
        cut.end();
        assert_eq!(cut.choose(LOW, &wide, 0.1, 1.0, cost), LOW);
        assert_eq!(start(&wide).choose(LOW, &wide, 0.1, f64::NAN, cost), LOW);
        assert_eq!(start(&wide).choose(LOW, &wide, 0.1, 1.0, |_| None), LOW, "unknown");
    }
}
