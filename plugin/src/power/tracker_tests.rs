//! Tests of the fault model alone; the fault matrix plays it with every meter.

use super::*;
use crate::power::ScriptedMeter;

const QUARTER: Duration = Duration::from_millis(250);

fn tracker() -> PowerTracker {
    measured(ScriptedMeter::joules([]).with_window_seconds(0.25))
}

/// As if the meter measured: a model is right about jumps.
fn measured(meter: ScriptedMeter) -> PowerTracker {
    let mut tracker = PowerTracker::new(&meter, QUARTER, Duration::from_secs(2));
    tracker.believes_jumps = false;
    tracker
}

fn joules(value: f64) -> Result<Reading, MeterError> {
    Ok(Reading::Energy(vec![Count { energy: Joules(value), range: None }]))
}

fn at(clock: Duration) -> Moment {
    Moment { clock, slept: Duration::ZERO }
}

/// A tracker with a window of 0.25 s after `readings`, 0.25 s apart, from 0 s on.
fn after(readings: impl IntoIterator<Item = f64>) -> PowerTracker {
    let mut tracker = tracker();
    for (index, value) in readings.into_iter().enumerate() {
        tracker.push(joules(value), at(QUARTER * index as u32));
    }
    tracker
}

fn latest(tracker: &PowerTracker) -> Option<f64> {
    tracker.snapshot().latest.map(|watts| watts.0)
}

fn lost_reason(tracker: &PowerTracker) -> &str {
    let MeterState::Lost { reason } = &tracker.snapshot().state else {
        panic!("{:?}", tracker.snapshot())
    };
    let figures = (tracker.snapshot().latest, tracker.snapshot().mean);
    assert_eq!(figures, (None, None), "a lost meter reports no power");
    reason
}

#[test]
fn a_first_value_is_of_unknown_age_and_gives_no_power() {
    for readings in [&[5.0][..], &[5.0, 7.0]] {
        let tracker = after(readings.iter().copied());
        assert_eq!((&tracker.snapshot().state, latest(&tracker)), (&MeterState::Starting, None));
    }
}

#[test]
fn power_is_rise_over_time() {
    let tracker = after([97.0, 100.0, 102.0, 104.0, 108.0]);
    let snapshot = tracker.snapshot();
    assert_eq!((latest(&tracker), snapshot.sample_count), (Some(16.0), 3));
    assert_eq!(snapshot.counted, (Joules(8.0), 3 * QUARTER), "without the first piece");
    assert_eq!(snapshot.at, Some(Duration::from_secs(1)), "the reading's own time");
    let mean = snapshot.mean.unwrap().0;
    assert!((8.0..10.0).contains(&mean), "8 W for an eighth of the time constant is 1 W: {mean}");
}

#[test]
fn a_jump_is_not_counted_and_a_load_is_after_three_pieces() {
    let steady = || (0..20).map(f64::from);
    let jumped = after(steady().chain([722.0, 723.0, 724.0]));
    assert_eq!((latest(&jumped), jumped.snapshot().dropped_count), (Some(4.0), 1));
    assert_eq!(jumped.snapshot().state, MeterState::Running);
    assert!(jumped.snapshot().note.as_deref().unwrap().contains("jumped by 703 J"));
    let mean = jumped.snapshot().mean.unwrap().0;
    assert!((mean - 4.0).abs() < 1e-9, "{mean}");
    // 90 W from 4 W on.
    let rising = |count| after(steady().chain((1..=count).map(|n| 19.0 + 22.5 * f64::from(n))));
    assert_eq!(latest(&rising(2)), Some(4.0));
    assert_eq!((latest(&rising(3)), rising(3).snapshot().dropped_count), (Some(90.0), 0));
    assert!(rising(2).is_settling() && !rising(3).is_settling());
}

#[test]
fn a_counter_that_keeps_falling_is_lost_and_comes_back_when_it_rises() {
    assert!(lost_reason(&after([9.0, 8.0, 7.0, 6.0])).contains("fell"));
    assert_eq!(latest(&after([9.0, 8.0, 7.0, 6.0, 7.0, 8.0])), Some(4.0));
}

#[test]
fn extreme_values_overflow_nothing() {
    let extremes = [1.0, 2.0, 3.0, 1e300, f64::MAX, 1e300, f64::MIN, f64::MAX, 0.0];
    let mut tracker = after(extremes);
    assert_eq!(latest(&tracker), None);
    for (index, watts) in
        [f64::NAN, f64::INFINITY, -1.0, 0.0, -0.0, 5_000.1, f64::MAX].into_iter().enumerate()
    {
        let reading = Reading::Power { power: Watts(watts), sign_of_life: None };
        tracker.push(Ok(reading), at(Duration::from_secs(3) + QUARTER * index as u32));
        assert!(lost_reason(&tracker).contains("it reads"));
    }
}

