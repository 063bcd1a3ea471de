//! Energy between two moments, for a measurement that owns its thread and wants exact bounds.

use std::time::{Duration, Instant};

use crate::power::{MeterError, PowerMeter};
use crate::units::{Joules, Watts};

/// A counter's value and when it was taken.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reading {
    pub energy: Joules,
    pub at: Instant,
}

/// Reads a meter once. The moment is the middle of the call, since a driver may take milliseconds
/// to answer.
///
/// # Errors
/// The meter's own, and `Broken` when the value is not a finite number.
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

/// What a meter did that answered NaN or infinity.
pub(crate) fn not_a_number(energy: Joules) -> String {
    format!("the counter reads {} J", energy.0)
}

/// The shortest meaningful window of `meter`, as a duration: its
/// [`window_seconds`](PowerMeter::window_seconds), held to 0 s to 60 s, and 1 s where a meter
/// answers nonsense.
pub(crate) fn least_window(meter: &dyn PowerMeter) -> Duration {
    let seconds = meter.window_seconds();
    if seconds.is_nan() {
        Duration::from_secs(1)
    } else {
        Duration::from_secs_f64(seconds.clamp(0.0, 60.0))
    }
}

/// Energy from [`start`](Self::start) to [`finish`](Self::finish), by the same meter.
///
/// Time is the monotonic clock's. Keep windows well above the meter's own step
/// ([`PowerMeter::window_seconds`]): the error is up to one step at either end.
#[derive(Debug)]
#[must_use = "a window measures nothing until it is finished"]
pub struct EnergyWindow {
    start: Reading,
}

impl EnergyWindow {
    /// Opens a window now.
    ///
    /// # Errors
    /// When the meter gives no reading, or one that is no number.
    pub fn start(meter: &mut dyn PowerMeter) -> Result<Self, MeterError> {
        Ok(Self { start: read(meter)? })
    }

    /// How long the window has been open.
    pub fn elapsed(&self) -> Duration {
        self.start.at.elapsed()
    }

    /// Closes the window: energy spent in it, without [`PowerMeter::idle`], and its length. Both
    /// may be 0 for a window that is opened and closed at once, so do not divide one by the other:
    /// [`finish_power`](Self::finish_power) does, with care.
    ///
    /// # Errors
    /// When the meter gives no reading, or one that is no number or below the first.
    pub fn finish(self, meter: &mut dyn PowerMeter) -> Result<(Joules, Duration), MeterError> {
        let end = read(meter)?;
        let energy = end.energy - self.start.energy;
        if energy.0 < 0.0 {
            return Err(MeterError::broken(meter.info().name, fell(self.start.energy, end.energy)));
        }
        Ok((energy, end.at.saturating_duration_since(self.start.at)))
    }

    /// Closes the window: mean power in it, [`PowerMeter::idle`] included. Finite.
    ///
    /// # Errors
    /// As [`finish`](Self::finish); `WindowTooShort` when the window is shorter than the meter's
    /// step; `Broken` when the counter did not move.
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

/// What a counter did that went backwards.
pub(crate) fn fell(from: Joules, to: Joules) -> String {
    format!("the counter fell from {} J to {} J", from.0, to.0)
}

/// What a counter did that stood still.
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
    fn a_window_of_no_length_is_no_power() {
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
    fn a_nonsense_window_is_held_to_something_finite() {
        for (seconds, least) in [(f64::NAN, 1), (f64::INFINITY, 60), (-1.0, 0)] {
            let meter = ScriptedMeter::joules([0.0]).with_window_seconds(seconds);
            assert_eq!(least_window(&meter), Duration::from_secs(least));
        }
    }
}
