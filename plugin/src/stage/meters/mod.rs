//! Power meters of measurements: a mean power over a time, by any meter, and whether a meter responds to
//! a load.
//!
//! The plugin's thread samples the meters of a device and judges their readings. A counter that
//! jumps or falls makes a measurement longer, not wrong. Energy is counted from one step of the
//! counter to another: between arbitrary moments it would be off by a step at either end.

#[cfg(test)]
pub(crate) mod testing;

use std::hint::black_box;
use std::thread;
use std::time::{Duration, Instant};

use crate::power::{MeterError, MeterInfo, MeterState, PowerMeter, PowerSampler, Provenance};
use crate::units::{Joules, Watts};

/// A meter's windows are at most this long, whatever it says.
const LONGEST_WINDOW_SECONDS: f64 = 60.0;
/// Work goes on for this long before a measurement, so that clocks and regulators have settled, and
/// the plugin's thread knows the load for one.
const SETTLE: Duration = Duration::from_millis(400);
/// Time beyond thrice its length after which a measurement is given up: a counter counts as stuck
/// after 10 s.
const PATIENCE: Duration = Duration::from_secs(15);
/// Time in which a device's clocks fall after its last frame.
const REST: Duration = Duration::from_secs(2);
/// Length of a piece of rest or load.
const PIECE: Duration = Duration::from_millis(10);
/// Shortest window of a self-test.
const MIN_WINDOW: Duration = Duration::from_millis(500);
/// Ratio of loaded to idle power that counts as a response: above the quantisation error and
/// ordinary background noise.
const RESPONSE_RATIO: f64 = 1.05;

/// A meter of measurements.
pub struct Meter {
    /// Name, provenance and coverage.
    pub info: MeterInfo,
    /// The shortest window that means something, seconds.
    pub window_seconds: f64,
    pub(super) source: Source,
    /// `None` until it is needed: a meter of a device takes seconds to measure it.
    idle: Option<Watts>,
}

pub(super) enum Source {
    /// A model of this process' work, which is read at once. Its time counts from the second field.
    Modelled(Box<dyn PowerMeter>, Instant),
    /// A meter of a device, with the thread that reads it.
    Measured(PowerSampler),
}

/// What was metered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Mean {
    pub(super) power: Watts,
    /// Pieces of work per second.
    pub(super) rate: f64,
}

/// Result of a self-test.
#[derive(Clone, Debug, PartialEq)]
pub struct SelfTest {
    /// Mean power while this thread slept.
    pub idle: Watts,
    /// Mean power while the load ran.
    pub loaded: Watts,
    /// Whether power rises under load. It does not where the meter does not cover the loaded device, or
    /// the machine was already busy.
    pub responds: bool,
}

impl Meter {
    /// Prepares an open meter for measurements.
    ///
    /// # Errors
    /// When no thread can be created.
    pub fn new(meter: Box<dyn PowerMeter>) -> Result<Self, MeterError> {
        let (info, seconds) = (meter.info(), meter.window_seconds());
        let seconds = if seconds.is_nan() { 1.0 } else { seconds };
        let window_seconds = seconds.clamp(0.0, LONGEST_WINDOW_SECONDS);
        let (idle, source) = if info.provenance == Provenance::Modelled {
            (Some(Watts(0.0)), Source::Modelled(meter, Instant::now()))
        } else {
            (None, Source::Measured(PowerSampler::fine(meter)?))
        };
        Ok(Self { info, window_seconds, source, idle })
    }

    /// Idle power: measured where the meter covers the whole device, otherwise the meter's own figure.
    ///
    /// # Errors
    /// When the meter gives no valid readings.
    pub(super) fn idle(&mut self) -> Result<Watts, MeterError> {
        if let Some(idle) = self.idle {
            return Ok(idle);
        }
        // The device goes to rest first.
        thread::sleep(REST);
        let window = Duration::from_secs_f64((2.0 * self.window_seconds).max(2.0));
        let idle = self.mean(window, &mut || thread::sleep(PIECE))?.power;
        self.idle = Some(idle);
        Ok(idle)
    }

