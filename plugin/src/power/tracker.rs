//! Power over time from a counter's readings, with handling of readings that fall, stand still,
//! jump or fail. Has no threads and no clock, so that tests can inject every fault.

use std::time::Duration;

use bevy::reflect::Reflect;

use crate::power::window::{did_not_move, fell, not_a_number};
use crate::power::{MeterError, MeterInfo};
use crate::units::{Joules, Watts};

/// Largest plausible power of a machine that runs this plugin; a higher value means that the
/// counter jumped.
const MAXIMUM_PLAUSIBLE: Watts = Watts(100_000.0);

/// Number of consecutive dropped intervals after which the meter is lost.
const DROPS_IN_SUCCESSION: u32 = 3;

/// Time without an increase after which a counter counts as stuck; the longer of this and
/// `STUCK_AFTER_WINDOWS` of its windows applies. Counters that update only once a second, or more
/// slowly than specified, are common; a device without power draw for seconds is not.
const STUCK_AFTER: Duration = Duration::from_secs(5);
const STUCK_AFTER_WINDOWS: u32 = 10;

/// Whether the metered power is known.
#[derive(Clone, Debug, Default, PartialEq, Eq, Reflect)]
#[non_exhaustive]
pub enum MeterState {
    /// The meter is being opened, or the first interval has not ended.
    #[default]
    Starting,
    /// Valid readings arrive.
    Running,
    /// Readings stopped arriving, or became invalid. Polling continues; the state returns to
    /// `Running` with valid readings.
    Lost {
        /// The meter's error or fault.
        reason: String,
    },
    /// There is no meter, and polling has ended.
    Unavailable {
        /// Why there is no meter.
        reason: String,
    },
}

/// Figures of a sampler at one moment.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct PowerSnapshot {
    /// The meter, once it is open.
    pub info: Option<MeterInfo>,
    /// Whether the power is known.
    pub state: MeterState,
    /// Mean power over the last interval, in watts, with the meter's idle power; finite, at least
    /// 0. `None` unless the state is `Running`.
    pub latest: Option<Watts>,
    /// Exponential mean of `latest`, in watts; finite, at least 0. `None` unless the state is
    /// `Running`.
    pub mean: Option<Watts>,
    /// Length of the interval of `latest`. `None` unless the state is `Running`.
    pub interval: Option<Duration>,
    /// Time of the reading that ends the interval, on the caller's clock. `None` unless the state
    /// is `Running`.
    pub at: Option<Duration>,
    /// Number of valid intervals.
    pub sample_count: u64,
    /// Number of intervals dropped because the counter fell or jumped, or time went backwards.
    pub dropped_count: u64,
    /// Why the last dropped interval was dropped.
    pub note: Option<String>,
}

impl PowerSnapshot {
    /// Sets the state and clears the power figures.
    pub(crate) fn lose(&mut self, state: MeterState) {
        self.state = state;
        self.latest = None;
        self.mean = None;
        self.interval = None;
        self.at = None;
    }
}

/// A counter's value and its time since a fixed moment.
#[derive(Clone, Copy, Debug)]
struct Base {
    energy: Joules,
    at: Duration,
}

/// Computes power from a counter's readings.
#[derive(Debug)]
pub(crate) struct PowerTracker {
    name: String,
    idle: Watts,
    window: Duration,
    smoothing: Duration,
    base: Option<Base>,
    drops_in_succession: u32,
    stuck: bool,
    snapshot: PowerSnapshot,
}

impl PowerTracker {
    /// `window`: shortest valid interval; `smoothing`: time constant of the mean.
    pub(crate) fn new(info: MeterInfo, idle: Watts, window: Duration, smoothing: Duration) -> Self {
        Self {
            name: info.name.clone(),
            idle,
            window,
            smoothing,
            base: None,
            drops_in_succession: 0,
            stuck: false,
            snapshot: PowerSnapshot { info: Some(info), ..PowerSnapshot::default() },
        }
    }

    /// The current figures.
    pub(crate) fn snapshot(&self) -> &PowerSnapshot {
        &self.snapshot
    }

