//! Predicted power of the last seconds, for comparison with a meter that averages over an interval.

use std::collections::VecDeque;

/// Shortest part of the history, seconds: shorter frames share one.
const PART_SECONDS: f64 = 0.02;
/// Number of parts: five seconds at least.
const PARTS: usize = 256;
/// Lag of a meter beyond its interval, seconds, within which a change makes a reading uncertain.
const LAG_SECONDS: f64 = 0.25;

/// Largest plausible power, watts: beyond, a number is no power of a machine that runs this plugin.
pub(super) const MAX_WATTS: f64 = 1e5;

/// A ring of powers with their durations; allocates once.
#[derive(Clone, Debug)]
pub(super) struct PredictionHistory(VecDeque<(f64, f64)>);

impl Default for PredictionHistory {
    fn default() -> Self {
        Self(VecDeque::with_capacity(PARTS + 1))
    }
}

impl PredictionHistory {
    /// Adds `watts` over `seconds`, if the power is plausible, and the time finite and above 0; returns
    /// whether they are.
    pub(super) fn push(&mut self, watts: f64, seconds: f64) -> bool {
        let is_time = seconds > 0.0 && seconds.is_finite();
        if !((0.0..=MAX_WATTS).contains(&watts) && is_time) {
            return false;
        }
        match self.0.back_mut() {
            Some((mean, length)) if *length < PART_SECONDS => {
                *mean = (*mean * *length + watts * seconds) / (*length + seconds);
                *length += seconds;
            }
            _ => {
                if self.0.len() == PARTS {
                    self.0.pop_front();
                }
                self.0.push_back((watts, seconds));
            }
        }
        true
    }

    pub(super) fn clear(&mut self) {
        self.0.clear();
    }

    /// The latest power, watts.
    pub(super) fn last(&self) -> Option<f64> {
        self.0.back().map(|(watts, _)| *watts)
    }

    /// Mean over the last `seconds`, and the range of values then and shortly before, both in
    /// watts. `None` if a tenth of that time is unknown.
    pub(super) fn mean(&self, seconds: f64) -> Option<(f64, f64)> {
        let (mut sum, mut length, mut passed) = (0.0, 0.0, 0.0);
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for (watts, part) in self.0.iter().rev() {
            if passed >= seconds + LAG_SECONDS {
                break;
            }
            let inside = part.min(seconds - length).max(0.0);
            (sum, length) = (sum + watts * inside, length + inside);
            (low, high) = (low.min(*watts), high.max(*watts));
            passed += part;
        }
        // A meter of long intervals is compared with what there is. What it measured while nothing was
        // predicted belongs to something else.
        let enough = length >= 0.9 * seconds.min(PARTS as f64 * PART_SECONDS);
        (length > 0.0 && enough).then(|| (sum / length, high - low))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
}