    /// Mean power while `work` is done again and again, for `least`.
    ///
    /// # Errors
    /// When the meter gives no valid readings.
    pub(super) fn mean(
        &mut self,
        least: Duration,
        work: &mut dyn FnMut(),
    ) -> Result<Mean, MeterError> {
        let settling = Instant::now();
        while settling.elapsed() < SETTLE {
            work();
        }
        let (energy, time) = self.counted()?;
        let (started, mut done) = (Instant::now(), 0_u32);
        loop {
            work();
            done += 1;
            let (energy, time) = {
                let now = self.counted()?;
                (now.0 - energy, now.1.saturating_sub(time))
            };
            if !time.is_zero() && time >= least {
                let power = energy.per_seconds(time.as_secs_f64());
                if !power.0.is_finite() || power.0 < 0.0 {
                    let reason = format!("it counts {} J", energy.0);
                    return Err(MeterError::broken(self.info.name.as_str(), reason));
                }
                return Ok(Mean { power, rate: f64::from(done) / started.elapsed().as_secs_f64() });
            }
            if started.elapsed() > least * 3 + PATIENCE {
                let reason = format!(
                    "{:.1} s of {:.1} s had valid readings",
                    time.as_secs_f64(),
                    started.elapsed().as_secs_f64()
                );
                return Err(MeterError::broken(self.info.name.as_str(), reason));
            }
        }
    }

    /// Valid energy so far, and its time.
    fn counted(&mut self) -> Result<(Joules, Duration), MeterError> {
        let snapshot = match &mut self.source {
            Source::Modelled(meter, since) => return Ok((meter.energy()?, since.elapsed())),
            Source::Measured(sampler) => sampler.snapshot(),
        };
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

    /// Compares the power in a window of rest and in one in which a core of the processor is busy.
    ///
    /// # Errors
    /// When the meter gives no valid readings, or stands still under load.
    pub fn self_test(&mut self) -> Result<SelfTest, MeterError> {
        // Two of its own windows, so that one update more or less does not decide.
        let window = MIN_WINDOW.max(Duration::from_secs_f64(2.0 * self.window_seconds));
        let idle = self.mean(window, &mut || thread::sleep(PIECE))?.power;
        let loaded = self.mean(window, &mut keep_busy)?.power;
        let is_modelled = matches!(self.source, Source::Modelled(..));
        // A model of one process may stand still while that sleeps, but not under load.
        if is_modelled && loaded.0 == 0.0 {
            let reason = "the counter did not move under load";
            return Err(MeterError::broken(self.info.name.as_str(), reason));
        }
        let responds = loaded.0 > idle.0 * RESPONSE_RATIO;
        Ok(SelfTest { idle, loaded, responds })
    }
}

/// Keeps one core busy with arithmetic.
fn keep_busy() {
    let start = Instant::now();
    let mut value = 1.0_f64;
    while start.elapsed() < PIECE {
        for _ in 0..1000 {
            value = black_box(value * 1.000_001 + 1e-9);
        }
        value = value.fract() + 1.0;
    }
    black_box(value);
}

#[cfg(test)]
mod tests {
    #[cfg(unix)]
    use crate::power::CpuTimeMeter;

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
                thread::sleep(Duration::from_millis(10));
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
            let mut work = || thread::sleep(Duration::from_millis(10));
            let error = meter.mean(Duration::from_millis(500), &mut work).expect_err(word);
            assert!(error.to_string().contains(word), "{error}");
        }
    }

    #[test]
    fn a_steady_device_does_not_respond() {
        let mut meter = Meter::new(Box::new(Steps::new(6.0))).expect("a thread");
        let found = meter.self_test().expect("readings");
        assert!(
            (found.idle.0 - 6.0).abs() < 0.6 && (found.loaded.0 - 6.0).abs() < 0.6,
            "{found:?}"
        );
    }

    #[cfg(unix)]
    #[test]
    fn cpu_time_responds() {
        // Other tests load this process too, so an idle window may be busy. One successful try in
        // ten is enough.
        let mut meter = Meter::new(Box::new(CpuTimeMeter::default())).expect("no thread");
        let mut test = || meter.self_test().expect("the clock");
        let found = (0..10).map(|_| test()).find(|found| found.responds);
        let found = found.expect("a busy core draws more than a sleeping one");
        assert!(found.loaded > found.idle, "{found:?}");
    }
}
