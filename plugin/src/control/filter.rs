//! Temporal filter: moves settings to their target level by level, so that quality never jumps.
//!
//! Wang et al. 2016, equation 3.8: `s = round((1 − t/T)·s_old + (t/T)·s_new)` for each knob, t
//! seconds after the target changed; T is 2 s there and 1 s here. For a constant target the filter
//! equals this closed form.
//!
//! The equation does not cover a target that changes before T has passed. Options:
//! 1. Restart all knobs. While the camera turns, knobs with an unchanged target would never arrive.
//! 2. Restart, from the applied level, the knobs whose own target changed. A target that alternates
//!    between two levels far below holds the knob up: the budget stays exceeded.
//! 3. Continue from the unrounded position. Every knob progresses, but a target that alternates at
//!    a leaf's border holds the position near one half, where each change flips the level.
//!
//! We use option 3 with hysteresis: a level reverses its last change only `REVERSAL_MARGIN` beyond
//! the half-way point. The position is then a running mean of the target. A moving knob keeps its
//! rate while its target stays on the same side, so it reaches the range of its targets within T
//! whatever the targets do inside that range.
//!
//! T may differ up and down ([`TransitionTimes`]): settings fall quickly when the power limit is
//! exceeded, and rise slowly when power is left over.

use bevy::ecs::component::Component;
use bevy::ecs::reflect::ReflectComponent;
use bevy::prelude::ReflectDefault;
use bevy::reflect::Reflect;

use crate::knobs::{KnobLevels, KnobSpace};

/// Upper limit of one step, in seconds. A longer step ends every transition anyway.
const MAX_STEP_SECONDS: f64 = 1e9;

/// Distance beyond the half-way point at which a position reverses the last change of its level, in
/// levels.
///
/// Higher values suppress more level changes under an alternating target. The margin must stay
/// below one half, so that a knob at rest is at its target. A target that alternates between
/// neighbouring levels then moves the level only if it stays at each for more than half a
/// transition. A target that alternates between levels A apart, h seconds at each, makes the
/// position oscillate over A·r·f / (r + f − r·f) levels, where r and f are h in units of the rise
/// and fall times; up to two margins, the level comes to rest.
const REVERSAL_MARGIN: f64 = 0.25;

/// Duration of a knob's transition to its new level. Levels are ordered cheapest first: falling
/// saves power, rising reduces error.
///
/// Unit: seconds, 0 to infinity. Higher values change quality more gradually and take longer to end
/// an excess over the budget. 0 and negative values switch at once, infinity never switches, NaN
/// means the default:
/// [`ControlSettings::TRANSITION_SECONDS`](super::ControlSettings::TRANSITION_SECONDS) in both
/// directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TransitionTimes {
    /// To a more expensive level, seconds. Lower values raise quality sooner and more visibly;
    /// higher values save power during the transition.
    pub rise_seconds: f64,
    /// To a cheaper level, seconds. Lower values reduce power sooner and more visibly; higher
    /// values keep quality, at its power, during the transition.
    pub fall_seconds: f64,
}

impl TransitionTimes {
    /// `seconds` in both directions, as in the closed form of Wang et al.
    pub const fn both(seconds: f64) -> Self {
        Self { rise_seconds: seconds, fall_seconds: seconds }
    }

    /// Fraction of a transition in `delta_seconds`, 0 to 1, for a knob with `remaining` levels to
    /// go.
    fn fraction(self, delta_seconds: f64, remaining: f64) -> f64 {
        let seconds = if remaining > 0.0 { self.rise_seconds } else { self.fall_seconds };
        let seconds =
            if seconds.is_nan() { super::ControlSettings::TRANSITION_SECONDS } else { seconds };
        if seconds <= 0.0 { 1.0 } else { (delta_seconds / seconds).min(1.0) }
    }
}

impl Default for TransitionTimes {
    fn default() -> Self {
        Self::both(super::ControlSettings::TRANSITION_SECONDS)
    }
}

/// Direction of a level's last change since its knob was at rest.
#[derive(Clone, Copy, Debug, Default, PartialEq, Reflect)]
enum Change {
    #[default]
    None,
    Up,
    Down,
}

/// The transition of one knob.
#[derive(Clone, Copy, Debug, Default, PartialEq, Reflect)]
struct Transition {
    /// Unrounded position, in levels.
    position: f64,
    to: u8,
    /// Levels per transition, at least the remaining distance. Not per second, so that times may
    /// change during a transition.
    rate: f64,
    /// The applied level.
    level: u8,
    last: Change,
}

