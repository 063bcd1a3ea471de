//! Dwell: how long a target stays before another takes its place.
//!
//! A change of settings is visible, a brief gain is not. So a target stays for a least time, and
//! then until another is worth the change, unless the budget cannot bear it. The first change after
//! a rest does not wait.

use glam::Vec3;

use super::Choice;
use crate::frontier::CostPoint;
use crate::knobs::KnobLevels;

/// Least gain in power + λ × error of a change that spends less, as a share of the new power.
/// Higher values switch less often and follow views less closely.
const LEAST_GAIN: f64 = 0.02;
/// Distance, metres, and cosine of the angle from which a view has moved.
const MOVED: (f32, f32) = (0.2, 0.996);
/// Exchange rate that stands for an infinite one, where powers decide between equal errors.
const LARGE_RATE: f64 = 1e12;

/// The target in use, and since when.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Dwell {
    target: Option<KnobLevels>,
    seconds: f64,
    /// Position and viewing direction at the last change.
    view: Option<(Vec3, Vec3)>,
    has_moved: bool,
}

impl Dwell {
    /// Tells of this frame's position and viewing direction.
    pub(super) fn see(&mut self, (position, forward): (Vec3, Vec3)) {
        let then = *self.view.get_or_insert((position, forward));
        // Not `<`, so that NaN is no movement.
        self.has_moved |= position.distance(then.0) > MOVED.0 || forward.dot(then.1) < MOVED.1;
    }

    /// Whether the view has moved since the target changed last.
    pub(super) fn has_moved(&self) -> bool {
        self.has_moved
    }

    /// The target of this frame, `delta_seconds` after the last: that of `wanted`, or the one in use.
    /// `cost_of` is what settings cost here, in the watts of `wanted`.
    pub(super) fn choose(
        &mut self,
        wanted: &Choice,
        delta_seconds: f64,
        dwell_seconds: f64,
        cost_of: impl FnOnce(KnobLevels) -> Option<CostPoint>,
    ) -> KnobLevels {
        self.seconds += if delta_seconds > 0.0 { delta_seconds } else { 0.0 };
        if self.target == Some(wanted.settings) {
            return wanted.settings;
        }
        let stays = |cost: CostPoint| {
            let is_borne = cost.power <= wanted.most.power && cost.error <= wanted.most.error;
            let rate = wanted.watts_per_error.min(LARGE_RATE);
            let sum = |cost: CostPoint| cost.power.0 + rate * cost.error;
            let gain = sum(cost) - sum(wanted.cost);
            // What is left of the budget is spent where it can be borne.
            let spends = match wanted.most.error.is_finite() {
                true => wanted.cost.power < cost.power,
                false => wanted.cost.power > cost.power,
            };
            let least = if spends { 0.0 } else { LEAST_GAIN * wanted.cost.power.0.abs() };
            // Not `>=`, so that NaN does not wait for ever.
            is_borne && (self.seconds < dwell_seconds || gain < least)
        };
        if let Some(held) = self.target
            && cost_of(held).is_some_and(stays)
        {
            return held;
        }
        (self.target, self.seconds) = (Some(wanted.settings), 0.0);
        (self.view, self.has_moved) = (None, false);
        wanted.settings
    }

