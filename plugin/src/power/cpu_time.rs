//! Power modelled from the CPU time of this process: the meter of software rendering, which runs on
//! the CPU.
//!
//! Model: energy = (user + system time of all threads) × watts per busy core. It is linear in the
//! work done and free of the noise of other processes, so it orders settings well; its absolute
//! scale is only as good as the constant. It ignores clock changes, memory, and the power of an
//! idle machine. Options:
//! 1. Package counters (RAPL): need root on most systems and include every other process.
//! 2. Wall time × utilisation of the whole machine: includes other processes too.
//! 3. CPU time of this process.
//!
//! We use option 3 because it works everywhere without privileges.

use crate::power::{MeterError, MeterInfo, PowerMeter, Provenance};
use crate::units::{Joules, Watts};

/// Modelled meter: CPU time of this process × watts per busy core.
///
/// Covers all threads of this process, in user and system mode, and nothing else. A reading takes
/// less than a microsecond. Available on most Unix systems; elsewhere readings fail with
/// [`MeterError::Unavailable`].
#[derive(Clone, Debug, PartialEq)]
pub struct CpuTimeMeter {
    watts_per_core: Watts,
}

/// Invalid constant of the model: not finite, or not above 0 W.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("watts per core must be finite and above 0, not {}", .0.0)]
pub struct InvalidWattsPerCore(pub Watts);

impl CpuTimeMeter {
    /// Name on the command line and in [`open`](crate::power::open).
    pub const NAME: &str = "cpu-time";

    /// Watts per busy core by default, 3.5 W: the approximate power that one more busy core adds to
    /// a laptop's package (15 to 28 W over 4 to 8 cores). A constant of the model, not a
    /// measurement.
    pub const DEFAULT_WATTS_PER_CORE: Watts = Watts(3.5);

    /// The model with another constant, in watts per busy core; finite, above 0. The modelled power
    /// scales with it.
    ///
    /// # Errors
    /// [`InvalidWattsPerCore`] when `watts_per_core` is not finite or not above 0.
    pub fn with_watts_per_core(watts_per_core: Watts) -> Result<Self, InvalidWattsPerCore> {
        if watts_per_core.0.is_finite() && watts_per_core.0 > 0.0 {
            Ok(Self { watts_per_core })
        } else {
            Err(InvalidWattsPerCore(watts_per_core))
        }
    }

    /// The model's constant, in watts per busy core; finite, above 0.
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
        // The clock's resolution is nanoseconds where the kernel accounts precisely, but scheduler
        // ticks (1 to 10 ms) elsewhere.
        1e-3
    }
}

/// CPU time of all threads of this process so far, in seconds.
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
        "this platform has no supported process CPU clock",
    ))
}

#[cfg(all(test, unix))]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::power::{Verdict, busy_cpu_load, self_test};

    #[test]
    fn rejects_invalid_constants() {
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
        // Other tests run in this process at the same time, so only the lower bound is exact; on a
        // busy machine this thread may get as little as a tenth of a core.
        assert!(spent.0 > 0.1, "{spent}");
        // At most every core of the machine, for as long as a busy machine may stretch the load.
        assert!(spent.0 < 10.0 * 1024.0, "{spent}");
    }

    #[test]
    fn passes_its_own_self_test() {
        // Other tests load this process too, so an idle window may be busy. One successful try in
        // ten is enough.
        let outcome = (0..10)
            .map(|_| self_test(&mut CpuTimeMeter::default(), &mut busy_cpu_load))
            .find(|outcome| outcome.verdict == Verdict::Works)
            .expect("a busy core draws more than a sleeping one");
        let (idle, loaded) = (outcome.idle.unwrap(), outcome.loaded.unwrap());
        assert!(loaded > idle, "{loaded} loaded, {idle} idle");
    }

    #[test]
    fn reports_its_provenance() {
        let info = CpuTimeMeter::default().info();
        assert_eq!(info.provenance, Provenance::Modelled);
        assert!(info.description.contains("× 3.5 W per busy core"), "{}", info.description);
    }
}
