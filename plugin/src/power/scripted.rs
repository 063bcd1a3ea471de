//! A meter that says what it is told to: for tests of everything that reads meters, here and in
//! apps.

use std::collections::VecDeque;

use crate::power::{MeterError, MeterInfo, PowerMeter, Provenance};
use crate::units::{Joules, Watts};

/// Plays a list of readings, one a call, then repeats the last one for ever.
#[derive(Clone, Debug)]
pub struct ScriptedMeter {
    readings: VecDeque<Result<Joules, MeterError>>,
    last: Result<Joules, MeterError>,
    window_seconds: f64,
    idle: Watts,
}

impl ScriptedMeter {
    /// The name under which it reports.
    pub const NAME: &str = "scripted";

    /// Plays `readings`, which may be errors and numbers that no meter should give. `Unavailable`
    /// where there are none at all.
    pub fn new(readings: impl IntoIterator<Item = Result<Joules, MeterError>>) -> Self {
        Self {
            readings: readings.into_iter().collect(),
            last: Err(MeterError::unavailable(Self::NAME, "the script is empty")),
            window_seconds: 1e-3,
            idle: Watts(0.0),
        }
    }

    /// Plays `joules`.
    pub fn joules(joules: impl IntoIterator<Item = f64>) -> Self {
        Self::new(joules.into_iter().map(|joules| Ok(Joules(joules))))
    }

    /// Claims another shortest window, in seconds. The default is 0.001.
    #[must_use]
    pub fn with_window_seconds(mut self, seconds: f64) -> Self {
        self.window_seconds = seconds;
        self
    }

    /// Claims power that its energy does not contain. The default is 0 W.
    #[must_use]
    pub fn with_idle(mut self, idle: Watts) -> Self {
        self.idle = idle;
        self
    }
}

impl PowerMeter for ScriptedMeter {
    fn info(&self) -> MeterInfo {
        MeterInfo {
            name: Self::NAME.to_owned(),
            provenance: Provenance::Modelled,
            description: "readings written down beforehand, for tests".to_owned(),
        }
    }

    fn energy(&mut self) -> Result<Joules, MeterError> {
        if let Some(next) = self.readings.pop_front() {
            self.last = next;
        }
        self.last.clone()
    }

    fn idle(&self) -> Watts {
        self.idle
    }

    fn window_seconds(&self) -> f64 {
        self.window_seconds
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn repeats_the_last_line() {
        let mut meter = ScriptedMeter::joules([1.0, 2.0]);
        let played: Vec<_> = (0..4).map(|_| meter.energy().unwrap().0).collect();
        assert_eq!(played, [1.0, 2.0, 2.0, 2.0]);
    }

    #[test]
    fn an_empty_script_is_no_reading() {
        assert!(matches!(ScriptedMeter::joules([]).energy(), Err(MeterError::Unavailable { .. })));
    }
}
