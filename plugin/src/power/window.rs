//! Energy between two moments, for a measurement on a thread of its own with exact bounds.

use std::time::Duration;

use bevy::platform::time::Instant;

use crate::power::{MeterError, PowerMeter};
use crate::units::{Joules, Watts};

/// A counter's value with its time.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reading {
    pub energy: Joules,
    pub at: Instant,
}

/// Reads a meter once. The time is the midpoint of the call, since a driver may take milliseconds
/// to answer.
///
/// # Errors
/// The meter's own, and [`MeterError::Broken`] when the value is not finite.
pub(crate) fn read(meter: &mut dyn PowerMeter) -> Result<Reading, MeterError> {
    let before = Instant::now();
    let energy = meter.energy()?;
    let at = before + before.elapsed() / 2;
    if energy.0.is_finite() {
        Ok(Reading { energy, at })
    } else {
        Err(MeterError::broken(meter.info().name, not_a_number(energy)))
    }
}

/// Fault of a meter that returns NaN or infinity.
pub(crate) fn not_a_number(energy: Joules) -> String {
    format!("the counter reads {} J", energy.0)
}

/// The shortest valid window of `meter`: its [`window_seconds`](PowerMeter::window_seconds),
/// clamped to 0 s to 60 s, and 1 s for NaN.
pub(crate) fn least_window(meter: &dyn PowerMeter) -> Duration {
    let seconds = meter.window_seconds();
    if seconds.is_nan() {
        Duration::from_secs(1)
    } else {
        Duration::from_secs_f64(seconds.clamp(0.0, 60.0))
    }
}

/// Energy from [`start`](Self::start) to [`finish`](Self::finish), read from the same meter.
///
/// Times are from the monotonic clock. Keep windows well above the meter's update interval
/// ([`PowerMeter::window_seconds`]): the error is up to one interval at either end.
#[derive(Debug)]
#[must_use = "a window measures nothing until it is finished"]
pub struct EnergyWindow {
    start: Reading,
}

impl EnergyWindow {
    /// Starts a window now.
    ///
    /// # Errors
    /// [`MeterError`] when the meter gives no reading, or one that is not finite.
    pub fn start(meter: &mut dyn PowerMeter) -> Result<Self, MeterError> {
        Ok(Self { start: read(meter)? })
    }

    /// Time since the window was started.
    pub fn elapsed(&self) -> Duration {
        self.start.at.elapsed()
    }

    /// Ends the window and returns its energy, without [`PowerMeter::idle`], in joules (at least
    /// 0), and its length. Both may be 0 for a very short window, so do not divide one by the
    /// other: use [`finish_power`](Self::finish_power).
    ///
    /// # Errors
    /// [`MeterError`] when the meter gives no reading, or one that is not finite or is below the
    /// first.
    pub fn finish(self, meter: &mut dyn PowerMeter) -> Result<(Joules, Duration), MeterError> {
        let end = read(meter)?;
        let energy = end.energy - self.start.energy;
        if energy.0 < 0.0 {
            return Err(MeterError::broken(meter.info().name, fell(self.start.energy, end.energy)));
        }
        Ok((energy, end.at.saturating_duration_since(self.start.at)))
    }

    /// Ends the window and returns its mean power, with [`PowerMeter::idle`], in watts; finite.
    ///
    /// # Errors
    /// As [`finish`](Self::finish); [`MeterError::WindowTooShort`] when the window is shorter than
    /// the meter's update interval; [`MeterError::Broken`] when the counter did not change.
    pub fn finish_power(self, meter: &mut dyn PowerMeter) -> Result<Watts, MeterError> {
        let (energy, elapsed) = self.finish(meter)?;
        let least = least_window(meter);
        if elapsed.is_zero() || elapsed < least {
            return Err(MeterError::WindowTooShort { meter: meter.info().name, elapsed, least });
        }
        if energy.0 == 0.0 {
            return Err(MeterError::broken(meter.info().name, did_not_move(elapsed)));
        }
        Ok(meter.idle() + energy.per_seconds(elapsed.as_secs_f64()))
    }
}

/// Fault of a counter that decreases.
pub(crate) fn fell(from: Joules, to: Joules) -> String {
    format!("the counter fell from {} J to {} J", from.0, to.0)
}

/// Fault of a counter that stands still.
pub(crate) fn did_not_move(elapsed: Duration) -> String {
    format!("the counter did not move in {:.2} s", elapsed.as_secs_f64())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::power::ScriptedMeter;

    #[test]
    fn gives_the_difference() {
        let mut meter = ScriptedMeter::joules([100.0, 103.5]);
        let window = EnergyWindow::start(&mut meter).unwrap();
        let (energy, _) = window.finish(&mut meter).unwrap();
        assert_eq!(energy, Joules(3.5));
    }

    #[test]
    fn a_window_of_zero_length_gives_no_power() {
        let mut meter = ScriptedMeter::joules([1.0, 2.0]).with_window_seconds(10.0);
        let window = EnergyWindow::start(&mut meter).unwrap();
        assert!(matches!(window.finish_power(&mut meter), Err(MeterError::WindowTooShort { .. })));
    }

    #[test]
    fn faults_are_errors() {
        for (readings, word) in [
            ([5.0, 4.0], "fell"),
            ([5.0, f64::NAN], "NaN"),
            ([5.0, f64::INFINITY], "inf"),
            ([5.0, 5.0], "did not move"),
        ] {
            let mut meter = ScriptedMeter::joules(readings).with_window_seconds(0.0);
            let window = EnergyWindow::start(&mut meter).unwrap();
            std::thread::sleep(Duration::from_millis(1));
            let error = window.finish_power(&mut meter).unwrap_err();
            assert!(
                matches!(error, MeterError::Broken { .. }) && error.to_string().contains(word),
                "{error}"
            );
        }
    }

    #[test]
    fn an_invalid_window_is_clamped() {
        for (seconds, least) in [(f64::NAN, 1), (f64::INFINITY, 60), (-1.0, 0)] {
            let meter = ScriptedMeter::joules([0.0]).with_window_seconds(seconds);
            assert_eq!(least_window(&meter), Duration::from_secs(least));
        }
    }
}
