//! Power modelled from the processor time of this process: the meter of software rendering, where
//! the processor is the GPU.
//!
//! Model: energy = (user + system time of all threads) × watts per busy core. It is linear in the
//! work done and free of the noise of other processes, so it orders settings well; its absolute
//! scale is only as good as the constant. It knows neither clock changes, nor memory, nor the power
//! of an idle machine. Options: 1. package counters (RAPL), which need root on most systems and
//! include every other process;
//! 2. wall time × utilisation of the whole machine, which includes other processes too; 3.
//!    processor time of this process. We use 3 because it works everywhere without rights.

use crate::power::{MeterError, MeterInfo, PowerMeter, Provenance};
use crate::units::{Joules, Watts};

/// Modelled meter: processor time of this process × watts per busy core.
///
/// Covers all threads of this process, in user and in system mode, and nothing else. A reading
/// costs under a microsecond.
#[derive(Clone, Debug, PartialEq)]
pub struct CpuTimeMeter {
    watts_per_core: Watts,
}

/// A power per core that no core has.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("watts per core must be finite and above 0, not {}", .0.0)]
pub struct InvalidWattsPerCore(pub Watts);

impl CpuTimeMeter {
    /// Identifier on the command line.
    pub const NAME: &str = "cpu-time";

    /// 3.5 W: about what one more busy core adds to a laptop's package (15 to 28 W over 4 to 8
    /// cores). A constant of the model, not a measurement.
    pub const DEFAULT_WATTS_PER_CORE: Watts = Watts(3.5);

    /// The model with another constant, in watts per busy core.
    ///
    /// # Errors
    /// When `watts_per_core` is not finite or not above 0.
    pub fn with_watts_per_core(watts_per_core: Watts) -> Result<Self, InvalidWattsPerCore> {
        if watts_per_core.0.is_finite() && watts_per_core.0 > 0.0 {
            Ok(Self { watts_per_core })
        } else {
            Err(InvalidWattsPerCore(watts_per_core))
        }
    }

    /// The model's constant, in watts per busy core. Finite and above 0.
    pub fn watts_per_core(&self) -> Watts {
        self.watts_per_core
    }
}

impl Default for CpuTimeMeter {
    fn default() -> Self {
        Self { watts_per_core: Self::DEFAULT_WATTS_PER_CORE }
    }
}

impl PowerMeter for CpuTimeMeter {
    fn info(&self) -> MeterInfo {
        MeterInfo {
            name: Self::NAME.to_owned(),
            provenance: Provenance::Modelled,
            description: format!(
                "CPU time of this process (user + system, all threads) × {} W per busy core; without the idle machine",
                self.watts_per_core.0
            ),
        }
    }

    fn energy(&mut self) -> Result<Joules, MeterError> {
        process_cpu_seconds().map(|seconds| Joules(seconds * self.watts_per_core.0))
    }

    fn window_seconds(&self) -> f64 {
        // The clock itself steps in nanoseconds where the kernel accounts precisely, but in
        // scheduler ticks (1 to 10 ms) where it does not.
        1e-3
    }
}

/// Processor time that all threads of this process have spent so far, in seconds.
#[cfg(all(
    unix,
    not(any(
        target_os = "solaris",
        target_os = "illumos",
        target_os = "netbsd",
        target_os = "redox"
    ))
))]
fn process_cpu_seconds() -> Result<f64, MeterError> {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    Ok(time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9)
}

#[cfg(not(all(
    unix,
    not(any(
        target_os = "solaris",
        target_os = "illumos",
        target_os = "netbsd",
        target_os = "redox"
    ))
)))]
fn process_cpu_seconds() -> Result<f64, MeterError> {
    Err(MeterError::unavailable(
        CpuTimeMeter::NAME,
        "this platform has no process CPU clock that we know how to read",
    ))
}

#[cfg(all(test, unix))]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::power::{Verdict, busy_cpu_load, self_test};

    #[test]
    fn rejects_constants_that_no_core_has() {
        for watts in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(CpuTimeMeter::with_watts_per_core(Watts(watts)).is_err(), "{watts}");
        }
        assert_eq!(
            CpuTimeMeter::with_watts_per_core(Watts(5.0)).unwrap().watts_per_core(),
            Watts(5.0)
        );
    }

    #[test]
    fn energy_of_one_busy_thread_is_its_time_times_the_constant() {
        let mut meter = CpuTimeMeter::with_watts_per_core(Watts(10.0)).unwrap();
        let start = meter.energy().unwrap();
        busy_cpu_load(Duration::from_millis(100));
        let spent = meter.energy().unwrap() - start;
        // Other tests run in this process at the same time, so only the lower bound is ours alone;
        // and the machine may be busy, so that this thread got as little as a tenth of a core.
        assert!(spent.0 > 0.1, "{spent}");
        // No more than every core of the machine for the time that a busy machine may have
        // stretched the load to.
        assert!(spent.0 < 10.0 * 1024.0, "{spent}");
    }

    #[test]
    fn passes_its_own_self_test() {
        // Other tests load this process too: an idle window may be anything but idle. One quiet try
        // in ten is enough.
        let outcome = (0..10)
            .map(|_| self_test(&mut CpuTimeMeter::default(), &mut busy_cpu_load))
            .find(|outcome| outcome.verdict == Verdict::Works)
            .expect("a busy core draws more than a sleeping one");
        let (idle, loaded) = (outcome.idle.unwrap(), outcome.loaded.unwrap());
        assert!(loaded > idle, "{loaded} loaded, {idle} idle");
    }

    #[test]
    fn says_what_it_is() {
        let info = CpuTimeMeter::default().info();
        assert_eq!(info.provenance, Provenance::Modelled);
        assert!(info.description.contains("× 3.5 W per busy core"), "{}", info.description);
    }
}
