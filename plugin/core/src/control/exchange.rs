//! Learns what a predicted watt is in another quantity: seconds of a frame, watts of a battery.
//!
//! The map holds power only, so what a limit of another quantity allows is learnt while the app
//! runs, by the recursion that corrects power: reading × scale = gain × predicted + offset.

use super::{PowerCorrection, PowerModel};
use crate::units::Watts;

/// From a map's watts, summed over all controlled cameras, to another quantity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exchange {
    /// Scaled readings per predicted watt, and their offset.
    pub correction: PowerCorrection,
    /// Factor on readings: the first one's predicted watts.
    pub scale: f64,
}

impl Exchange {
    /// The predicted power at which the quantity is `limit`, in the map's watts; at least 0.
    pub(super) fn predicted(&self, limit: f64) -> Watts {
        self.correction.uncorrected(Watts(limit * self.scale))
    }

    /// The quantity at a predicted power.
    pub(super) fn quantity(&self, predicted: Watts) -> f64 {
        self.correction.corrected(predicted).0 / self.scale
    }
}

/// Readings of shorter intervals are averaged, seconds: single frames are noisy.
const INTERVAL_SECONDS: f64 = 0.25;

/// The recursion for one quantity.
#[derive(Clone, Debug, Default)]
pub(super) struct ExchangeModel {
    model: PowerModel,
    /// Factor on readings, so that gain and offset begin near those of power.
    scale: Option<f64>,
    /// Of the last frame; `None` where there was none.
    predicted: Option<f64>,
    /// Sum of readings times seconds, and seconds.
    pending: (f64, f64),
}

impl ExchangeModel {
    /// Adds a frame of `delta_seconds` with the predicted power of all cameras' settings, without
    /// correction. Invalid numbers are ignored.
    pub(super) fn predict(&mut self, predicted: Watts, delta_seconds: f64) {
        self.predicted = Some(predicted.0);
        self.model.predict(predicted, delta_seconds);
    }

    /// Forgets predictions and readings on their way, for frames without a prediction.
    pub(super) fn pause(&mut self) {
        (self.predicted, self.pending) = (None, (0.0, 0.0));
        self.model.pause();
    }

    /// Adds a reading: the mean over the last `seconds`. Ignored unless both are finite and above
    /// 0, and a power was predicted.
    pub(super) fn read(&mut self, value: f64, seconds: f64) {
        let is_valid = |number: f64| number.is_finite() && number > 0.0;
        let Some(predicted) = self.predicted else { return };
        if !(is_valid(value) && is_valid(seconds)) {
            return;
        }
        self.pending = (self.pending.0 + value * seconds, self.pending.1 + seconds);
        let (sum, seconds) = self.pending;
        // A rounding error must not delay a reading by a frame.
        if seconds < INTERVAL_SECONDS - 1e-9 {
            return;
        }
        self.pending = (0.0, 0.0);
        let mean = sum / seconds;
        let scale = *self.scale.get_or_insert_with(|| predicted.max(1e-3) / mean);
        self.model.read(Watts(mean * scale), seconds);
    }

    /// The quantity at the last predicted power; `None` while one of them is unknown.
    pub(super) fn quantity(&self) -> Option<f64> {
        Some(self.exchange()?.quantity(Watts(self.predicted?)))
    }

    /// What was learnt; `None` before the first reading.
    pub(super) fn exchange(&self) -> Option<Exchange> {
        let scale = self.scale.filter(|scale| scale.is_finite())?;
        let correction = self.model.correction();
        (self.model.readings() > 0).then_some(Exchange { correction, scale })
    }
}
