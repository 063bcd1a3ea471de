//! Signals of the app and its device, for limits that are not in watts.
//!
//! The map holds power only, so what a limit of another quantity allows is learnt while the app
//! runs, by the recursion that corrects power: reading × scale = gain × predicted + offset. The last
//! value of a signal stands in for missing ones for some seconds, then the most cautious one.

use super::{PowerCorrection, PowerModel};
use crate::units::{Joules, Watts};

/// Shortest time over which the fall of the battery's energy is its power, seconds: drivers count
/// in steps of some joules.
const DRAIN_SECONDS: f64 = 20.0;
/// Longest interval of one reading of a battery's power, seconds.
const MAX_READING_SECONDS: f64 = 5.0;
/// Largest power of a battery, watts, and as a multiple of what it gave before: the first larger fall
/// of its energy has another cause, such as a machine that slept.
const MAX_DRAIN_WATTS: f64 = 500.0;
const MAX_DRAIN_RATIO: f64 = 3.0;
/// How long a figure stands in for a missing one, seconds.
const HOLD_SECONDS: f64 = 10.0;
/// Longest part of a frame that counts towards it, seconds: after a sleep signals come anew.
const MAX_MISSING_SECONDS: f64 = 0.25;

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
}

/// Readings of shorter intervals are averaged, seconds: single frames are noisy.
const INTERVAL_SECONDS: f64 = 0.25;
/// Factors, either way, between two readings, and between the powers that were predicted for them, from which
/// and up to which they are not of one scene: no settings make the difference.
const OTHER_SCENE: f64 = 3.0;
const SAME_POWER: f64 = 1.25;

/// The recursion for one quantity.
#[derive(Clone, Debug, Default)]
struct ExchangeModel {
    model: PowerModel,
    /// Factor on readings, so that gain and offset begin near those of power.
    scale: Option<f64>,
    /// The last reading that was learnt from, and its predicted power.
    last: Option<(f64, f64)>,
    /// Whether a reading since was of another scene.
    is_other: bool,
    /// Of the last frame; `None` where there was none.
    predicted: Option<f64>,
    /// Sum of readings times seconds, and seconds.
    pending: (f64, f64),
}

impl ExchangeModel {
    /// Adds a frame of `delta_seconds` with the predicted power of all cameras' settings, without
    /// correction. Invalid numbers are ignored.
    fn predict(&mut self, predicted: Watts, delta_seconds: f64) {
        self.predicted = Some(predicted.0);
        self.model.predict(predicted, delta_seconds);
    }

    /// Forgets predictions and readings on their way, for frames without a prediction.
    fn pause(&mut self) {
        (self.predicted, self.pending) = (None, (0.0, 0.0));
        self.model.pause();
    }

    /// Adds a reading: the mean over the last `seconds`. Ignored unless both are finite and above
    /// 0, and a power was predicted.
    fn read(&mut self, value: f64, seconds: f64) {
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
        let differs = |ratio: f64, most: f64| !(most.recip()..=most).contains(&ratio);
        let is_other = self.last.is_some_and(|(last, watts)| {
            differs(mean / last, OTHER_SCENE) && !differs(predicted / watts, SAME_POWER)
        });
        if is_other && !self.is_other {
            // It may be a single frame.
            self.is_other = true;
            return;
        }
        if is_other {
            // The app has loaded, or its scene has appeared: the scale is that of what was before.
            (self.model, self.scale) = (PowerModel::default(), None);
            self.model.predict(Watts(predicted), seconds);
        }
        (self.is_other, self.last) = (false, Some((mean, predicted)));
        let scale = *self.scale.get_or_insert_with(|| predicted.max(1e-3) / mean);
        // Two are of another scene.
        for _ in 0..=u32::from(is_other) {
            self.model.read(Watts(mean * scale), seconds);
        }
    }

    /// The quantity at the last predicted power; `None` while one of them is unknown.
    fn quantity(&self) -> Option<f64> {
        let Exchange { correction, scale } = self.exchange()?;
        Some(correction.corrected(Watts(self.predicted?)).0 / scale)
    }