    /// Adds the meter's answer at time `at`.
    pub(crate) fn push(&mut self, answer: Result<Joules, MeterError>, at: Duration) {
        let energy = match answer {
            Ok(energy) if energy.0.is_finite() => energy,
            Ok(energy) => {
                return self.lose(MeterError::broken(self.name.as_str(), not_a_number(energy)));
            }
            Err(error) => return self.lose(error),
        };
        let now = Base { energy, at };
        let Some(base) = self.base else {
            self.base = Some(now);
            return;
        };
        if at < base.at {
            return self.drop_interval(now, "time went backwards".to_owned());
        }
        if energy < base.energy {
            // A wrap, a driver reload, or a fault cannot be distinguished here, so the interval is
            // dropped.
            return self.drop_interval(now, fell(base.energy, energy));
        }
        let elapsed = at - base.at;
        // Timers are slightly late or early: an interval up to a tenth shorter than the window
        // still counts.
        if elapsed.is_zero() || elapsed < self.window.mul_f64(0.9) {
            return;
        }
        if self.stuck {
            // The first increase after a standstill may include the energy of all of it.
            self.stuck = energy == base.energy;
            self.base = Some(now);
            return;
        }
        if energy == base.energy {
            // An unchanged counter is not 0 W: the interval grows until the counter updates or
            // counts as stuck.
            if elapsed >= STUCK_AFTER.max(self.window.saturating_mul(STUCK_AFTER_WINDOWS)) {
                self.lose(MeterError::broken(self.name.as_str(), did_not_move(elapsed)));
                self.stuck = true;
                self.base = Some(now);
            }
            return;
        }
        let power = self.idle + (energy - base.energy).per_seconds(elapsed.as_secs_f64());
        // Also rejects a difference that overflowed, and a NaN idle power.
        if !(0.0..=MAXIMUM_PLAUSIBLE.0).contains(&power.0) {
            return self.drop_interval(
                now,
                format!("the counter jumped from {} J to {} J", base.energy.0, energy.0),
            );
        }
        self.base = Some(now);
        self.drops_in_succession = 0;
        self.publish(power, elapsed, at);
    }

    fn publish(&mut self, power: Watts, elapsed: Duration, at: Duration) {
        let snapshot = &mut self.snapshot;
        snapshot.mean = Some(match snapshot.mean {
            // An interval's weight depends on its length relative to the time constant, so that the
            // mean is independent of the polling rate.
            Some(mean) if !self.smoothing.is_zero() => {
                let weight = -(-elapsed.as_secs_f64() / self.smoothing.as_secs_f64()).exp_m1();
                mean + (power - mean) * weight
            }
            _ => power,
        });
        snapshot.latest = Some(power);
        snapshot.interval = Some(elapsed);
        snapshot.at = Some(at);
        snapshot.state = MeterState::Running;
        snapshot.sample_count += 1;
    }

    /// Drops the interval that ends now, and starts the next one here.
    fn drop_interval(&mut self, now: Base, note: String) {
        self.snapshot.dropped_count += 1;
        self.drops_in_succession += 1;
        if self.drops_in_succession >= DROPS_IN_SUCCESSION {
            // The figures are out of date, and the counter is unusable.
            let reason =
                format!("{DROPS_IN_SUCCESSION} intervals in succession were invalid: {note}");
            self.lose(MeterError::broken(self.name.as_str(), reason));
        }
        self.snapshot.note = Some(note);
        self.base = Some(now);
    }

