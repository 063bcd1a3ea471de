//! Self-test of a meter: whether its readings are valid, and rise under a load.

use std::hint::black_box;
use std::thread;
use std::time::{Duration, Instant};

use crate::power::MeterError;
use crate::power::Provenance;
use crate::units::Watts;

use super::Meter;

/// Shortest window of a self-test.
const MIN_WINDOW: Duration = Duration::from_millis(500);
/// Length of a window in the meter's own, so that one update more or less does not decide.
const WINDOWS: f64 = 2.0;
/// Ratio of loaded to idle power that counts as a response: above the quantisation error and
/// ordinary background noise.
const RESPONSE_RATIO: f64 = 1.05;
/// Length of a piece of rest or load.
const PIECE: Duration = Duration::from_millis(10);

/// Result of a self-test.
#[derive(Clone, Debug, PartialEq)]
pub struct SelfTest {
    /// Mean power while this thread slept, with the meter's idle power.
    pub idle: Watts,
    /// Mean power while the load ran, with the meter's idle power.
    pub loaded: Watts,
    /// Whether power rises under load. It does not where the meter does not cover the loaded device, or
    /// the machine was already busy.
    pub responds: bool,
}

/// Compares the power of `meter` in an idle and in a loaded window. `load` keeps the device busy for
/// about the given time, again and again.
///
/// # Errors
/// When the meter gives no valid readings, or stands still under load.
pub fn self_test(
    meter: &mut Meter,
    load: &mut dyn FnMut(Duration),
) -> Result<SelfTest, MeterError> {
    let seconds = meter.window_seconds();
    let window = MIN_WINDOW.max(Duration::from_secs_f64(WINDOWS * seconds.clamp(0.0, 60.0)));
    let idle = meter.mean(window, &mut || thread::sleep(PIECE))?.power;
    let loaded = meter.mean(window, &mut || load(PIECE))?.power;
    let info = meter.info();
    // A model of one process may stand still while that sleeps, but not under load.
    if info.provenance == Provenance::Modelled && loaded.0 == 0.0 {
        return Err(MeterError::broken(info.name, "the counter did not move under load"));
    }
    let responds = loaded.0 > idle.0 * RESPONSE_RATIO;
    Ok(SelfTest { idle: meter.idle() + idle, loaded: meter.idle() + loaded, responds })
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
    use crate::power::CpuTimeMeter;

    use super::*;
    use crate::stage::meters::testing::Steps;

    #[test]
    fn a_steady_device_does_not_respond() {
        let mut meter = Meter::new(Box::new(Steps::new(6.0))).expect("a thread");
        let found = self_test(&mut meter, &mut busy_cpu_load).expect("readings");
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
        let mut test = || self_test(&mut meter, &mut busy_cpu_load).expect("the clock");
        let found = (0..10).map(|_| test()).find(|found| found.responds);
        let found = found.expect("a busy core draws more than a sleeping one");
        assert!(found.loaded > found.idle, "{found:?}");
    }
}
