//! Tests of the search for a delay, and of the history of predictions.

use super::*;

/// Predictions that change every few seconds, metered `gain` times as high, `late` seconds later.
fn after(seconds: usize, late: usize, gain: f64, noise: f64) -> DelayFinder {
    let watts = |second: usize| 4.0 + 2.0 * (78.233 * (second / 4) as f64).sin();
    let mut finder = DelayFinder::default();
    for second in 0..seconds {
        (0..60).for_each(|_| finder.predict(watts(second), 1.0 / 60.0));
        if let Some(then) = second.checked_sub(late) {
            let wave = 1.0 + noise * f64::from(second as u16).sin();
            finder.read(gain * watts(then) * wave + 0.5, 1.0);
        }
    }
    finder
}

#[test]
fn the_delay_is_found_within_half_a_minute_of_readings() {
    for late in [0, 3, 12, 30, 40] {
        assert_eq!(after(late + 30, late, 1.4, 0.03).delay(), late);
    }
}

#[test]
fn the_delay_of_a_slow_meter_is_found_too() {
    let watts = |second: usize| 4.0 + 2.0 * (78.233 * (second / 7) as f64).sin();
    let mut finder = DelayFinder::default();
    for second in 0..200 {
        finder.predict(watts(second), 1.0);
        if second % 5 == 4 && second >= 29 {
            let then = (second - 24..second - 19).map(watts).sum::<f64>() / 5.0;
            finder.read(1.4 * then, 5.0);
        }
    }
    assert_eq!(finder.delay(), 20);
    let gain = finder.energies().expect("a delay").gain();
    assert!((gain - 1.4).abs() < 1e-6, "{gain}");
}

#[test]
fn readings_that_follow_nothing_are_not_late() {
    let mut finder = DelayFinder::default();
    for second in 0..600_u16 {
        finder.predict(if second % 50 < 25 { 2.0 } else { 5.0 }, 1.0);
        // Noise alone, and a device whose power does not change.
        finder.read(4.0 + (f64::from(second) * 12.9898).sin().fract(), 1.0);
        assert_eq!(finder.delay(), 0, "second {second}");
    }
    let mut finder = DelayFinder::default();
    (0..600).for_each(|_| {
        finder.predict(3.0, 1.0);
        finder.read(4.2, 1.0);
    });
    assert_eq!(finder.delay(), 0);
    assert!(finder.energies().is_none());
}

#[test]
fn pauses_and_odd_frames_do_no_harm() {
    let mut finder = after(100, 30, 1.4, 0.0);
    finder.pause();
    assert_eq!(finder.of_reading(1.0), None);
    for seconds in [1e-9, 1e-3, 0.3, 7.0, 1e6] {
        finder.predict(1e5, seconds);
        finder.read(1e5, seconds);
    }
    assert!(finder.predicted.means.len() <= KEPT && finder.metered.means.len() <= KEPT);
    assert!(finder.predicted.means.iter().all(|watts| watts.is_finite()));
}

#[test]
fn the_mean_is_that_of_the_interval() {
    let mut history = PredictionHistory::default();
    assert_eq!(history.mean(0.25), None);
    (0..100).for_each(|_| assert!(history.push(1.0, 0.01)));
    (0..50).for_each(|_| assert!(history.push(3.0, 0.01)));
    let (mean, spread) = history.mean(1.0).expect("a mean");
    assert!((mean - 2.0).abs() < 1e-9 && (spread - 2.0).abs() < 1e-9, "{mean} {spread}");
    let (mean, spread) = history.mean(0.2).expect("a mean");
    assert!((mean - 3.0).abs() < 1e-9 && spread < 1e-9, "{mean} {spread}");
    assert_eq!(history.last(), Some(3.0));
    assert_eq!(history.mean(10.0), None, "too little of it");
}

#[test]
fn it_never_grows_and_ignores_what_is_no_power() {
    let mut history = PredictionHistory::default();
    for odd in [f64::NAN, f64::INFINITY, -1.0, 1e300] {
        assert!(!history.push(odd, 0.1));
    }
    for odd in [f64::NAN, f64::INFINITY, -1.0] {
        assert!(!history.push(1.0, odd));
    }
    assert!(!history.push(1.0, 0.0));
    assert_eq!(history.last(), None);
    let capacity = history.0.capacity();
    (0..10_000).for_each(|_| assert!(history.push(1.0, 0.03)));
    assert_eq!((history.0.len(), history.0.capacity()), (PARTS, capacity));
    for seconds in [f64::NAN, f64::INFINITY, 0.0, -1.0] {
        let _ = history.mean(seconds);
    }
}