    /// What was learnt; `None` before the first reading.
    fn exchange(&self) -> Option<Exchange> {
        let scale = self.scale.filter(|scale| scale.is_finite())?;
        let correction = self.model.correction();
        (self.model.readings() > 0).then_some(Exchange { correction, scale })
    }
}

/// What is known of the app and its device when limits are resolved; `None` is unknown.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Observed {
    /// Frames per second that watts refer to.
    pub frames_per_second: Option<f64>,
    /// Frame time in seconds, in terms of predicted power.
    pub frame_time: Option<Exchange>,
    /// Seconds since the app has started.
    pub now_seconds: f64,
    /// Energy left in the battery.
    pub battery: Option<Joules>,
    /// The battery's power in watts, in terms of predicted power. `None`: the battery feeds the
    /// cameras alone.
    pub battery_power: Option<Exchange>,
    /// Distance from throttling, 0 to 1.
    pub headroom: Option<f64>,
    /// From the map's watts to those of the app's meter, of all cameras together.
    pub correction: PowerCorrection,
    /// Number of active controlled cameras; 0 counts as 1.
    pub cameras: usize,
    /// Least and most power of the camera's settings, in the watts of the app's meter.
    pub range: Option<(Watts, Watts)>,
}

/// What one frame's signals say.
#[derive(Clone, Copy, Debug, Default)]
pub struct FrameSignals {
    /// Predicted power of all cameras' applied settings, without correction; `None` while unknown.
    pub predicted: Option<Watts>,
    /// Whether the app renders continuously: a device that waits for its app says nothing about the
    /// settings' power.
    pub is_playing: bool,
    /// Real time of the frame, seconds.
    pub delta_seconds: f64,
    /// Real time since the app's start, seconds.
    pub now_seconds: f64,
    /// Time of the frame's work, seconds.
    pub frame_seconds: Option<f64>,
    /// Energy left in the battery: `None` is unknown, and infinity a machine that its battery does
    /// not feed.
    pub battery: Option<Joules>,
    /// Power of the battery; `None`: by the fall of its energy.
    pub battery_power: Option<Watts>,
    /// Whether the battery's figures are new in this frame.
    pub is_battery_new: bool,
    /// Distance from throttling, 0 to 1.
    pub headroom: Option<f64>,
}

/// A headroom that stands in for missing ones.
#[derive(Clone, Copy, Debug, Default)]
struct Headroom {
    latest: Option<f64>,
    missing_seconds: f64,
}

impl Headroom {
    /// Adds this frame's figure. Returns it, or the last one, or 0 once that is too old; `None` if there
    /// never was one.
    fn step(&mut self, figure: Option<f64>, delta_seconds: f64) -> Option<f64> {
        match figure {
            Some(_) => (self.latest, self.missing_seconds) = (figure, 0.0),
            None => self.missing_seconds += delta_seconds.clamp(0.0, MAX_MISSING_SECONDS),
        }
        // Not `<=`, so that NaN counts as too old.
        let is_recent = self.missing_seconds < HOLD_SECONDS;
        self.latest.map(|latest| if is_recent { latest } else { 0.0 })
    }
}

/// Learns from signals. Has no clock.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "bevy", derive(bevy_ecs::resource::Resource))]
pub struct SignalModel {
    frame_time: ExchangeModel,
    battery: Battery,
    headroom: Headroom,
    observed: Observed,
}

impl SignalModel {
    /// What is known now. Correction, cameras, frame rate and range are the caller's.
    pub fn observed(&self) -> Observed {
        self.observed
    }

