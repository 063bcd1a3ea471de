//! A meter for tests.

use std::time::Instant;

use crate::power::{MeterError, PowerMeter};
use crate::power::{MeterInfo, Provenance};
use crate::units::Joules;

/// A device of a constant power whose counter has a new value every `step_seconds`, and reads
/// `glitch` joules more in the second half of each second.
pub(crate) struct Steps {
    pub origin: Instant,
    pub watts: f64,
    pub step_seconds: f64,
    pub glitch: f64,
}

impl Steps {
    /// A device of `watts` with steps of 0.1 s.
    pub(crate) fn new(watts: f64) -> Self {
        Self { origin: Instant::now(), watts, step_seconds: 0.1, glitch: 0.0 }
    }
}

impl PowerMeter for Steps {
    fn info(&self) -> MeterInfo {
        MeterInfo {
            name: "steps".to_owned(),
            provenance: Provenance::Measured,
            description: String::new(),
        }
    }

    fn energy(&mut self) -> Result<Joules, MeterError> {
        let seconds = self.origin.elapsed().as_secs_f64();
        let steps = (seconds / self.step_seconds).floor();
        let glitch = if seconds.fract() > 0.5 { self.glitch } else { 0.0 };
        Ok(Joules(steps * self.step_seconds * self.watts + glitch))
    }

    fn window_seconds(&self) -> f64 {
        1.0
    }
}
