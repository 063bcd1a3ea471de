//! A square wave and its integral.

/// Why there is no such light or camera.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CodedError {
    /// A quantity is out of range.
    #[error("{what} is {value}; it must be {range}")]
    OutOfRange {
        /// The quantity.
        what: &'static str,
        /// Its value.
        value: f64,
        /// Its valid range, in words.
        range: &'static str,
    },
    /// Images or profiles do not belong together.
    #[error("{what}: {given} do not fit {expected}")]
    Size {
        /// What does not fit.
        what: &'static str,
        /// What was given.
        given: usize,
        /// What would fit.
        expected: usize,
    },
}

/// Whether `value` is finite and above 0.
pub(super) fn positive(what: &'static str, value: f64) -> Result<(), CodedError> {
    let range = "finite and above 0";
    if value.is_finite() && value > 0.0 { Ok(()) } else { out_of(what, value, range) }
}

pub(super) fn out_of<T>(
    what: &'static str,
    value: f64,
    range: &'static str,
) -> Result<T, CodedError> {
    Err(CodedError::OutOfRange { what, value, range })
}

/// Light over time.
pub trait Modulation {
    /// Integral of the light from `start`, seconds, over `duration`, seconds and at least 0.
    fn light(&self, start: f64, duration: f64) -> f64;

    /// Mean light over all time.
    fn mean(&self) -> f64;
}

/// A light that is keyed on and off: on at `peak` for the share `duty` of each period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Waveform {
    frequency: f64,
    duty: f64,
    phase: f64,
    peak: f64,
}

impl Waveform {
    /// `frequency` in hertz, above 0; `duty` in [0, 1]; `phase` in periods, any number: at time 0
    /// the light is that far in its period, which begins with light; `peak` of any unit, at least 0.
    ///
    /// # Errors
    /// [`CodedError::OutOfRange`] when one is out of range or not finite.
    pub fn new(frequency: f64, duty: f64, phase: f64, peak: f64) -> Result<Self, CodedError> {
        positive("the frequency", frequency)?;
        if !(0.0..=1.0).contains(&duty) {
            return out_of("the duty cycle", duty, "in [0, 1]");
        }
        if !phase.is_finite() {
            return out_of("the phase", phase, "finite");
        }
        if !(peak.is_finite() && peak >= 0.0) {
            return out_of("the peak", peak, "finite and at least 0");
        }
        Ok(Self { frequency, duty, phase, peak })
    }

    /// Hertz.
    pub fn frequency(&self) -> f64 {
        self.frequency
    }

    /// Share of time with light.
    pub fn duty(&self) -> f64 {
        self.duty
    }

    /// Light while it is on.
    pub fn peak(&self) -> f64 {
        self.peak
    }
}

impl Modulation for Waveform {
    /// The integral of a square wave in closed form.
    fn light(&self, start: f64, duration: f64) -> f64 {
        // Periods with light until a point of time: whole ones count their duty.
        let until =
            |periods: f64| periods.floor() * self.duty + (periods - periods.floor()).min(self.duty);
        // From within the first period, so that late starts lose no digits.
        let from = (start * self.frequency + self.phase).rem_euclid(1.0);
        let periods = until(from + duration.max(0.0) * self.frequency) - until(from);
        self.peak * periods / self.frequency
    }

    fn mean(&self) -> f64 {
        self.peak * self.duty
    }
}