    /// Adds a frame.
    pub fn step(&mut self, frame: &FrameSignals) {
        match frame.predicted {
            Some(predicted) => self.frame_time.predict(predicted, frame.delta_seconds),
            None => self.frame_time.pause(),
        }
        if let Some(seconds) = frame.frame_seconds {
            self.frame_time.read(seconds, frame.delta_seconds);
        }
        let battery = self.battery.step(frame);
        self.observed = Observed {
            // A single reading may be one of an app that loads.
            frame_time: self.frame_time.exchange().filter(|_| self.frame_time.model.readings() > 1),
            now_seconds: frame.now_seconds,
            battery,
            battery_power: self.battery.drain.exchange(),
            headroom: self.headroom.step(frame.headroom, frame.delta_seconds),
            ..Observed::default()
        };
    }
}

/// The battery's energy between its readings, and its power in terms of predicted power.
#[derive(Clone, Debug, Default)]
struct Battery {
    drain: ExchangeModel,
    /// Energy at the last reading, less what was drawn since.
    left: Option<Joules>,
    /// How long the battery has not fed the machine, seconds.
    fed_seconds: f64,
    /// Power at the last reading.
    power: Option<Watts>,
    /// Energy and time at the start of the interval in which its fall is watched.
    since: Option<(Joules, f64)>,
    /// Whether the last fall was too large to be believed at once.
    is_sudden: bool,
    /// Time of the last reading.
    read_at: Option<f64>,
}

impl Battery {
    /// Adds a frame; returns the energy that is left. `None`: no battery feeds the machine.
    fn step(&mut self, frame: &FrameSignals) -> Option<Joules> {
        let predicted = frame.predicted.filter(|_| frame.is_playing);
        match predicted {
            Some(predicted) => self.drain.predict(predicted, frame.delta_seconds),
            None => {
                self.drain.pause();
                (self.since, self.read_at) = (None, None);
            }
        }
        let is_fed = frame.battery.is_some_and(|energy| energy.0 == f64::INFINITY);
        self.fed_seconds = if is_fed {
            self.fed_seconds + frame.delta_seconds.clamp(0.0, MAX_MISSING_SECONDS)
        } else {
            0.0
        };
        match frame.battery.filter(|_| frame.is_battery_new && !is_fed) {
            Some(energy) => {
                self.left = Some(energy);
                self.power = frame.battery_power;
                if predicted.is_some() {
                    self.read(energy, frame);
                }
            }
            // Between readings, and while there are none, it is drawn from.
            None => {
                let power = self.drain.quantity().or(self.power.map(|power| power.0));
                let drawn = power.unwrap_or(0.0) * frame.delta_seconds.clamp(0.0, HOLD_SECONDS);
                self.left = self.left.map(|left| Joules((left.0 - drawn).max(0.0)));
            }
        }
        if is_fed {
            (self.since, self.read_at) = (None, None);
            if self.fed_seconds >= HOLD_SECONDS {
                (self.left, self.power) = (None, None);
            }
        }
        self.left
    }

    /// Learns the power from a reading in a frame with a prediction.
    fn read(&mut self, energy: Joules, frame: &FrameSignals) {
        let now = frame.now_seconds;
        if let Some(power) = frame.battery_power {
            let seconds = self.read_at.map_or(frame.delta_seconds, |before| now - before);
            self.drain.read(power.0, seconds.min(MAX_READING_SECONDS));
            (self.since, self.read_at) = (None, Some(now));
            return;
        }
        self.read_at = None;
        match self.since {
            Some((before, since)) if energy <= before && now >= since => {
                let elapsed = now - since;
                if elapsed >= DRAIN_SECONDS && energy < before {
                    let watts = (before - energy).per_seconds(elapsed);
                    let most = self.drain.quantity().map_or(f64::MAX, |it| MAX_DRAIN_RATIO * it);
                    let is_sudden = watts.0 > most && !self.is_sudden;
                    if !is_sudden && watts.0 <= MAX_DRAIN_WATTS {
                        self.drain.read(watts.0, elapsed.min(MAX_READING_SECONDS));
                    }
                    self.is_sudden = is_sudden;
                    self.since = Some((energy, now));
                }
            }
            // Charged meanwhile, or the start.
            _ => self.since = Some((energy, now)),
        }
    }
}

#[cfg(test)]
#[path = "observed_tests.rs"]
mod tests;
