//! Metered against predicted power, of all controlled cameras together.

use bevy::prelude::*;
use frugal_core::control::{FrameKind, FrameRate, RatedAt};

use super::{PowerCorrection, PowerModel};
use crate::power::{MeterState, MeteredPower, Provenance};
use crate::units::Watts;

/// What the controller does with the app's meter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
pub enum FeedbackState {
    /// Predictions are not corrected: feedback is disabled, there is no meter, or a modelled one
    /// that is not the map's.
    #[default]
    Off,
    /// A meter is there, and its first reading is awaited.
    Waiting,
    /// Readings correct the predictions.
    Running,
    /// The meter is lost: its last correction stays.
    Held,
}

/// Corrects predicted power by [`MeteredPower`], so that a budget in watts holds on another device
/// than the map's, and on one that throttles. Written by the controller;
/// [`ControlSettings::power_feedback`](super::ControlSettings::power_feedback) turns it off.
///
/// Power budgets then limit metered watts. The meter must cover the controlled cameras; whatever
/// else it covers should take constant power.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq)]
pub struct PowerFeedback {
    /// What the controller does with the meter.
    pub state: FeedbackState,
    /// From the maps' watts, summed over all controlled cameras, to the meter's. Scales to the
    /// app's frame rate first.
    pub correction: PowerCorrection,
    /// The same for means over tens of seconds. Limits of mean power use it.
    pub mean_correction: PowerCorrection,
    /// Standard deviation of the corrected power, watts; `None` before the first reading.
    pub deviation: Option<Watts>,
    /// Number of readings learnt from.
    pub readings: u64,
    /// Whether no correction fits the readings: the scene is no longer the map's. The controller
    /// then selects from the frontier over all views, and raises predicted power by the readings'
    /// deviation.
    pub has_left_map: bool,
    /// Number of active controlled cameras.
    pub(super) cameras: usize,
}

impl PowerFeedback {
    /// The correction of one camera's mean power.
    pub fn mean_per_camera(&self) -> PowerCorrection {
        self.mean_correction.shared_by(self.cameras)
    }

    /// The correction of one camera's power.
    pub fn per_camera(&self) -> PowerCorrection {
        self.correction.shared_by(self.cameras)
    }
}

/// What an active camera's map predicts.
#[derive(Clone, Copy, Debug)]
pub(super) struct Predicted {
    /// Power of the applied settings in the map's watts; `None` while the controller is off.
    pub(super) power: Option<Watts>,
    /// Whether the map's meter is the app's; `None` while unknown.
    pub(super) meter: Option<bool>,
    pub(super) rated_at: Option<RatedAt>,
}

/// The model, and the number of the meter's last reading.
#[derive(Resource, Default)]
pub(super) struct FeedbackModel {
    model: PowerModel,
    seen: u64,
}

impl FeedbackModel {
    /// Adds a frame of `delta_seconds`, and compares what `cameras` predicted, together `predicted`,
    /// with the meter.
    pub(super) fn observe(
        &mut self,
        cameras: impl Iterator<Item = Predicted> + Clone,
        predicted: Option<Watts>,
        delta_seconds: f64,
        metered: Option<&MeteredPower>,
        rate: &mut FrameRate,
        is_enabled: bool,
        before: &PowerFeedback,
    ) -> PowerFeedback {
        let count = cameras.clone().count();
        let at_rate = rate.correction(cameras.clone().map(|camera| camera.rated_at));
        // A device that waits for the app says nothing about its settings, and watts mean little before
        // the frame rate is known.
        let is_playing = rate.kind() == FrameKind::Usual && rate.frames_per_second().is_some();
        match predicted.filter(|_| is_playing) {
            Some(predicted) => self.model.predict(at_rate.corrected(predicted), delta_seconds),
            None => self.model.pause(),
        }
        let is_maps_meter = cameras.into_iter().all(|camera| camera.meter == Some(true));
        let trusted = metered.filter(|metered| {
            let is_measured = |info: &crate::power::MeterInfo| {
                info.provenance == Provenance::Measured || is_maps_meter
            };
            is_enabled && metered.info.as_ref().is_some_and(is_measured)
        });
        if let Some(metered) = trusted
            && metered.sample_count != self.seen
            && let (Some(watts), Some(interval)) = (metered.latest, metered.interval)
        {
            self.seen = metered.sample_count;
            self.model.read(watts, interval.as_secs_f64());
        }
        let readings = self.model.readings();
        let state = match trusted {
            None => FeedbackState::Off,
            Some(_) if readings == 0 => FeedbackState::Waiting,
            Some(metered) if metered.state == MeterState::Running => FeedbackState::Running,
            Some(_) => FeedbackState::Held,
        };
        // Without a meter, watts are those of the map's frame rate.
        let [correction, mean_correction] = match state {
            FeedbackState::Off => [PowerCorrection::default(); 2],
            _ => [self.model.correction(), self.model.mean_correction()]
                .map(|correction| correction.after(at_rate)),
        };
        let has_left_map = state == FeedbackState::Running && self.model.has_left_map();
        let residual = self.model.residual();
        if has_left_map && !before.has_left_map {
            warn!(
                "metered power is off the map's by {:.0} % from view to view: the scene has changed since the map was made. The controller selects more carefully; run `frugal precompute` again",
                100.0 * residual
            );
        }
        let margin = if has_left_map { 1.0 + (residual * 10.0).round() / 10.0 } else { 1.0 };
        let with_margin = |it: PowerCorrection| PowerCorrection {
            gain: it.gain * margin,
            offset: it.offset * margin,
        };
        PowerFeedback {
            state,
            correction: with_margin(correction),
            mean_correction: with_margin(mean_correction),
            deviation: self.model.deviation().filter(|_| state != FeedbackState::Off),
            readings,
            has_left_map,
            cameras: count,
        }
    }
}

/// Predicted power of all cameras; `None` where there is no camera, or one without a prediction.
pub(super) fn sum(mut cameras: impl Iterator<Item = Predicted>) -> Option<Watts> {
    let first = cameras.next()?.power?;
    cameras.try_fold(first, |sum, camera| Some(sum + camera.power?))
}
