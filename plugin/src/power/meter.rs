//! The power meter contract: cumulative energy with its provenance. And a kind of meter: how it is
//! named and opened.

use std::time::Duration;

pub use frugal_core::power::{MeterInfo, Provenance};

use crate::power::Adapter;
use crate::power::root::SysRoot;
use crate::units::{Joules, Watts};

/// Why a meter gives no reading. An unknown power is always an error, never 0 W.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum MeterError {
    /// The device, driver or counter is missing.
    #[error("{meter}: not available: {reason}")]
    Unavailable {
        /// Name of the meter.
        meter: String,
        /// Why.
        reason: String,
    },
    /// The counter exists but cannot be read.
    #[error("{meter}: cannot be read: {reason}")]
    Unreadable {
        /// Name of the meter.
        meter: String,
        /// Why.
        reason: String,
    },
    /// The counter can be read but does not behave like an energy counter.
    #[error("{meter}: broken: {reason}")]
    Broken {
        /// Name of the meter.
        meter: String,
        /// The observed fault.
        reason: String,
    },
}

impl MeterError {
    /// [`Unavailable`](Self::Unavailable): the device, driver or counter is missing. Name the
    /// remedy in `reason` where there is one.
    pub fn unavailable(meter: impl Into<String>, reason: impl Into<String>) -> Self {
        Self::Unavailable { meter: meter.into(), reason: reason.into() }
    }

    /// [`Unreadable`](Self::Unreadable): the counter exists but cannot be read.
    pub fn unreadable(meter: impl Into<String>, reason: impl Into<String>) -> Self {
        Self::Unreadable { meter: meter.into(), reason: reason.into() }
    }

    /// [`Broken`](Self::Broken): the counter can be read but does not behave like an energy
    /// counter.
    pub fn broken(meter: impl Into<String>, reason: impl Into<String>) -> Self {
        Self::Broken { meter: meter.into(), reason: reason.into() }
    }
}

/// What a meter tells when it is read.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Reading {
    /// Counters of energy; their sum is the device's.
    Energy(Vec<Count>),
    /// The power at this moment.
    Power {
        /// In watts; finite and above 0, anything else is a fault.
        power: Watts,
        /// A number that changes at least every two minutes while the sensor works, such as the
        /// energy left in a battery. `None`: a power that stays the same for hours is no fault.
        sign_of_life: Option<u64>,
    },
}

impl Reading {
    /// The sum of counters.
    ///
    /// # Errors
    /// [`MeterError::Unavailable`] for a power.
    pub(crate) fn energy(self, meter: &str) -> Result<Joules, MeterError> {
        match self {
            Self::Energy(counts) => {
                Ok(counts.iter().fold(Joules(0.0), |sum, count| sum + count.energy))
            }
            Self::Power { .. } => {
                let reason = "it tells a power and no energy: sample it by a PowerSampler";
                Err(MeterError::unavailable(meter, reason))
            }
        }
    }
}

/// The value of a counter of energy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Count {
    /// Energy since an arbitrary fixed moment, in joules.
    pub energy: Joules,
    /// Energy at which the counter starts again from 0, in joules, above 0; `None`: never.
    pub range: Option<Joules>,
}

/// A source of energy or power. It returns raw readings; the sampler judges them, in the same way
/// for every meter.
pub trait PowerMeter: Send {
    /// Name, provenance and coverage. The same for the same device after a restart of the machine.
    fn info(&self) -> MeterInfo;

    /// Energy since an arbitrary fixed moment, in joules, monotonically increasing but for the
    /// wraps and faults of its counters. Only differences of two readings are meaningful.
    ///
    /// # Errors
    /// [`MeterError`] when there is no reading, or the meter tells a power.
    fn energy(&mut self) -> Result<Joules, MeterError>;

    /// The meter's reading as it is. By default the counter of [`energy`](Self::energy).
    ///
    /// # Errors
    /// [`MeterError`] when there is no reading. Its reason must not change while the fault lasts:
    /// each new reason is a new warning.
    fn read(&mut self) -> Result<Reading, MeterError> {
        Ok(Reading::Energy(vec![Count { energy: self.energy()?, range: None }]))
    }

    /// The shortest window, in seconds, over which a mean power is meaningful: some of the
    /// counter's updates. Callers clamp it to 0 to 60 s; NaN counts as 1 s.
    fn window_seconds(&self) -> f64;