impl Transition {
    fn at_rest(level: u8) -> Self {
        Self { position: f64::from(level), to: level, rate: 0.0, level, last: Change::None }
    }

    /// Remaining levels; negative downwards.
    fn remaining(&self) -> f64 {
        f64::from(self.to) - self.position
    }

    fn advance(&mut self, delta_seconds: f64, times: TransitionTimes) {
        let remaining = self.remaining();
        let step = self.rate * times.fraction(delta_seconds, remaining);
        // Set exactly at the end: rounding errors must not prolong a transition for ever.
        self.position = if remaining.abs() <= step {
            f64::from(self.to)
        } else {
            self.position + step.copysign(remaining)
        };
    }

    fn turn_to(&mut self, to: u8) {
        let before = self.remaining();
        self.to = to;
        let after = self.remaining();
        // A knob that slowed at each change of the target's distance would never arrive.
        let same_side = before * after > 0.0;
        self.rate = if same_side { self.rate.max(after.abs()) } else { after.abs() };
        if before == 0.0 {
            self.last = Change::None;
        }
    }

    /// Rounds the position as the closed form does, with hysteresis on reversals.
    fn round(&mut self) {
        let margin = |taken_back| if self.last == taken_back { REVERSAL_MARGIN } else { 0.0 };
        let (up, down) = (0.5 + margin(Change::Down), 0.5 + margin(Change::Up));
        let offset = self.position - f64::from(self.level);
        // A tie rounds up, as in `f64::round`: positions are never negative.
        let change = if offset >= up {
            Change::Up
        } else if offset < -down {
            Change::Down
        } else {
            return;
        };
        self.level = self.position.round() as u8;
        self.last = change;
    }
}

/// The temporal filter of one camera.
#[derive(Component, Clone, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Default, Clone, Debug, PartialEq)]
pub struct SettingsFilter {
    transitions: [Transition; KnobLevels::MAX_KNOBS],
    applied: KnobLevels,
    /// Whether the next step continues from `applied` instead of jumping to its target.
    smooth: bool,
}

impl SettingsFilter {
    /// Settings of the last step; all levels 0 before the first.
    pub fn applied(&self) -> KnobLevels {
        self.applied
    }

    /// Makes the next step jump to its target. Call it when the camera cuts to another place: no
    /// transition from the previous image is visible. The first step of a new filter jumps too.
    pub fn cut(&mut self) {
        self.smooth = false;
    }

    /// Whether the next step continues from the applied settings: false after a [cut](Self::cut)
    /// and before the first step.
    pub fn is_smooth(&self) -> bool {
        self.smooth
    }

    /// Continues from `settings`, which were applied outside this filter, at the start of a full
    /// transition.
    pub fn resume_from(&mut self, settings: KnobLevels) {
        for (knob, transition) in self.transitions.iter_mut().enumerate() {
            *transition = Transition::at_rest(settings.level(knob) as u8);
        }
        self.applied = settings;
        self.smooth = true;
    }