    /// Lets the next target in at once.
    pub(super) fn end(&mut self) {
        self.target = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::Outcome;

    const LOW: KnobLevels = KnobLevels::from_bits(1);
    const HIGH: KnobLevels = KnobLevels::from_bits(2);

    fn cost(settings: KnobLevels) -> Option<CostPoint> {
        Some(if settings == LOW { CostPoint::new(5.0, 0.03) } else { CostPoint::new(6.0, 0.01) })
    }

    /// A choice of which the budget can bear `most` watts, at `rate` watts per unit of error.
    fn wanting(settings: KnobLevels, most: f64, rate: f64) -> Choice {
        Choice {
            settings,
            cost: cost(settings).expect("a cost"),
            outcome: Outcome::Met,
            binding: None,
            most: CostPoint::new(most, f64::INFINITY),
            watts_per_error: rate,
        }
    }

    #[test]
    fn alternating_targets_change_once_a_second() {
        let (mut dwell, mut last, mut changes) = (Dwell::default(), LOW, 0);
        for frame in 0..600 {
            // One is worth the change, and then the other.
            let (wanted, rate) = if (frame / 6) % 2 == 0 { (LOW, 10.0) } else { (HIGH, 100.0) };
            let target = dwell.choose(&wanting(wanted, 7.0, rate), 1.0 / 60.0, 1.0, cost);
            changes += usize::from(target != last);
            last = target;
        }
        assert!((5..=10).contains(&changes), "{changes} in ten seconds");
    }

    #[test]
    fn the_first_change_a_budget_that_cannot_bear_it_and_a_cut_do_not_wait() {
        let start = || {
            let mut dwell = Dwell::default();
            assert_eq!(dwell.choose(&wanting(LOW, 7.0, 1.0), 0.1, 1.0, cost), LOW);
            for _ in 0..20 {
                assert_eq!(dwell.choose(&wanting(LOW, 7.0, 1.0), 0.1, 1.0, cost), LOW);
            }
            assert_eq!(dwell.choose(&wanting(HIGH, 7.0, 100.0), 0.1, 1.0, cost), HIGH);
            dwell
        };
        assert_eq!(start().choose(&wanting(LOW, 7.0, 1.0), 0.1, 1.0, cost), HIGH);
        assert_eq!(start().choose(&wanting(LOW, 5.9, 1.0), 0.1, 1.0, cost), LOW, "not borne");
        let mut cut = start();
        cut.end();
        assert_eq!(cut.choose(&wanting(LOW, 7.0, 1.0), 0.1, 1.0, cost), LOW);
        let now = |dwell_seconds, cost: fn(KnobLevels) -> Option<CostPoint>| {
            start().choose(&wanting(LOW, 7.0, 1.0), 0.1, dwell_seconds, cost)
        };
        assert_eq!(now(f64::NAN, cost), LOW);
        assert_eq!(now(1.0, |_| None), LOW, "unknown");
        let nothing = |_| Some(CostPoint::new(f64::NAN, f64::NAN));
        assert_eq!(now(1.0, nothing), LOW, "no number");
    }

    #[test]
    fn a_change_must_be_worth_it() {
        let mut dwell = Dwell::default();
        dwell.choose(&wanting(LOW, 7.0, 50.0), 0.1, 0.0, cost);
        // 6 W and 0.01 for 5 W and 0.03: worth it from 50 W for each unit of error, and back a little
        // below that.
        for (wanted, rate, expected) in
            [(HIGH, 49.0, LOW), (HIGH, 51.0, HIGH), (LOW, 49.0, HIGH), (LOW, 44.0, LOW)]
        {
            let found = dwell.choose(&wanting(wanted, 7.0, rate), 0.1, 0.0, cost);
            assert_eq!(found, expected, "{rate}");
        }
        // Where the error's limit decides, the cheaper one spends.
        let by_error = |settings, rate| {
            let choice = wanting(settings, 7.0, rate);
            Choice { most: CostPoint::new(7.0, 0.1), ..choice }
        };
        assert_eq!(dwell.choose(&by_error(HIGH, 51.0), 0.1, 0.0, cost), LOW);
        assert_eq!(dwell.choose(&by_error(HIGH, 60.0), 0.1, 0.0, cost), HIGH);
        // In a still view errors alone count, and what is better stays while it can be borne.
        assert_eq!(dwell.choose(&wanting(LOW, 7.0, f64::INFINITY), 9.0, 0.0, cost), HIGH);
        assert_eq!(dwell.choose(&wanting(LOW, 5.5, f64::INFINITY), 9.0, 0.0, cost), LOW);
    }

    #[test]
    fn a_view_moves_by_distance_or_angle_and_rests_at_a_change() {
        let mut dwell = Dwell::default();
        dwell.choose(&wanting(LOW, 7.0, 1.0), 0.1, 1.0, cost);
        for (position, forward, expected) in [
            (Vec3::ZERO, Vec3::NEG_Z, false),
            (Vec3::X * 0.1, Vec3::NEG_Z, false),
            (Vec3::splat(f32::NAN), Vec3::NEG_Z, false),
            (Vec3::X * 0.3, Vec3::NEG_Z, true),
            (Vec3::ZERO, Vec3::NEG_Z, true),
        ] {
            dwell.see((position, forward));
            assert_eq!(dwell.has_moved(), expected, "{position}");
        }
        dwell.choose(&wanting(HIGH, 7.0, 100.0), 9.0, 1.0, cost);
        assert!(!dwell.has_moved());
        dwell.see((Vec3::ZERO, Vec3::NEG_Z));
        dwell.see((Vec3::ZERO, Vec3::new(0.1, 0.0, -1.0).normalize()));
        assert!(dwell.has_moved(), "turned");
    }
}
