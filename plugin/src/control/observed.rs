//! Signals of the app and its device for limits in other currencies than watts, frame by frame.

use bevy::ecs::change_detection::DetectChanges;
use bevy::ecs::resource::Resource;
use bevy::ecs::system::{Query, Res, ResMut};
use bevy::time::{Real, Time};

use super::Budget;
use super::clock::{ControlClock, PowerFeedback};
use super::exchange::ExchangeModel;
use super::limits::Observed;
use super::systems::CameraState;
use crate::signals::{BatteryLevel, FrameTime, ThermalHeadroom};
use crate::units::{Joules, Watts};

/// Shortest time over which the fall of the battery's energy is its power, seconds: drivers count
/// in steps of some joules.
const DRAIN_SECONDS: f64 = 20.0;
/// Longest interval of one reading of a battery's power, seconds.
const MAX_READING_SECONDS: f64 = 5.0;

/// What one frame's signals say.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct FrameSignals {
    /// Predicted power of all cameras' applied settings, without correction; `None` while unknown.
    pub(super) predicted: Option<Watts>,
    /// Real time of the frame, and since the app's start, seconds.
    pub(super) delta_seconds: f64,
    /// Real time since the app's start, seconds.
    pub(super) now_seconds: f64,
    /// Time of the frame's work, seconds.
    pub(super) frame_seconds: Option<f64>,
    /// Energy left in the battery.
    pub(super) battery: Option<Joules>,
    /// Power of the battery; `None`: by the fall of its energy.
    pub(super) battery_power: Option<Watts>,
    /// Whether the battery's figures are new in this frame.
    pub(super) is_battery_new: bool,
    /// Distance from throttling, 0 to 1.
    pub(super) headroom: Option<f64>,
}

/// Learns from signals. Has no clock.
#[derive(Resource, Clone, Debug, Default)]
pub(super) struct SignalModel {
    frame_time: ExchangeModel,
    drain: ExchangeModel,
    /// Energy and time at the start of the interval in which its fall is watched.
    since: Option<(Joules, f64)>,
    /// Time of the last reading of the battery.
    read_at: Option<f64>,
    observed: Observed,
}

impl SignalModel {
    /// What is known now. Correction, cameras, frame rate and range are the caller's.
    pub(super) fn observed(&self) -> Observed {
        self.observed
    }

    /// Adds a frame.
    pub(super) fn step(&mut self, frame: &FrameSignals) {
        match frame.predicted {
            Some(predicted) => {
                self.frame_time.predict(predicted, frame.delta_seconds);
                self.drain.predict(predicted, frame.delta_seconds);
            }
            None => {
                self.frame_time.pause();
                self.drain.pause();
            }
        }
        if let Some(seconds) = frame.frame_seconds.filter(|_| frame.predicted.is_some()) {
            self.frame_time.read(seconds, frame.delta_seconds);
        }
        if frame.is_battery_new {
            self.read_battery(frame);
        }
        self.observed = Observed {
            frame_time: self.frame_time.exchange(),
            now_seconds: frame.now_seconds,
            battery: frame.battery,
            battery_power: self.drain.exchange(),
            headroom: frame.headroom,
            ..Observed::default()
        };
    }

    fn read_battery(&mut self, frame: &FrameSignals) {
        let now = frame.now_seconds;
        let Some(energy) = frame.battery else {
            (self.since, self.read_at) = (None, None);
            return;
        };
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
                    self.drain.read(watts.0, elapsed.min(MAX_READING_SECONDS));
                    self.since = Some((energy, now));
                }
            }
            // Charged meanwhile, or the start.
            _ => self.since = Some((energy, now)),
        }
    }
}

/// Whether a camera's budget asks for the battery.
pub(super) fn needs_battery(budgets: Query<&Budget>) -> bool {
    budgets.iter().any(|budget| budget.battery_until.is_some())
}

/// Feeds the model with this frame's signals.
pub(super) fn observe_signals(
    time: Res<Time<Real>>,
    (frame_time, battery, headroom): (Res<FrameTime>, Res<BatteryLevel>, Res<ThermalHeadroom>),
    cameras: Query<&CameraState>,
    clock: Res<ControlClock>,
    feedback: Res<PowerFeedback>,
    mut model: ResMut<SignalModel>,
) {
    let active = || cameras.iter().filter_map(CameraState::predicted);
    let count = active().count();
    let (energy, power) = battery.valid();
    model.step(&FrameSignals {
        predicted: active().sum::<Option<Watts>>().filter(|_| count > 0),
        delta_seconds: time.delta_secs_f64(),
        now_seconds: time.elapsed_secs_f64(),
        frame_seconds: frame_time.valid(time.delta_secs_f64()),
        battery: energy,
        battery_power: power,
        is_battery_new: battery.is_changed(),
        headroom: headroom.valid(),
    });
    model.observed.frames_per_second = clock.frames_per_second();
    model.observed.correction = feedback.correction;
    model.observed.cameras = count;
}

#[cfg(test)]
#[path = "observed_tests.rs"]
mod tests;
