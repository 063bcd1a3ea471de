//! Power modelled from the CPU time of this process: the meter of software rendering, which runs on
//! the CPU.
//!
//! Model: energy = (user + system time of all threads) × watts per busy core. It is linear in the
//! work done and free of the noise of other processes, so it orders settings well; its absolute
//! scale is only as good as the constant. It ignores clock changes, memory, and the power of an
//! idle machine. Package counters (RAPL) include every other process and need root on most systems;
//! CPU time needs no privileges.

use crate::power::meter::{MeterKind, Opened, Wanted};
use crate::power::{AdapterKind, MeterError, MeterInfo, OpenMeterError, PowerMeter, Provenance};
use crate::units::{Joules, Watts};

/// What its parameter is.
const WATTS: &str = "watts per busy core, such as 5.0";

pub(crate) const KIND: MeterKind = MeterKind {
    name: CpuTimeMeter::NAME,
    usage: "cpu-time[=WATTS_PER_CORE]",
    expected: WATTS,
    open: |_, wanted| open(wanted),
};

fn open(wanted: Wanted) -> Opened {
    let meter = match wanted {
        Wanted::Usual => CpuTimeMeter::default(),
        Wanted::Named(text) => {
            let watts = text.parse().map_err(|_| WATTS.to_owned());
            let meter = watts.and_then(|watts| CpuTimeMeter::with_watts_per_core(Watts(watts)));
            meter.map_err(|expected| OpenMeterError::Parameter {
                meter: CpuTimeMeter::NAME.to_owned(),
                parameter: text.to_owned(),
                expected,
            })?
        }
        Wanted::For(adapter) => {
            let reason = match adapter.kind {
                AdapterKind::Software => return Ok(Box::new(CpuTimeMeter::default())),
                AdapterKind::Hardware => "the adapter is a GPU, which CPU time does not cover",
                AdapterKind::Unknown => {
                    "the adapter is not known to render on the CPU; request this meter by name"
                }
            };
            return Err(MeterError::unavailable(CpuTimeMeter::NAME, reason).into());
        }
    };
    Ok(Box::new(meter))
}

/// Modelled meter: CPU time of this process × watts per busy core.
///
/// Covers all threads of this process, in user and system mode, and nothing else. A reading takes
/// less than a microsecond. Available on Unix systems; elsewhere readings fail with
/// [`MeterError::Unavailable`].
#[derive(Clone, Debug, PartialEq)]
pub struct CpuTimeMeter {
    watts_per_core: Watts,
}

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
    /// In words, when `watts_per_core` is not finite or not above 0.
    pub fn with_watts_per_core(watts_per_core: Watts) -> Result<Self, String> {
        if watts_per_core.0.is_finite() && watts_per_core.0 > 0.0 {
            Ok(Self { watts_per_core })
        } else {
            Err(format!("watts per core must be finite and above 0, not {}", watts_per_core.0))
        }
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
#[cfg(unix)]
fn process_cpu_seconds() -> Result<f64, MeterError> {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    Ok(time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9)
}

#[cfg(not(unix))]
fn process_cpu_seconds() -> Result<f64, MeterError> {
    Err(MeterError::unavailable(
        CpuTimeMeter::NAME,
        "this platform has no supported process CPU clock",
    ))
}

#[cfg(test)]
#[cfg(unix)]
mod tests {
    use std::hint::black_box;
    use std::time::{Duration, Instant};

    use super::*;

    #[test]
    fn rejects_invalid_constants() {
        for watts in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(CpuTimeMeter::with_watts_per_core(Watts(watts)).is_err(), "{watts}");
        }
        assert_eq!(
            CpuTimeMeter::with_watts_per_core(Watts(5.0)).unwrap().watts_per_core,
            Watts(5.0)
        );
    }

    #[test]
    fn energy_of_one_busy_thread_is_its_time_times_the_constant() {
        let mut meter = CpuTimeMeter::with_watts_per_core(Watts(10.0)).unwrap();
        let start = meter.energy().unwrap();
        let begin = Instant::now();
        let mut value = 1.0_f64;
        while begin.elapsed() < Duration::from_millis(100) {
            value = black_box(value * 1.000_001 + 1e-9).fract() + 1.0;
        }
        let spent = meter.energy().unwrap() - start;
        // Other tests run in this process at the same time, so only the lower bound is exact; on a
        // busy machine this thread may get as little as a tenth of a core.
        assert!(spent.0 > 0.1, "{spent}");
        // At most every core of the machine, for as long as a busy machine may stretch the load.
        assert!(spent.0 < 10.0 * 1024.0, "{spent}");
    }

    #[test]
    fn reports_its_provenance() {
        let info = CpuTimeMeter::default().info();
        assert_eq!(info.provenance, Provenance::Modelled);
        assert!(info.description.contains("× 3.5 W per busy core"), "{}", info.description);
    }
}
