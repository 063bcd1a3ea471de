//! Power meters of measurements: a mean power over a time, by any meter.
//!
//! | file | job |
//! |---|---|
//! | `mod` | a meter that is read at once or by the plugin's sampling thread, and mean power by it |
//! | `self_test` | whether a meter responds to a load |
//!
//! The plugin's thread samples the meters of a device and judges their readings. A counter that
//! jumps or falls makes a measurement longer, not wrong. Energy is counted from one step of the
//! counter to another: between arbitrary moments it would be off by a step at either end.

mod self_test;
#[cfg(test)]
pub(crate) mod testing;

use std::sync::Arc;
use std::time::{Duration, Instant};

use crate::power::{MeterError, MeterState, PowerMeter, PowerSampler};
use crate::power::{MeterInfo, Provenance};
use crate::units::{Joules, Watts};

pub use self_test::{SelfTest, busy_cpu_load, self_test};

/// A meter's windows are at most this long, whatever it says.
const LONGEST_WINDOW_SECONDS: f64 = 60.0;
/// Work goes on for this long before a measurement, so that clocks and regulators have settled, and
/// the plugin's thread knows the load for one.
const SETTLE: Duration = Duration::from_millis(400);
/// Time beyond thrice its length after which a measurement is given up: a counter counts as stuck
/// after 10 s.
const PATIENCE: Duration = Duration::from_secs(15);

/// A meter of measurements.
pub enum Meter {
    /// A model of this process' work, which is read at once. Its time counts from the second field.
    Modelled(Box<dyn PowerMeter>, Instant),
    /// A meter of a device.
    Measured(Arc<Sampled>),
}

/// A meter of a device with the thread that reads it.
pub struct Sampled {
    sampler: PowerSampler,
    info: MeterInfo,
    window_seconds: f64,
}

/// What was metered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mean {
    /// Without the meter's idle power.
    pub power: Watts,
    /// Pieces of work per second.
    pub rate: f64,
}

impl Meter {
    /// Prepares an open meter for measurements.
    ///
    /// # Errors
    /// When no thread can be created.
    pub fn new(meter: Box<dyn PowerMeter>) -> Result<Self, MeterError> {
        if meter.info().provenance == Provenance::Modelled {
            return Ok(Self::Modelled(meter, Instant::now()));
        }
        let (info, seconds) = (meter.info(), meter.window_seconds());
        let seconds = if seconds.is_nan() { 1.0 } else { seconds };
        let window_seconds = seconds.clamp(0.0, LONGEST_WINDOW_SECONDS);
        let sampler = PowerSampler::fine(meter)?;
        Ok(Self::Measured(Arc::new(Sampled { sampler, info, window_seconds })))
    }

    /// Name, provenance and coverage.
    pub fn info(&self) -> MeterInfo {
        match self {
            Self::Modelled(meter, _) => meter.info(),
            Self::Measured(sampled) => sampled.info.clone(),
        }
    }

    /// The shortest window that means something, seconds.
    pub fn window_seconds(&self) -> f64 {
        match self {
            Self::Modelled(meter, _) => meter.window_seconds(),
            Self::Measured(sampled) => sampled.window_seconds,
        }
    }

    /// Idle power that readings do not include.
    pub fn idle(&self) -> Watts {
        match self {
            Self::Modelled(meter, _) => meter.idle(),
            // Meters of devices contain it.
            Self::Measured(_) => Watts(0.0),
        }
    }

    /// Mean power while `work` is done again and again, for `least`.
    ///
    /// # Errors
    /// When the meter gives no valid readings.
    pub fn mean(&mut self, least: Duration, work: &mut dyn FnMut()) -> Result<Mean, MeterError> {
        match self {
            Self::Modelled(meter, since) => {
                let name = meter.info().name;
                mean(&name, &mut || Ok((meter.energy()?, since.elapsed())), least, work)
            }
            Self::Measured(sampled) => sampled.mean(least, work),
        }
    }
}

impl Sampled {
    /// As [`Meter::window_seconds`].
    pub fn window_seconds(&self) -> f64 {
        self.window_seconds
    }

    /// As [`Meter::mean`].
    pub fn mean(&self, least: Duration, work: &mut dyn FnMut()) -> Result<Mean, MeterError> {
        mean(&self.info.name, &mut || self.counted(), least, work)
    }

    /// Valid energy so far, and its time.
    fn counted(&self) -> Result<(Joules, Duration), MeterError> {
        let snapshot = self.sampler.snapshot();
        match snapshot.state {
            MeterState::Lost { reason } | MeterState::Unavailable { reason } => {
                let name = self.info.name.as_str();
                // It names the meter, as the error does.
                let reason = reason.trim_start_matches(name).trim_start_matches(": ");
                Err(MeterError::unreadable(name, reason))
            }
            _ => Ok(snapshot.counted),
        }
    }
}

fn mean(
    name: &str,
    counted: &mut dyn FnMut() -> Result<(Joules, Duration), MeterError>,
    least: Duration,
    work: &mut dyn FnMut(),
) -> Result<Mean, MeterError> {
    let settling = Instant::now();
    while settling.elapsed() < SETTLE {
        work();
    }
    let (energy, time) = counted()?;
    let (started, mut done) = (Instant::now(), 0_u32);
    loop {
        work();
        done += 1;
        let (energy, time) = {
            let now = counted()?;
            (now.0 - energy, now.1.saturating_sub(time))
        };
        if !time.is_zero() && time >= least {
            let power = energy.per_seconds(time.as_secs_f64());
            if !power.0.is_finite() || power.0 < 0.0 {
                return Err(MeterError::broken(name, format!("it counts {} J", energy.0)));
            }
            return Ok(Mean { power, rate: f64::from(done) / started.elapsed().as_secs_f64() });
        }
        if started.elapsed() > least * 3 + PATIENCE {
            let reason = format!(
                "{:.1} s of {:.1} s had valid readings",
                time.as_secs_f64(),
                started.elapsed().as_secs_f64()
            );
            return Err(MeterError::broken(name, reason));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::testing::Steps;
    use super::*;

    #[test]
    fn a_mean_goes_from_step_to_step_and_contains_no_jump() {
        for glitch in [0.0, 702.0] {
            let steps = Steps { glitch, ..Steps::new(80.0) };
            let mut meter = Meter::new(Box::new(steps)).expect("a thread");
            let mut frames = 0;
            let mut work = || {
                frames += 1;
                std::thread::sleep(Duration::from_millis(10));
            };
            let found = meter.mean(Duration::from_secs(1), &mut work).expect("a power");
            // Unaligned it is off by up to 20 %. The rest is for a loaded machine.
            assert!((found.power.0 - 80.0).abs() < 8.0, "{glitch} J: {found:?}");
            assert!((10.0..101.0).contains(&found.rate) && frames > 10, "{found:?}");
        }
    }

    #[test]
    fn a_counter_that_stands_still_or_tells_nothing_ends() {
        for (step_seconds, word) in [(1e6, "did not move"), (f64::INFINITY, "NaN")] {
            let steps = Steps { step_seconds, ..Steps::new(80.0) };
            let mut meter = Meter::new(Box::new(steps)).expect("a thread");
            let mut work = || std::thread::sleep(Duration::from_millis(10));
            let error = meter.mean(Duration::from_millis(500), &mut work).expect_err(word);
            assert!(error.to_string().contains(word), "{error}");
        }
    }
}
