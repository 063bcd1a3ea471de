//! Self-test of a meter: some counters initialise successfully and then stay at 0, decrease, or
//! return invalid values.

use std::hint::black_box;
use std::thread;
use std::time::{Duration, Instant};

use crate::power::window::{Reading, did_not_move, fell, least_window, read};
use crate::power::{MeterError, PowerMeter};
use crate::units::Watts;

/// Shortest window of a self-test.
const MIN_WINDOW: Duration = Duration::from_millis(300);

/// Length of a window in the meter's update intervals, so that one update more or less does not
/// decide.
const STEPS_PER_WINDOW: u32 = 2;

/// Ratio of loaded to idle power that counts as a response: above the quantisation error and
/// ordinary background noise.
const RESPONSE_RATIO: f64 = 1.05;

/// Result of a self-test.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct SelfTest {
    /// Mean power while this thread slept, in watts, with [`PowerMeter::idle`]. `None` where the
    /// test failed.
    pub idle: Option<Watts>,
    /// Mean power while the load ran, in watts, with [`PowerMeter::idle`]. `None` where the test
    /// failed.
    pub loaded: Option<Watts>,
    /// Whether the meter is usable.
    pub verdict: Verdict,
}

/// Whether a meter is usable.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// The counter increases, and faster under load.
    Works,
    /// The counter increases, but not faster under load: the meter does not cover the loaded
    /// device, or the machine was already busy.
    Unresponsive,
    /// No usable reading: the meter's own error, [`MeterError::Broken`] with the counter's fault,
    /// or [`MeterError::WindowTooShort`].
    Failed(MeterError),
}

/// Compares the power of `meter` in an idle and in a loaded window.
///
/// `load` is called once and must keep the metered device busy for about the given duration;
/// [`busy_cpu_load`] does so for the CPU. Each window is 0.3 s or twice
/// [`PowerMeter::window_seconds`], whichever is longer. Blocks for both windows.
pub fn self_test(meter: &mut dyn PowerMeter, load: &mut dyn FnMut(Duration)) -> SelfTest {
    let mut outcome = SelfTest { idle: None, loaded: None, verdict: Verdict::Works };
    outcome.verdict = match measure(meter, load, &mut outcome.idle, &mut outcome.loaded) {
        Ok(verdict) => verdict,
        Err(error) => Verdict::Failed(error),
    };
    outcome
}

fn measure(
    meter: &mut dyn PowerMeter,
    load: &mut dyn FnMut(Duration),
    idle: &mut Option<Watts>,
    loaded: &mut Option<Watts>,
) -> Result<Verdict, MeterError> {
    let window = MIN_WINDOW.max(least_window(meter) * STEPS_PER_WINDOW);
    let start = read(meter)?;
    thread::sleep(window);
    let rested = read(meter)?;
    let idle_watts = power_between(meter, start, rested)?;
    load(window);
    let worked = read(meter)?;
    let loaded_watts = power_between(meter, rested, worked)?;
    // A meter of one process may stand still while the process sleeps, but not under load.
    if worked.energy == rested.energy {
        return Err(MeterError::broken(
            meter.info().name,
            format!("{} under load", did_not_move(worked.at - rested.at)),
        ));
    }
    *idle = Some(idle_watts);
    *loaded = Some(loaded_watts);
    Ok(if loaded_watts.0 > idle_watts.0 * RESPONSE_RATIO {
        Verdict::Works
    } else {
        Verdict::Unresponsive
    })
}

fn power_between(meter: &dyn PowerMeter, from: Reading, to: Reading) -> Result<Watts, MeterError> {
    let elapsed = to.at.saturating_duration_since(from.at);
    if to.energy < from.energy {
        return Err(MeterError::broken(meter.info().name, fell(from.energy, to.energy)));
    }
    if elapsed.is_zero() || elapsed < least_window(meter) {
        // The load returned at once: the window is empty, and its power undefined.
        return Err(MeterError::WindowTooShort {
            meter: meter.info().name,
            elapsed,
            least: least_window(meter),
        });
    }
    let watts = meter.idle() + (to.energy - from.energy).per_seconds(elapsed.as_secs_f64());
    if watts.0.is_finite() {
        Ok(watts)
    } else {
        Err(MeterError::broken(
            meter.info().name,
            format!("the counter jumped from {} J to {} J", from.energy.0, to.energy.0),
        ))
    }
}

/// Keeps one core busy with arithmetic for `duration`.
pub fn busy_cpu_load(duration: Duration) {
    let start = Instant::now();
    let mut value = 1.0_f64;
    while start.elapsed() < duration {
        for _ in 0..1000 {
            value = black_box(value * 1.000_001 + 1e-9);
        }
        value = value.fract() + 1.0;
    }
    black_box(value);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::power::ScriptedMeter;
    use crate::units::Joules;

    fn verdict(readings: impl IntoIterator<Item = f64>) -> SelfTest {
        self_test(&mut ScriptedMeter::joules(readings), &mut thread::sleep)
    }

    fn failure(readings: impl IntoIterator<Item = f64>) -> String {
        let outcome = verdict(readings);
        let Verdict::Failed(error @ MeterError::Broken { .. }) = &outcome.verdict else {
            panic!("{outcome:?}")
        };
        assert_eq!((outcome.idle, outcome.loaded), (None, None), "a failed test reports no power");
        error.to_string()
    }

    #[test]
    fn a_valid_counter_is_assessed_by_its_response() {
        let good = verdict([100.0, 101.0, 105.0]);
        assert_eq!(good.verdict, Verdict::Works);
        let ratio = good.loaded.unwrap().0 / good.idle.unwrap().0;
        assert!(
            (2.0..8.0).contains(&ratio),
            "four times the energy in about the same time, not {ratio} times"
        );
        assert_eq!(verdict([100.0, 101.0, 101.1]).verdict, Verdict::Unresponsive);
    }

    #[test]
    fn a_counter_that_stands_still_under_load_is_broken() {
        assert!(failure([0.0]).contains("did not move"));
        assert!(failure([7.0, 8.0, 8.0]).contains("under load"));
    }

    #[test]
    fn a_counter_that_falls_or_returns_invalid_values_is_broken() {
        assert!(failure([7.0, 6.0]).contains("fell from 7 J to 6 J"));
        assert!(failure([7.0, 8.0, 1.0]).contains("fell"));
        assert!(failure([7.0, f64::NAN]).contains("NaN"));
        assert!(failure([7.0, 8.0, f64::INFINITY]).contains("inf"));
        assert!(failure([f64::MIN, f64::MAX]).contains("jumped"));
    }

    #[test]
    fn an_error_of_the_meter_is_passed_on() {
        let denied = MeterError::unreadable(ScriptedMeter::NAME, "permission denied");
        let mut meter = ScriptedMeter::new([Ok(Joules(1.0)), Err(denied.clone())]);
        assert_eq!(self_test(&mut meter, &mut thread::sleep).verdict, Verdict::Failed(denied));
    }

    #[test]
    fn a_load_that_returns_at_once_is_no_division_by_zero() {
        let mut meter = ScriptedMeter::joules([1.0, 2.0, 3.0]).with_window_seconds(0.1);
        let outcome = self_test(&mut meter, &mut |_| ());
        assert!(
            matches!(outcome.verdict, Verdict::Failed(MeterError::WindowTooShort { .. })),
            "{outcome:?}"
        );
    }
}