    fn lose(&mut self, error: MeterError) {
        self.snapshot.lose(MeterState::Lost { reason: error.to_string() });
        self.base = None;
        self.stuck = false;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::power::{PowerMeter, ScriptedMeter};

    /// A tracker with a window of 0.25 s after `readings`, 0.25 s apart, from 0 s on.
    fn after(readings: impl IntoIterator<Item = f64>) -> PowerTracker {
        let meter = ScriptedMeter::joules([]);
        let mut tracker = PowerTracker::new(
            meter.info(),
            Watts(0.0),
            Duration::from_millis(250),
            Duration::from_secs(2),
        );
        for (index, joules) in readings.into_iter().enumerate() {
            tracker.push(Ok(Joules(joules)), Duration::from_millis(250) * index as u32);
        }
        tracker
    }

    fn lost_reason(tracker: &PowerTracker) -> &str {
        let MeterState::Lost { reason } = &tracker.snapshot().state else {
            panic!("{:?}", tracker.snapshot())
        };
        assert_eq!(
            (tracker.snapshot().latest, tracker.snapshot().mean),
            (None, None),
            "a lost meter reports no power"
        );
        reason
    }

    #[test]
    fn one_reading_gives_no_power() {
        assert_eq!(after([5.0]).snapshot().state, MeterState::Starting);
        assert_eq!(after([5.0]).snapshot().latest, None);
    }

    #[test]
    fn power_is_rise_over_time() {
        let tracker = after([100.0, 102.0, 104.0, 108.0]);
        let snapshot = tracker.snapshot();
        assert_eq!((snapshot.latest, snapshot.sample_count), (Some(Watts(16.0)), 3));
        assert_eq!(snapshot.at, Some(Duration::from_millis(750)), "the reading's own time");
        let mean = snapshot.mean.unwrap().0;
        assert!(
            mean > 8.0 && mean < 10.0,
            "a step of 8 W for an eighth of the time constant is about 1 W: {mean}"
        );
    }

    #[test]
    fn idle_power_is_added() {
        let mut tracker = PowerTracker::new(
            ScriptedMeter::joules([]).info(),
            Watts(3.0),
            Duration::ZERO,
            Duration::ZERO,
        );
        tracker.push(Ok(Joules(0.0)), Duration::ZERO);
        tracker.push(Ok(Joules(2.0)), Duration::from_secs(1));
        assert_eq!(tracker.snapshot().latest, Some(Watts(5.0)));
    }

    #[test]
    fn a_wrap_drops_one_interval() {
        let tracker = after([100.0, 101.0, 0.5, 1.5]);
        let snapshot = tracker.snapshot();
        assert_eq!(
            (snapshot.latest, snapshot.sample_count, snapshot.dropped_count),
            (Some(Watts(4.0)), 2, 1)
        );
        assert!(snapshot.note.as_deref().unwrap().contains("fell from 101 J to 0.5 J"));
    }

    #[test]
    fn a_counter_that_keeps_falling_is_lost() {
        assert!(lost_reason(&after([9.0, 8.0, 7.0, 6.0])).contains("fell"));
        assert_eq!(
            after([9.0, 8.0, 7.0, 6.0, 7.0]).snapshot().latest,
            Some(Watts(4.0)),
            "and comes back when it rises"
        );
    }

    #[test]
    fn a_jump_is_dropped() {
        let tracker = after([1.0, 2.0, 1e300, f64::MAX, 1e300]);
        assert!(lost_reason(&tracker).contains("in succession"));
        assert_eq!(after([1.0, 2.0, 1e12, 1e12 + 1.0]).snapshot().latest, Some(Watts(4.0)));
        assert_eq!(after([f64::MIN, f64::MAX]).snapshot().latest, None, "the difference overflows");
    }

    #[test]
    fn invalid_values_and_errors_lose_the_meter_until_it_returns() {
        for invalid in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert!(lost_reason(&after([1.0, 2.0, invalid])).contains("reads"));
            assert_eq!(after([1.0, 2.0, invalid, 3.0, 4.0]).snapshot().latest, Some(Watts(4.0)));
        }
        let mut tracker = after([1.0, 2.0]);
        tracker.push(
            Err(MeterError::unreadable("scripted", "permission denied")),
            Duration::from_secs(1),
        );
        assert!(lost_reason(&tracker).contains("permission denied"));
    }

    #[test]
    fn an_interval_of_zero_length_waits() {
        let mut tracker = after([1.0, 2.0]);
        let before = tracker.snapshot().clone();
        tracker.push(Ok(Joules(9.0)), Duration::from_millis(250));
        tracker.push(Ok(Joules(9.0)), Duration::from_millis(251));
        assert_eq!(*tracker.snapshot(), before);
    }

    #[test]
    fn time_that_goes_backwards_drops_one_interval() {
        let mut tracker = after([1.0, 2.0]);
        tracker.push(Ok(Joules(3.0)), Duration::ZERO);
        assert_eq!(
            (tracker.snapshot().latest, tracker.snapshot().dropped_count),
            (Some(Watts(4.0)), 1)
        );
    }

    #[test]
    fn a_staircase_is_never_zero_watts() {
        // 4 J once a second, polled four times a second.
        let mut tracker = after([]);
        for index in 0..40_u32 {
            tracker
                .push(Ok(Joules(f64::from(index / 4) * 4.0)), Duration::from_millis(250) * index);
            if let Some(latest) = tracker.snapshot().latest {
                assert_eq!(latest, Watts(4.0));
            }
        }
        assert_eq!(tracker.snapshot().sample_count, 9);
    }

    #[test]
    fn a_stuck_counter_is_lost_and_its_return_is_not_a_spike() {
        let stuck = [1.0, 2.0].into_iter().chain([2.0; 40]);
        assert!(lost_reason(&after(stuck.clone())).contains("did not move"));
        // It returns with a jump that includes all missed energy, and continues at 4 W.
        let back = after(stuck.chain([50.0, 51.0]));
        assert_eq!(back.snapshot().latest, Some(Watts(4.0)));
        assert_eq!(
            after([0.0; 40]).snapshot().latest,
            None,
            "a counter that stays at 0 from the start never reports 0 W"
        );
    }
}