    /// Advances by `delta_seconds` towards `target` and returns the settings to apply, always valid
    /// in `space`.
    ///
    /// A transition from rest takes its entry in `times`, whatever its length in levels. The step
    /// itself belongs to the previous target: a new target starts at t = 0. A negative or NaN step
    /// counts as 0. Levels of `target` beyond those of `space` are clamped.
    pub fn step(
        &mut self,
        space: &KnobSpace,
        target: KnobLevels,
        delta_seconds: f64,
        times: TransitionTimes,
    ) -> KnobLevels {
        // Not `clamp` alone, which lets NaN pass.
        let delta_seconds =
            if delta_seconds > 0.0 { delta_seconds.min(MAX_STEP_SECONDS) } else { 0.0 };
        let target = space.from_levels(|knob, _| target.level(knob));
        if !self.smooth {
            self.resume_from(target);
            return target;
        }
        let transitions = &mut self.transitions;
        self.applied = space.from_levels(|index, knob| {
            let transition = &mut transitions[index];
            let highest = (knob.levels.len() - 1) as f64;
            transition.advance(delta_seconds, times);
            // Resumed settings may belong to a larger space. `max` also rejects NaN, which
            // reflection may write.
            transition.position = transition.position.max(0.0).min(highest);
            let to = target.level(index) as u8;
            if transition.to != to {
                transition.turn_to(to);
                // A time of 0 completes the transition here.
                transition.advance(0.0, times);
            }
            transition.round();
            usize::from(transition.level)
        });
        self.applied
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::frontier::testing::space;
    use crate::knobs::Knob;

    const TWO: TransitionTimes = TransitionTimes::both(2.0);
    /// As under power limits: settings fall faster.
    const QUICK_FALL: TransitionTimes = TransitionTimes { rise_seconds: 2.0, fall_seconds: 0.5 };
    const QUICK_RISE: TransitionTimes = TransitionTimes { rise_seconds: 0.5, fall_seconds: 2.0 };
    const FRAME: f64 = 1.0 / 60.0;

    fn settings(samples: usize, scale: usize) -> KnobLevels {
        KnobLevels::default().with_level(0, samples).with_level(1, scale)
    }

    /// One knob of 16 levels and one of 8.
    fn long_space() -> KnobSpace {
        let knob = |name, levels: usize| Knob::new(name, (0..levels).map(|level| level as f64));
        KnobSpace::new(vec![knob("long", 16), knob("shorter", 8)]).expect("a valid space")
    }

    fn started(at: KnobLevels) -> SettingsFilter {
        let mut filter = SettingsFilter::default();
        assert_eq!(filter.step(&long_space(), at, 0.1, TWO), at, "the first step is not smoothed");
        filter
    }

    /// The first knob's level in each frame while the target alternates every `frames` frames,
    /// starting with the first target.
    fn alternate(
        from: usize,
        targets: [usize; 2],
        frames: usize,
        seconds: f64,
        times: TransitionTimes,
    ) -> Vec<usize> {
        let mut filter = started(settings(from, 0));
        let count = (seconds / FRAME).round() as usize;
        let step = |frame| {
            filter
                .step(&long_space(), settings(targets[frame / frames % 2], 0), FRAME, times)
                .level(0)
        };
        (0..count).map(step).collect()
    }

    fn changes(levels: &[usize]) -> usize {
        levels.windows(2).filter(|pair| pair[0] != pair[1]).count()
    }

    #[test]
    fn a_constant_target_follows_the_closed_form() {
        for (old, new) in [
            (settings(0, 0), settings(4, 2)),
            (settings(4, 2), settings(0, 1)),
            (settings(1, 2), settings(3, 0)),
        ] {
            let mut filter = started(old);
            for frame in 0..200 {
                // The first frame sees the new target at t = 0.
                let got = filter.step(&space(), new, 1.0 / 64.0, TWO);
                let share = (f64::from(frame) / 64.0 / 2.0).min(1.0);
                let level = |knob| {
                    ((1.0 - share) * old.level(knob) as f64 + share * new.level(knob) as f64)
                        .round() as usize
                };
                assert_eq!(got, settings(level(0), level(1)), "frame {frame}");
            }
            assert_eq!(filter.applied(), new);
        }
    }

    #[test]
    fn a_transition_from_rest_follows_the_closed_form() {
        let mut filter = started(settings(0, 0));
        for target in [settings(4, 2), settings(0, 0), settings(3, 1), settings(1, 2)] {
            let old = filter.applied();
            for frame in 0..=128 {
                let got = filter.step(&space(), target, 1.0 / 64.0, TWO);
                let share = f64::from(frame) / 64.0 / 2.0;
                let level = |knob| {
                    ((1.0 - share) * old.level(knob) as f64 + share * target.level(knob) as f64)
                        .round() as usize
                };
                assert_eq!(got, settings(level(0), level(1)), "frame {frame}");
            }
        }
    }

    #[test]
    fn levels_change_one_by_one() {
        let mut filter = started(settings(0, 0));
        let mut last = filter.applied();
        for _ in 0..200 {
            let next = filter.step(&space(), settings(4, 2), FRAME, TWO);
            assert!((0..2).all(|knob| next.level(knob) - last.level(knob) <= 1));
            last = next;
        }
        assert_eq!(last, settings(4, 2));
    }

    #[test]
    fn a_changed_target_starts_from_where_the_knob_is() {
        let mut filter = started(settings(0, 0));
        filter.step(&space(), settings(4, 2), 0.0, TWO);
        assert_eq!(filter.step(&space(), settings(4, 2), 1.125, TWO), settings(2, 1));
        // The samples reverse at 2.25, 2 s away from 0; the scale continues and arrives on time.
        assert_eq!(filter.step(&space(), settings(0, 2), 0.0, TWO), settings(2, 1));
        assert_eq!(
            filter.step(&space(), settings(0, 2), 0.375, TWO),
            settings(2, 2),
            "1.83: level 2 holds down to 1.25"
        );
        assert_eq!(filter.step(&space(), settings(0, 2), 0.500, TWO), settings(2, 2), "1.27");
        assert_eq!(filter.step(&space(), settings(0, 2), 0.125, TWO), settings(1, 2), "1.13");
        assert_eq!(filter.step(&space(), settings(0, 2), 0.500, TWO), settings(1, 2), "0.56");
        assert_eq!(
            filter.step(&space(), settings(0, 2), 0.125, TWO),
            settings(0, 2),
            "0.42: no margin the second time"
        );
        // A farther target on the same side speeds the knob up.
        filter.resume_from(settings(0, 0));
        filter.step(&space(), settings(2, 0), 0.0, TWO);
        assert_eq!(
            filter.step(&space(), settings(4, 0), 0.5, TWO),
            settings(1, 0),
            "0.5, with 3.5 to go"
        );
        assert_eq!(filter.step(&space(), settings(4, 0), 1.0, TWO), settings(2, 0), "2.25");
        // A nearer one does not slow it down.
        assert_eq!(filter.step(&space(), settings(3, 0), 0.0, TWO), settings(2, 0));
        assert_eq!(filter.step(&space(), settings(3, 0), 0.25, TWO), settings(3, 0), "2.69");
    }

    #[test]
    fn a_target_that_alternates_does_not_starve_the_knob() {
        for (times, seconds) in [(TWO, 2.0), (QUICK_FALL, 0.5), (QUICK_RISE, 2.0)] {
            // 0.2 s each; also one frame each, for a camera on a leaf's border.
            for frames in [12, 1] {
                for targets in [[2, 3], [3, 2]] {
                    let levels = alternate(7, targets, frames, 60.0, times);
                    // The first frame is t = 0.
                    let arrived = 1 + (seconds / FRAME).round() as usize;
                    assert_eq!(levels[0], 7);
                    assert!(levels.is_sorted_by(|a, b| a >= b), "it only falls: {levels:?}");
                    assert!(
                        levels[arrived..].iter().all(|level| [2, 3].contains(level)),
                        "{times:?}: {levels:?}"
                    );
                    assert!(changes(&levels) <= 5, "{times:?}: {levels:?}");
                }
            }
        }
    }

    #[test]
    fn rising_and_falling_take_their_own_times() {
        for (times, up, down) in [(QUICK_FALL, 2.0, 0.5), (QUICK_RISE, 0.5, 2.0)] {
            // One knob rises from 0 to 4 while the other falls from 4 to 0.
            let mut filter = started(settings(0, 4));
            for frame in 0..=128 {
                let got = filter.step(&long_space(), settings(4, 0), 1.0 / 64.0, times);
                let share = |seconds: f64| (f64::from(frame) / 64.0 / seconds).min(1.0);
                let expected = settings(
                    (4.0 * share(up)).round() as usize,
                    (4.0 - 4.0 * share(down)).round() as usize,
                );
                assert_eq!(got, expected, "{times:?}, frame {frame}");
            }
        }
    }

    #[test]
    fn a_target_that_flips_does_not_make_the_level_flip() {
        for times in [TWO, QUICK_FALL, QUICK_RISE] {
            for (from, targets) in [(1, [0, 1]), (1, [1, 0]), (0, [0, 1]), (0, [1, 0])] {
                // 0.1 s each. The position converges to an oscillation about the target's mean,
                // 0.04 levels wide at most. It may cross one half once; a second crossing needs an
                // oscillation of half a level.
                let levels = alternate(from, targets, 6, 10.0, times);
                assert!(changes(&levels) <= 1, "{times:?}, {from}, {targets:?}: {levels:?}");
            }
            // Just under half of the longer duration each: the longest that must have no effect.
            let levels = alternate(1, [0, 1], 59, 60.0, times);
            assert!(changes(&levels) <= 1, "{times:?}: {levels:?}");
        }
        // Over many levels the transition to the mean takes several changes without a reversal,
        // also when the target alternates every frame.
        for frames in [6, 1] {
            let levels = alternate(7, [0, 7], frames, 10.0, TWO);
            assert!(levels.is_sorted_by(|a, b| a >= b), "{levels:?}");
            assert!([3, 4].contains(&levels[levels.len() - 1]), "{levels:?}");
        }
    }

    #[test]
    fn a_target_that_stays_long_enough_is_followed_each_time() {
        for times in [TWO, QUICK_FALL, QUICK_RISE] {
            let levels = alternate(1, [0, 1], 121, 121.0 * 10.0 * FRAME, times);
            assert_eq!(changes(&levels), 10, "{times:?}: {levels:?}");
        }
    }

    #[test]
    fn cuts_and_zero_length_transitions_act_at_once() {
        let [now, before, default, long] = [0.0, -1.0, f64::NAN, 1e6].map(TransitionTimes::both);
        let mut filter = started(settings(0, 0));
        filter.step(&space(), settings(4, 2), 0.1, TWO);
        filter.cut();
        assert!(!filter.is_smooth());
        assert_eq!(filter.step(&space(), settings(4, 0), 0.0, TWO), settings(4, 0));
        assert_eq!(
            filter.step(&space(), settings(0, 0), 0.0, TWO),
            settings(4, 0),
            "a cut is over after one step"
        );
        assert_eq!(filter.step(&space(), settings(3, 1), 0.0, now), settings(3, 1));
        assert_eq!(filter.step(&space(), settings(1, 2), 0.0, before), settings(1, 2));
        assert_eq!(
            filter.step(&space(), settings(2, 2), 0.0, default),
            settings(1, 2),
            "NaN is the default length"
        );
        assert_eq!(filter.step(&space(), settings(2, 2), 0.375, default), settings(1, 2));
        assert_eq!(filter.step(&space(), settings(2, 2), 0.125, default), settings(2, 2));
        assert_eq!(
            filter.step(&space(), settings(2, 2), 0.0, long),
            settings(2, 2),
            "a longer transition takes nothing back"
        );
        filter.resume_from(settings(0, 2));
        assert_eq!(
            filter.step(&space(), settings(2, 2), 9.0, TWO),
            settings(0, 2),
            "t = 0 on the frame of the change"
        );
        // Immediate in one direction only.
        let falls = TransitionTimes { rise_seconds: 2.0, fall_seconds: 0.0 };
        filter.resume_from(settings(0, 2));
        assert_eq!(filter.step(&space(), settings(2, 0), 0.0, falls), settings(0, 0));
        assert_eq!(filter.step(&space(), settings(2, 0), 2.0, falls), settings(2, 0));
    }

    #[test]
    fn extreme_steps_are_safe() {
        let never = TransitionTimes::both(f64::INFINITY);
        let mut filter = started(settings(0, 0));
        filter.step(&space(), settings(4, 2), 0.0, TWO);
        for delta in [f64::NAN, -5.0, f64::NEG_INFINITY, 0.0] {
            assert_eq!(filter.step(&space(), settings(4, 2), delta, TWO), settings(0, 0));
        }
        for delta in [f64::INFINITY, 1e300, 1.0] {
            assert_eq!(
                filter.step(&space(), settings(4, 2), delta, never),
                settings(0, 0),
                "infinity never moves"
            );
            assert_eq!(filter.step(&space(), settings(3, 1), delta, never), settings(0, 0));
        }
        filter.step(&space(), settings(4, 2), 0.0, never);
        assert_eq!(
            filter.step(&space(), settings(4, 2), f64::INFINITY, TWO),
            settings(4, 2),
            "and breaks nothing"
        );
        // The shortest possible transition.
        let least = TransitionTimes::both(f64::from_bits(1));
        assert_eq!(filter.step(&space(), settings(3, 1), 0.0, least), settings(4, 2));
        assert_eq!(filter.step(&space(), settings(3, 1), 1.0, least), settings(3, 1));
        filter.resume_from(settings(3, 1));
        assert_eq!(
            filter.step(&space(), settings(3, 1), 1.0, least),
            settings(3, 1),
            "nothing times infinity"
        );
    }

    #[test]
    fn settings_of_a_larger_space_start_at_the_highest_level() {
        let mut filter = started(settings(0, 0));
        filter.resume_from(settings(15, 15));
        assert_eq!(filter.step(&space(), settings(0, 2), 0.0, TWO), settings(4, 2));
        assert_eq!(
            filter.step(&space(), settings(0, 2), 1.0, TWO),
            settings(2, 2),
            "half of the distance from 4"
        );
    }

    /// Seconds per transition: any value, with many usual ones.
    fn any_seconds() -> impl Strategy<Value = f64> {
        prop_oneof![prop::num::f64::ANY, 0.0..4.0]
    }

    fn usual_times() -> impl Strategy<Value = TransitionTimes> {
        (0.1..4.0, 0.1..4.0)
            .prop_map(|(rise_seconds, fall_seconds)| TransitionTimes { rise_seconds, fall_seconds })
    }

    /// A filter after any sequence of steps.
    fn mid_transition() -> impl Strategy<Value = SettingsFilter> {
        (usual_times(), prop::collection::vec((any::<u64>(), 0.0..0.5), 1..20)).prop_map(
            |(times, steps)| {
                let mut filter = SettingsFilter::default();
                for (bits, delta) in steps {
                    filter.step(&long_space(), KnobLevels::from_bits(bits), delta, times);
                }
                filter
            },
        )
    }

    proptest! {
        #[test]
        fn every_step_returns_settings_of_the_space(
            steps in prop::collection::vec((any::<u64>(), any_seconds(), any_seconds(), any_seconds(), any::<bool>()), 0..50),
        ) {
            let mut filter = SettingsFilter::default();
            for (bits, delta, rise_seconds, fall_seconds, cut) in steps {
                if cut && bits % 3 == 0 {
                    filter.cut();
                } else if bits % 7 == 0 {
                    filter.resume_from(KnobLevels::from_bits(!bits));
                }
                let space = if bits % 5 == 0 { long_space() } else { space() };
                let given = filter.step(&space, KnobLevels::from_bits(bits), delta, TransitionTimes { rise_seconds, fall_seconds });
                prop_assert!(space.contains(given));
                prop_assert_eq!(given, filter.applied());
                for transition in &filter.transitions {
                    prop_assert!((0.0..=15.0).contains(&transition.position) && transition.rate.is_finite(), "{transition:?}");
                }
            }
        }

        #[test]
        fn a_knob_enters_its_targets_range_in_time_and_stays_inside(
            mut filter in mid_transition(),
            times in usual_times(),
            targets in prop::collection::vec((any::<u64>(), 0.0..0.2, 1_usize..9), 1..100),
            low in 0_usize..16,
            width in 0_usize..4,
        ) {
            let space = long_space();
            let high = (low + width).min(15);
            let longest = times.rise_seconds.max(times.fall_seconds);
            let target = |bits: u64| space.from_levels(|knob, _| low + bits as usize / (1 + 99 * knob) % (high - low + 1));
            // t = 0: this step belongs to the previous target.
            filter.step(&space, target(targets[0].0), 0.3, times);
            let mut elapsed = 0.0;
            let mut inside = [false; 2];
            for (bits, delta, frames) in targets {
                for _ in 0..frames {
                    let given = filter.step(&space, target(bits), delta, times);
                    elapsed += delta;
                    for (knob, inside) in inside.iter_mut().enumerate() {
                        let highest = space.knobs()[knob].levels.len() - 1;
                        let is = (low.min(highest)..=high.min(highest)).contains(&given.level(knob));
                        prop_assert!(is || !*inside, "knob {knob} left again after {elapsed} s: {given:?}");
                        prop_assert!(is || elapsed < longest * (1.0 + 1e-9), "knob {knob} is late after {elapsed} s: {given:?}");
                        *inside = is;
                    }
                }
            }
        }

        #[test]
        fn a_constant_target_is_approached_monotonically(
            mut filter in mid_transition(),
            times in usual_times(),
            bits in any::<u64>(),
            deltas in prop::collection::vec(0.0..0.2, 1..100),
        ) {
            let space = long_space();
            let target = space.from_levels(|knob, _| KnobLevels::from_bits(bits).level(knob));
            filter.step(&space, target, 0.0, times);
            for delta in deltas {
                let before = filter.clone();
                let given = filter.step(&space, target, delta, times);
                for knob in 0..2 {
                    let (was, is, to) = (before.applied.level(knob), given.level(knob), target.level(knob));
                    prop_assert!((was..=to).contains(&is) || (to..=was).contains(&is), "{was}, {is}, to {to}");
                    let (was, is) = (before.transitions[knob].remaining(), filter.transitions[knob].remaining());
                    prop_assert!(is.abs() <= was.abs(), "{was}, {is}");
                }
            }
        }
    }
}
