//! A meter with scripted readings, for tests of code that reads meters, here and in apps.

use std::collections::VecDeque;

use crate::power::{MeterError, MeterInfo, PowerMeter, Provenance};
use crate::units::Joules;

/// Returns a list of readings, one per call, then repeats the last one for ever.
#[derive(Clone, Debug)]
pub(crate) struct ScriptedMeter {
    readings: VecDeque<Result<Joules, MeterError>>,
    last: Result<Joules, MeterError>,
    window_seconds: f64,
}

impl ScriptedMeter {
    /// Name in its [`MeterInfo`].
    pub(crate) const NAME: &str = "scripted";

    /// Returns `readings`, which may include errors and invalid numbers. Without readings it
    /// returns [`MeterError::Unavailable`].
    pub(crate) fn new(readings: impl IntoIterator<Item = Result<Joules, MeterError>>) -> Self {
        Self {
            readings: readings.into_iter().collect(),
            last: Err(MeterError::unavailable(Self::NAME, "the script is empty")),
            window_seconds: 1e-3,
        }
    }

    /// Returns `joules`, cumulative energy in joules. Any number is accepted.
    pub(crate) fn joules(joules: impl IntoIterator<Item = f64>) -> Self {
        Self::new(joules.into_iter().map(|joules| Ok(Joules(joules))))
    }

    /// Sets [`window_seconds`](PowerMeter::window_seconds), in seconds. Any number is accepted.
    /// Default: 0.001.
    #[must_use]
    pub(crate) fn with_window_seconds(mut self, seconds: f64) -> Self {
        self.window_seconds = seconds;
        self
    }
}

impl PowerMeter for ScriptedMeter {
    fn info(&self) -> MeterInfo {
        MeterInfo {
            name: Self::NAME.to_owned(),
            provenance: Provenance::Modelled,
            description: "scripted readings, for tests".to_owned(),
        }
    }

    fn energy(&mut self) -> Result<Joules, MeterError> {
        if let Some(next) = self.readings.pop_front() {
            self.last = next;
        }
        self.last.clone()
    }

    fn window_seconds(&self) -> f64 {
        self.window_seconds
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn repeats_the_last_reading() {
        let mut meter = ScriptedMeter::joules([1.0, 2.0]);
        let played: Vec<_> = (0..4).map(|_| meter.energy().unwrap().0).collect();
        assert_eq!(played, [1.0, 2.0, 2.0, 2.0]);
    }

    #[test]
    fn an_empty_script_is_no_reading() {
        assert!(matches!(ScriptedMeter::joules([]).energy(), Err(MeterError::Unavailable { .. })));
    }
}