    /// The longest time between two readings, in seconds, above 0: a power is read more often than
    /// its window is long. By default infinity: once in a window.
    fn poll_seconds(&self) -> f64 {
        f64::INFINITY
    }
}

/// The shortest valid window of `meter`: its [`window_seconds`](PowerMeter::window_seconds),
/// clamped to 0 s to 60 s, and 1 s for NaN.
pub(crate) fn least_window(meter: &dyn PowerMeter) -> Duration {
    let seconds = meter.window_seconds();
    Duration::from_secs_f64(if seconds.is_nan() { 1.0 } else { seconds.clamp(0.0, 60.0) })
}

/// Faults that were said, by their texts without numbers, with the time when each was there last.
#[derive(Debug, Default)]
pub(crate) struct SaidFaults(Vec<(String, Duration)>);

impl SaidFaults {
    /// A fault is said again after it was gone for this long.
    const SILENCE: Duration = Duration::from_secs(600);
    /// As many different faults are remembered.
    const MAX: usize = 16;

    /// Whether a fault that is there at a time is to be said.
    pub(crate) fn is_new(&mut self, reason: &str, now: Duration) -> bool {
        let is_of_number = |c: &char| c.is_ascii_digit() || ['.', '-'].contains(c);
        let text: String = reason.chars().filter(|c| !is_of_number(c)).collect();
        self.0.retain(|(_, at)| now.saturating_sub(*at) < Self::SILENCE);
        if let Some((_, at)) = self.0.iter_mut().find(|(said, _)| *said == text) {
            *at = now;
            return false;
        }
        if self.0.len() == Self::MAX {
            self.0.remove(0);
        }
        self.0.push((text, now));
        true
    }
}

/// Why no meter was opened.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum OpenMeterError {
    /// No meter has this name.
    #[error("there is no power meter called \"{name}\"; known: {}", known.join(", "))]
    UnknownName {
        /// The requested name.
        name: String,
        /// Syntax of each meter's argument to [`open`](crate::power::open).
        known: Vec<&'static str>,
    },
    /// The part after `=` is invalid for this meter.
    #[error("{meter}: \"{parameter}\" is not a valid parameter: {expected}")]
    Parameter {
        /// Name of the meter.
        meter: String,
        /// The text after `=`.
        parameter: String,
        /// The valid parameters, in words.
        expected: String,
    },
    /// The meter is known but gives no reading on this machine.
    #[error(transparent)]
    Meter(#[from] MeterError),
    /// No meter covers the rendering device.
    #[error("no power meter for this adapter: {}", reasons.join("; "))]
    NoneSuits {
        /// One reason per meter, in the order tried.
        reasons: Vec<String>,
    },
}

/// A meter that was opened.
pub(crate) type Opened = Result<Box<dyn PowerMeter>, OpenMeterError>;

/// Which device a meter shall be of.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Wanted<'a> {
    /// The only one, or the usual one.
    Usual,
    /// The one that the text after `=` names.
    Named(&'a str),
    /// The one that renders. An error says why none covers it.
    For(&'a Adapter),
}

/// A kind of meter.
pub(crate) struct MeterKind {
    /// Name, as [`open`](crate::power::open) accepts it.
    pub name: &'static str,
    /// Syntax of its argument to [`open`](crate::power::open).
    pub usage: &'static str,
    /// What the text after `=` is, in words.
    pub expected: &'static str,
    /// Opens it.
    pub open: fn(&SysRoot, Wanted) -> Opened,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fault_is_said_once_however_long_it_lasts_or_flaps() {
        let mut said = SaidFaults::default();
        let mut warnings = 0;
        // An hour of four polls a second: a reason with numbers, one that comes and goes, a third.
        for quarter in 0..14_400_u64 {
            let now = Duration::from_millis(250 * quarter);
            let reason = match quarter % 3 {
                0 => format!("rapl: broken: the counter did not move in {quarter} s"),
                1 if quarter % 200 < 100 => "amdgpu: the GPU sleeps".to_owned(),
                _ => continue,
            };
            warnings += usize::from(said.is_new(&reason, now));
        }
        assert_eq!(warnings, 2);
        let later = Duration::from_secs(3600 + 700);
        assert!(said.is_new("amdgpu: the GPU sleeps", later), "it was gone for ten minutes");
        for fault in 'a'..='z' {
            assert!(said.is_new(&fault.to_string(), later));
        }
        assert!(said.0.len() <= SaidFaults::MAX);
    }
}
