//! Energy over time from what files say: a counter of microjoules that wraps, or a power.
//!
//! Neither has a clock. Every fault is an error and starts anew behind it: the energy of a time that
//! is not known is never counted, and never spread over the time after it.

use std::time::Duration;

use crate::power::MeterError;
use crate::units::{Joules, Watts};

/// Largest plausible power of one machine that renders, watts; more is a fault of the reading.
const MAX_WATTS: f64 = 5_000.0;
/// Time without an increase after which a counter counts as stuck.
const STUCK_AFTER: Duration = Duration::from_secs(10);
/// Longest time between two readings of a power: the power between them is not known.
const MAX_GAP: Duration = Duration::from_secs(10);
/// Largest ratio of the powers after and before a wrap. A reset, too, lets a counter fall; what it
/// then seems to have counted is rarely near the power before.
const MAX_WRAP_RATIO: f64 = 2.0;

/// A reading's fault, in words.
type Fault = String;

/// A counter of microjoules.
#[derive(Clone, Debug, Default)]
pub(super) struct Counter {
    /// Microjoules at which it starts again from 0; `None`: never.
    range: Option<i64>,
    /// The value since its last change, and the time of that.
    last: Option<(i64, Duration)>,
    /// Whether that change was seen. Of a first value it is not known how old it is, so that the
    /// power up to the next one is not known either.
    is_aligned: bool,
    is_stuck: bool,
    /// Power up to the last change, watts.
    watts: Option<f64>,
    joules: f64,
}

impl Counter {
    /// A counter that starts again after `range` microjoules; a range that is not above 0 is none.
    pub(super) fn new(range: Option<i64>) -> Self {
        Self { range: range.filter(|range| *range > 0), ..Self::default() }
    }

    /// Adds the reading of a meter's file. The energy so far; `None` until a change was seen.
    pub(super) fn add(
        &mut self,
        meter: &str,
        reading: Result<i64, MeterError>,
        at: Duration,
    ) -> Result<Option<Joules>, MeterError> {
        let value = reading.inspect_err(|_| self.restart())?;
        self.push(value, at).map_err(|fault| MeterError::broken(meter, fault))
    }

    /// Forgets the last value, but no energy.
    fn restart(&mut self) {
        (self.last, self.is_aligned, self.is_stuck, self.watts) = (None, false, false, None);
    }

    /// Adds a reading. The energy so far, in joules; `None` until a change was seen.
    fn push(&mut self, value: i64, at: Duration) -> Result<Option<Joules>, Fault> {
        if value < 0 {
            self.restart();
            return Err(format!("the counter reads {value} µJ"));
        }
        let Some((before, since)) = self.last else {
            self.last = Some((value, at));
            return Ok(None);
        };
        let Some(elapsed) = at.checked_sub(since) else {
            self.restart();
            return Err("time went backwards".to_owned());
        };
        if value == before {
            if elapsed >= STUCK_AFTER {
                self.is_stuck = true;
                return Err(format!("the counter did not move in {:.0} s", elapsed.as_secs_f64()));
            }
            return Ok(self.energy());
        }
        if elapsed.is_zero() {
            return Ok(self.energy());
        }
        if self.is_stuck || !self.is_aligned {
            self.restart();
            (self.last, self.is_aligned) = (Some((value, at)), true);
            return Ok(self.energy());
        }
        self.count(before, value, elapsed).inspect_err(|_| self.restart())?;
        self.last = Some((value, at));
        Ok(self.energy())
    }

    fn energy(&self) -> Option<Joules> {
        self.is_aligned.then_some(Joules(self.joules))
    }

    fn count(&mut self, before: i64, value: i64, elapsed: Duration) -> Result<(), Fault> {
        let fell = || format!("the counter fell from {before} µJ to {value} µJ");
        let has_wrapped = value < before;
        let rise = match self.range {
            _ if !has_wrapped => value - before,
            Some(range) if before <= range => range - before + value,
            _ => return Err(fell()),
        };
        let joules = rise as f64 * 1e-6;
        let watts = joules / elapsed.as_secs_f64();
        if has_wrapped {
            let is_plausible = self.watts.is_some_and(|before| {
                watts <= before * MAX_WRAP_RATIO && watts * MAX_WRAP_RATIO >= before
            });
            if !is_plausible {
                return Err(fell());
            }
        }
        if watts > MAX_WATTS {
            return Err(format!("the counter jumped from {before} µJ to {value} µJ"));
        }
        self.joules += joules;
        self.watts = Some(watts);
        Ok(())
    }
}

/// A power, integrated over time by the trapezoidal rule.
#[derive(Clone, Debug)]
pub(super) struct Gauge {
    /// Time without a change after which a power counts as stale.
    stale_after: Duration,
    last: Option<(Watts, Duration)>,
    /// The last value, and since when it has been the same.
    same: Option<(Watts, Duration)>,
    joules: f64,
}

impl Gauge {
    /// A power that changes at least once in `stale_after`.
    pub(super) fn new(stale_after: Duration) -> Self {
        Self { stale_after, last: None, same: None, joules: 0.0 }
    }

    /// Adds the reading of a meter's files. The energy so far.
    pub(super) fn add(
        &mut self,
        meter: &str,
        reading: Result<Watts, MeterError>,
        at: Duration,
    ) -> Result<Option<Joules>, MeterError> {
        let power = reading.inspect_err(|_| self.restart())?;
        self.push(power, at).map(Some).map_err(|fault| MeterError::broken(meter, fault))
    }

