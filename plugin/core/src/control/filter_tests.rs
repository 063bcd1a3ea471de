use std::time::Duration;

use proptest::prelude::*;

use super::*;
use crate::knobs::Knob;
use crate::testing::space;

const TWO: Duration = Duration::from_secs(2);
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
fn alternate(from: usize, targets: [usize; 2], frames: usize, seconds: f64) -> Vec<usize> {
    let mut filter = started(settings(from, 0));
    let count = (seconds / FRAME).round() as usize;
    let step = |frame| {
        filter.step(&long_space(), settings(targets[frame / frames % 2], 0), FRAME, TWO).level(0)
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
                ((1.0 - share) * old.level(knob) as f64 + share * new.level(knob) as f64).round()
                    as usize
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
                ((1.0 - share) * old.level(knob) as f64 + share * target.level(knob) as f64).round()
                    as usize
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
    // 0.2 s each; also one frame each, for a camera on a leaf's border.
    for frames in [12, 1] {
        for targets in [[2, 3], [3, 2]] {
            let levels = alternate(7, targets, frames, 60.0);
            // The first frame is t = 0.
            let arrived = 1 + (TWO.as_secs_f64() / FRAME).round() as usize;
            assert_eq!(levels[0], 7);
            assert!(levels.is_sorted_by(|a, b| a >= b), "it only falls: {levels:?}");
            assert!(levels[arrived..].iter().all(|level| [2, 3].contains(level)), "{levels:?}");
            assert!(changes(&levels) <= 5, "{levels:?}");
        }
    }
}

#[test]
fn a_target_that_flips_does_not_make_the_level_flip() {
    for (from, targets) in [(1, [0, 1]), (1, [1, 0]), (0, [0, 1]), (0, [1, 0])] {
        // 0.1 s each. The position converges to an oscillation about the target's mean,
        // 0.04 levels wide at most. It may cross one half once; a second crossing needs an
        // oscillation of half a level.
        let levels = alternate(from, targets, 6, 10.0);
        assert!(changes(&levels) <= 1, "{from}, {targets:?}: {levels:?}");
    }
    // Just under half of the duration each: the longest that must have no effect.
    let levels = alternate(1, [0, 1], 59, 60.0);
    assert!(changes(&levels) <= 1, "{levels:?}");
    // Over many levels the transition to the mean takes several changes without a reversal,
    // also when the target alternates every frame.
    for frames in [6, 1] {
        let levels = alternate(7, [0, 7], frames, 10.0);
        assert!(levels.is_sorted_by(|a, b| a >= b), "{levels:?}");
        assert!([3, 4].contains(&levels[levels.len() - 1]), "{levels:?}");
    }
}

#[test]
fn a_target_that_stays_long_enough_is_followed_each_time() {
    let levels = alternate(1, [0, 1], 121, 121.0 * 10.0 * FRAME);
    assert_eq!(changes(&levels), 10, "{levels:?}");
}

/// Lights of 4 levels, and rays of 3 that need them.
fn dependent_space() -> KnobSpace {
    let lights = Knob::new("lights", [0.0, 64.0, 256.0, 1024.0]);
    let rays = Knob::new("rays", [0.0, 2.0, 8.0]).needing("lights", 1);
    KnobSpace::new(vec![lights, rays]).expect("a valid space")
}

#[test]
fn a_knob_moves_while_what_it_needs_is_off() {
    let space = dependent_space();
    let (off, on) = (settings(0, 0), settings(3, 2));
    for (from, to) in [(off, on), (on, off)] {
        let mut filter = SettingsFilter::default();
        filter.resume_from(from);
        let mut seen = Vec::new();
        for _ in 0..130 {
            seen.push(filter.step(&space, to, FRAME, TWO));
        }
        assert_eq!(filter.applied(), to, "it arrives");
        let without_rays = seen.iter().find(|it| it.level(0) > 0 && it.level(1) < 2);
        assert_eq!(without_rays, None, "{from:?} to {to:?}");
        assert!(seen.iter().all(|it| [0, 3].contains(&it.level(0))), "{from:?} to {to:?}");
        // Half of two seconds, after the frame of the change.
        let before = seen.iter().filter(|it| it.level(0) == from.level(0)).count();
        assert!((60..=61).contains(&before), "{before}");
    }
}

#[test]
fn a_switch_that_is_taken_back_moves_nothing() {
    let space = dependent_space();
    for (from, to, back) in [
        (settings(0, 0), settings(3, 2), settings(0, 0)),
        (settings(3, 2), settings(0, 0), settings(3, 2)),
    ] {
        let mut filter = SettingsFilter::default();
        filter.resume_from(from);
        for round in 0..20 {
            for frame in 0..100 {
                let target = if frame < 55 { to } else { back };
                let got = filter.step(&space, target, FRAME, TWO);
                assert_eq!(got.level(0), from.level(0), "frame {frame} of round {round}");
                // Rays follow only where nobody sees them.
                assert!(got.level(0) == 0 || got.level(1) == 2, "frame {frame} of round {round}");
            }
        }
    }
    // The other way where it turns elsewhere: from there in single levels.
    let mut filter = SettingsFilter::default();
    filter.resume_from(settings(3, 2));
    for target in [settings(0, 0), settings(1, 2)] {
        let mut last = filter.applied();
        for _ in 0..50 {
            let next = filter.step(&space, target, FRAME, TWO);
            assert!(last.level(0) - next.level(0) <= 1 && next.level(1) == 2, "{next:?}");
            last = next;
        }
    }
    assert_eq!(filter.applied().level(0), 2, "1.8");
}

#[test]
fn knobs_that_need_each_other_arrive() {
    let a = Knob::new("a", [0.0, 1.0]).needing("b", 1);
    let b = Knob::new("b", [0.0, 1.0]).needing("a", 1);
    let space = KnobSpace::new(vec![a, b]).expect("a valid space");
    for to in [settings(0, 0), settings(1, 1)] {
        let mut filter = SettingsFilter::default();
        filter.resume_from(settings(1 - to.level(0), 1 - to.level(1)));
        for _ in 0..130 {
            filter.step(&space, to, FRAME, TWO);
        }
        assert_eq!(filter.applied(), to);
    }
}

#[test]
fn cuts_and_zero_length_transitions_act_at_once() {
    let [now, default, long] =
        [Duration::ZERO, Duration::from_secs(1), Duration::from_secs(1_000_000)];
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
    assert_eq!(filter.step(&space(), settings(1, 2), 0.0, now), settings(1, 2));
    assert_eq!(
        filter.step(&space(), settings(2, 2), 0.0, default),
        settings(1, 2),
        "nothing has passed"
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
}

#[test]
fn extreme_steps_are_safe() {
    let never = Duration::MAX;
    let mut filter = started(settings(0, 0));
    filter.step(&space(), settings(4, 2), 0.0, TWO);
    for delta in [f64::NAN, -5.0, f64::NEG_INFINITY, 0.0] {
        assert_eq!(filter.step(&space(), settings(4, 2), delta, TWO), settings(0, 0));
    }
    for delta in [f64::INFINITY, 1e300, 1.0] {
        assert_eq!(
            filter.step(&space(), settings(4, 2), delta, never),
            settings(0, 0),
            "it never moves"
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
    let least = Duration::from_nanos(1);
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

/// Seconds of a frame: any value, with many usual ones.
fn any_seconds() -> impl Strategy<Value = f64> {
    prop_oneof![prop::num::f64::ANY, 0.0..4.0]
}

fn any_time() -> impl Strategy<Value = Duration> {
    prop_oneof![
        any::<Duration>(),
        (0_u64..4000).prop_map(Duration::from_millis),
        Just(Duration::MAX)
    ]
}

fn usual_time() -> impl Strategy<Value = Duration> {
    (0.1..4.0).prop_map(Duration::from_secs_f64)
}

/// A filter after any sequence of steps.
fn mid_transition() -> impl Strategy<Value = SettingsFilter> {
    (usual_time(), prop::collection::vec((any::<u128>(), 0.0..0.5), 1..20)).prop_map(
        |(time, steps)| {
            let mut filter = SettingsFilter::default();
            for (bits, delta) in steps {
                filter.step(&long_space(), KnobLevels::from_bits(bits), delta, time);
            }
            filter
        },
    )
}

proptest! {
    #[test]
    fn every_step_returns_settings_of_the_space(
        steps in prop::collection::vec((any::<u128>(), any_seconds(), any_time(), any::<bool>()), 0..50),
    ) {
        let mut filter = SettingsFilter::default();
        for (bits, delta, time, cut) in steps {
            if cut && bits % 3 == 0 {
                filter.cut();
            } else if bits % 7 == 0 {
                filter.resume_from(KnobLevels::from_bits(!bits));
            }
            let space = if bits % 5 == 0 { long_space() } else { space() };
            let given = filter.step(&space, KnobLevels::from_bits(bits), delta, time);
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
        time in usual_time(),
        targets in prop::collection::vec((any::<u128>(), 0.0..0.2, 1_usize..9), 1..100),
        low in 0_usize..16,
        width in 0_usize..4,
    ) {
        let space = long_space();
        let high = (low + width).min(15);
        let longest = time.as_secs_f64();
        let target = |bits: u128| space.from_levels(|knob, _| low + bits as usize / (1 + 99 * knob) % (high - low + 1));
        // t = 0: this step belongs to the previous target.
        filter.step(&space, target(targets[0].0), 0.3, time);
        let mut elapsed = 0.0;
        let mut inside = [false; 2];
        for (bits, delta, frames) in targets {
            for _ in 0..frames {
                let given = filter.step(&space, target(bits), delta, time);
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
        time in usual_time(),
        bits in any::<u128>(),
        deltas in prop::collection::vec(0.0..0.2, 1..100),
    ) {
        let space = long_space();
        let target = space.from_levels(|knob, _| KnobLevels::from_bits(bits).level(knob));
        filter.step(&space, target, 0.0, time);
        for delta in deltas {
            let before = filter.clone();
            let given = filter.step(&space, target, delta, time);
            for knob in 0..2 {
                let (was, is, to) = (before.applied.level(knob), given.level(knob), target.level(knob));
                prop_assert!((was..=to).contains(&is) || (to..=was).contains(&is), "{was}, {is}, to {to}");
                let (was, is) = (before.transitions[knob].remaining(), filter.transitions[knob].remaining());
                prop_assert!(is.abs() <= was.abs(), "{was}, {is}");
            }
        }
    }
}