#[test]
fn invalid_values_and_errors_lose_the_meter_until_it_returns() {
    for invalid in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        assert!(lost_reason(&after([1.0, 2.0, 3.0, invalid])).contains("reads"));
        let back = after([1.0, 2.0, 3.0, invalid, 3.0, 4.0, 5.0]);
        assert_eq!(latest(&back), Some(4.0));
    }
    let mut tracker = after([1.0, 2.0, 3.0]);
    tracker.push(Err(MeterError::unreadable("scripted", "denied")), at(3 * QUARTER));
    assert!(lost_reason(&tracker).contains("denied"));
}

#[test]
fn an_interval_of_zero_length_waits() {
    let mut tracker = after([1.0, 2.0, 3.0]);
    let before = tracker.snapshot().clone();
    tracker.push(joules(9.0), at(2 * QUARTER));
    tracker.push(joules(9.0), at(2 * QUARTER + Duration::from_millis(1)));
    assert_eq!(*tracker.snapshot(), before);
}

#[test]
fn a_sleep_gives_no_reading_on_either_clock() {
    for (clock, slept) in [(0.0, 600.0), (600.0, 0.0)] {
        let mut tracker = after([1.0, 2.0, 3.0, 4.0]);
        let resumed = Duration::from_secs_f64(1.0 + clock);
        let slept = Duration::from_secs_f64(slept);
        tracker.push(joules(425.0), Moment { clock: resumed, slept });
        assert_eq!(tracker.snapshot().state, MeterState::Starting);
        assert_eq!((latest(&tracker), tracker.snapshot().mean), (None, None));
        for n in 1..=2_u32 {
            let moment = Moment { clock: resumed + QUARTER * n, slept };
            tracker.push(joules(425.0 + f64::from(n)), moment);
        }
        assert_eq!((latest(&tracker), tracker.snapshot().dropped_count), (Some(4.0), 0));
    }
}

#[test]
fn a_staircase_is_never_zero_watts() {
    // 4 J once a second, polled four times a second.
    let mut tracker = tracker();
    for index in 0..40_u32 {
        tracker.push(joules(f64::from(index / 4) * 4.0), at(QUARTER * index));
        assert!(latest(&tracker).is_none_or(|watts| watts == 4.0));
    }
    assert_eq!(tracker.snapshot().sample_count, 8);
}

#[test]
fn a_stuck_counter_is_lost_and_its_return_is_not_a_spike() {
    let stuck = [1.0, 2.0, 3.0].into_iter().chain([3.0; 60]);
    assert_eq!(
        lost_reason(&after(stuck.clone())),
        "scripted: broken: the counter did not move in 10 s"
    );
    // It returns with a jump that includes all missed energy, and continues at 4 W.
    let back = after(stuck.chain([50.0, 51.0, 52.0]));
    assert_eq!(latest(&back), Some(4.0));
    assert_eq!(latest(&after([0.0; 60])), None, "a counter that stays at 0 never reports 0 W");
}

#[test]
fn a_wrap_counts_near_the_power_before_and_a_reset_does_not() {
    let at_forty_watts = |range: Option<f64>, last: f64| {
        let mut tracker = tracker();
        for (index, value) in [60.0, 70.0, 80.0, 90.0, last].into_iter().enumerate() {
            let count = Count { energy: Joules(value), range: range.map(Joules) };
            tracker.push(Ok(Reading::Energy(vec![count])), at(QUARTER * index as u32));
        }
        let snapshot = tracker.snapshot();
        (snapshot.counted.0.0, snapshot.dropped_count)
    };
    assert_eq!(at_forty_watts(Some(100.0), 2.0), (32.0, 0));
    assert_eq!(at_forty_watts(Some(100.0), 70.0), (20.0, 1), "320 W after 40 W");
    for range in [None, Some(80.0)] {
        assert_eq!(at_forty_watts(range, 2.0), (20.0, 1), "{range:?}");
    }
}

#[test]
fn a_power_is_integrated_by_trapezoids_and_never_over_a_gap() {
    let mut tracker = tracker();
    let mut counted = |watts: f64, seconds: f64| {
        let reading = Reading::Power { power: Watts(watts), sign_of_life: None };
        tracker.push(Ok(reading), at(Duration::from_secs_f64(seconds)));
        tracker.snapshot().counted.0.0
    };
    assert_eq!([counted(10.0, 0.0), counted(10.0, 1.0)], [0.0, 0.0]);
    assert_eq!(counted(20.0, 3.0), 30.0);
    assert_eq!(counted(20.0, 3.0), 30.0, "no time passed");
    assert_eq!([counted(20.0, 13.0), counted(20.0, 14.0)], [30.0, 30.0], "after a gap");
    assert_eq!(counted(20.0, 15.0), 50.0);
    assert_eq!([counted(20.0, 2.0), counted(20.0, 3.0)], [50.0, 50.0], "time went backwards");
    assert_eq!(counted(21.0, 4.0), 70.5);
}