    /// Forgets the last power, but no energy: for a reading that failed.
    fn restart(&mut self) {
        self.last = None;
    }

    /// Adds a reading. The energy so far, in joules.
    fn push(&mut self, power: Watts, at: Duration) -> Result<Joules, Fault> {
        let last = self.last.take();
        if power.0 == 0.0 {
            return Err("it reads 0 W, which no machine draws that renders".to_owned());
        }
        // Also rejects NaN.
        if !(power.0 > 0.0 && power.0 <= MAX_WATTS) {
            return Err(format!("it reads {} W", power.0));
        }
        match self.same {
            Some((same, since)) if same == power && at >= since => {
                let elapsed = at - since;
                if elapsed >= self.stale_after {
                    return Err(format!("it has read {power} for {:.0} s", elapsed.as_secs_f64()));
                }
            }
            _ => self.same = Some((power, at)),
        }
        self.last = Some((power, at));
        if let Some((before, since)) = last {
            let Some(elapsed) = at.checked_sub(since) else {
                return Err("time went backwards".to_owned());
            };
            if elapsed > MAX_GAP {
                return Err(format!("it was not read for {:.0} s", elapsed.as_secs_f64()));
            }
            self.joules += (before.0 + power.0) * 0.5 * elapsed.as_secs_f64();
        }
        Ok(Joules(self.joules))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seconds(seconds: f64) -> Duration {
        Duration::from_secs_f64(seconds)
    }

    #[test]
    fn a_counter_waits_for_a_change_whose_time_is_known() {
        let mut counter = Counter::new(None);
        // Steps of 4 J a second; the first reading is late in a step.
        assert_eq!(counter.push(4_000_000, seconds(0.9)), Ok(None));
        assert_eq!(counter.push(8_000_000, seconds(1.0)), Ok(Some(Joules(0.0))));
        assert_eq!(counter.push(8_000_000, seconds(1.5)), Ok(Some(Joules(0.0))));
        assert_eq!(counter.push(12_000_000, seconds(2.0)), Ok(Some(Joules(4.0))));
    }

    #[test]
    fn a_counter_wraps_at_its_range_and_a_reset_is_no_wrap() {
        let at_ten_watts = || {
            let mut counter = Counter::new(Some(100_000_000));
            for (step, joules) in (0_u32..).zip([70, 80, 90]) {
                counter.push(joules * 1_000_000, Duration::from_secs(step.into())).expect("rises");
            }
            counter
        };
        assert_eq!(at_ten_watts().push(2_000_000, seconds(3.0)), Ok(Some(Joules(22.0))));
        assert!(at_ten_watts().push(70_000_000, seconds(3.0)).is_err(), "80 W after 10 W");
        assert!(at_ten_watts().push(0, seconds(20.0)).is_err(), "0.6 W after 10 W");
        for range in [None, Some(0), Some(-1), Some(80_000_000)] {
            let mut counter = at_ten_watts();
            counter.range = range.filter(|range| *range > 0);
            assert!(counter.push(2_000_000, seconds(3.0)).is_err(), "{range:?}");
        }
    }

    #[test]
    fn extreme_values_overflow_nothing() {
        let mut counter = Counter::new(Some(i64::MAX));
        let mut time = 0.0;
        for value in [0, 1, i64::MAX, i64::MIN, i64::MAX, 0, i64::MAX, 5, i64::MAX - 1, 3, 4, 5] {
            time += 0.25;
            let energy = counter.push(value, seconds(time));
            assert!(energy.is_err() || energy.unwrap().is_none_or(|e| e.0 < 1.0));
        }
        let mut gauge = Gauge::new(seconds(60.0));
        for watts in [f64::NAN, f64::INFINITY, -1.0, 0.0, -0.0, 5_000.1, f64::MAX] {
            time += 0.25;
            assert!(gauge.push(Watts(watts), seconds(time)).is_err(), "{watts}");
        }
    }

    #[test]
    fn a_power_is_integrated_by_trapezoids_and_never_over_a_gap() {
        let mut gauge = Gauge::new(seconds(60.0));
        assert_eq!(gauge.push(Watts(10.0), seconds(0.0)), Ok(Joules(0.0)));
        assert_eq!(gauge.push(Watts(20.0), seconds(2.0)), Ok(Joules(30.0)));
        gauge.restart();
        assert_eq!(gauge.push(Watts(20.0), seconds(9.0)), Ok(Joules(30.0)));
        assert_eq!(gauge.push(Watts(20.0), seconds(9.0)), Ok(Joules(30.0)), "no time passed");
        assert!(gauge.push(Watts(20.0), seconds(30.0)).unwrap_err().contains("not read"));
        assert_eq!(gauge.push(Watts(20.0), seconds(31.0)), Ok(Joules(50.0)));
        assert!(gauge.push(Watts(21.0), seconds(3.0)).unwrap_err().contains("backwards"));
        assert_eq!(gauge.push(Watts(21.0), seconds(4.0)), Ok(Joules(71.0)));
    }

    #[test]
    fn a_power_that_stays_the_same_is_stale_until_it_changes() {
        let mut gauge = Gauge::new(seconds(60.0));
        let ends =
            (0..1000).find(|step| gauge.push(Watts(9.0), seconds(f64::from(*step))).is_err());
        assert_eq!(ends, Some(60));
        assert!(gauge.push(Watts(9.0), seconds(61.0)).is_err());
        assert!(gauge.push(Watts(9.1), seconds(62.0)).is_ok());
    }
}
