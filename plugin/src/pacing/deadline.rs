//! When the next frame may begin.

use std::time::Duration;

use bevy::platform::time::Instant;

/// Longest wait, seconds: a limit below one frame in this time counts as it.
const LONGEST_SECONDS: f64 = 1.0;

/// End of the current frame's time.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Deadline(Option<Instant>);

impl Deadline {
    /// Time to wait at `now` before the next frame, with at most `limit` frames per second; `None`
    /// if it may begin.
    ///
    /// Deadlines follow each other at equal distances, so that what a sleep takes too long is made
    /// up for by the next; a frame that is late by more than one period begins a new row.
    pub(super) fn next(&mut self, limit: Option<f64>, now: Instant) -> Option<Duration> {
        let limit = limit.filter(|limit| *limit > 0.0 && limit.is_finite());
        let Some(limit) = limit else {
            self.0 = None;
            return None;
        };
        let period = Duration::from_secs_f64(limit.recip().min(LONGEST_SECONDS));
        let due = self.0.map_or(now + period, |last| last + period);
        let is_late = due + period < now;
        // A lower limit before may have left a deadline far ahead.
        let due = if is_late { now } else { due.min(now + period) };
        self.0 = Some(due);
        due.checked_duration_since(now).filter(|wait| !wait.is_zero())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn millis(count: u64) -> Duration {
        Duration::from_millis(count)
    }

    #[test]
    fn frames_are_even_and_late_ones_do_not_add_up() {
        let (mut deadline, start) = (Deadline::default(), Instant::now());
        let mut wait = |at: u64| deadline.next(Some(100.0), start + millis(at));
        assert_eq!(wait(0), Some(millis(10)));
        assert_eq!(wait(14), Some(millis(6)), "4 ms of work");
        assert_eq!(wait(26), Some(millis(4)), "waking up took 2 ms too long");
        assert_eq!(wait(95), None, "late by several frames");
        assert_eq!(wait(96), Some(millis(9)), "which are not made up for");
    }

    #[test]
    fn odd_limits_are_none_or_bounded() {
        let (mut deadline, now) = (Deadline::default(), Instant::now());
        for odd in [None, Some(f64::NAN), Some(0.0), Some(-1.0), Some(f64::INFINITY)] {
            assert_eq!(deadline.next(odd, now), None, "{odd:?}");
        }
        for slow in [1e-300, f64::MIN_POSITIVE, 0.1] {
            let wait = Deadline::default().next(Some(slow), now);
            assert_eq!(wait, Some(millis(1000)), "{slow}");
        }
        // A limit that is lifted leaves no wait behind, nor does one that rises.
        assert!(deadline.next(Some(1.0), now).is_some());
        assert_eq!(deadline.next(Some(100.0), now), Some(millis(10)));
        assert_eq!(deadline.next(Some(1e300), now), None);
    }
}
