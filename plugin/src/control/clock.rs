//! What the controller observes of the app as a whole: its frame rate, and its metered power.

use bevy::ecs::prelude::*;
use bevy::ecs::reflect::ReflectResource;
use bevy::log::warn;
use bevy::prelude::ReflectDefault;
use bevy::reflect::Reflect;
use bevy::time::{Real, Time};

use super::systems::CameraState;
use super::{PowerCorrection, PowerModel};
use crate::frontier::{Comparison, MapFit};
use crate::power::{MeterState, MeteredPower, Provenance};
use crate::units::Watts;

/// Time constant of the mean frame rate, and time until it is known, seconds.
const RATE_SECONDS: f64 = 1.0;
/// Change of the frame rate, as a share, from which watts are scaled anew: settings that follow
/// every frame's time would flicker.
const RATE_STEP: f64 = 0.03;
/// Longest frame that counts, seconds: loading says nothing about the frame rate.
const MAX_FRAME_SECONDS: f64 = 0.25;

/// The app's frame rate.
#[derive(Resource, Debug, Default)]
pub(super) struct ControlClock {
    mean_seconds: f64,
    seen_seconds: f64,
}

impl ControlClock {
    fn observe(&mut self, delta_seconds: f64) {
        if !(delta_seconds > 0.0 && delta_seconds <= MAX_FRAME_SECONDS) {
            return;
        }
        let weight =
            if self.seen_seconds == 0.0 { 1.0 } else { -(-delta_seconds / RATE_SECONDS).exp_m1() };
        self.mean_seconds += (delta_seconds - self.mean_seconds) * weight;
        self.seen_seconds += delta_seconds;
    }

    /// Mean frame rate, to 1 %, so that change detection does not fire in every frame; `None` in
    /// the first second.
    pub(super) fn frames_per_second(&self) -> Option<f64> {
        (self.seen_seconds >= RATE_SECONDS).then(|| {
            let steps = (self.mean_seconds.recip().ln() / 0.01).round();
            (steps * 0.01).exp()
        })
    }
}

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

/// Correction of predicted power by [`MeteredPower`], which holds a budget in watts on a device
/// other than the map's, or one that has been throttled. An app may write `is_enabled`; the rest is
/// written by the controller.
///
/// The meter's power must be that of the controlled cameras and of constant others: with it, a
/// power budget is one on metered watts.
#[derive(Resource, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Resource, Default, Clone, Debug, PartialEq)]
pub struct PowerFeedback {
    /// Whether a trustworthy meter corrects the predictions: a measured one, or the modelled one
    /// that the map was made with. Default: true.
    pub is_enabled: bool,
    /// What happens.
    pub state: FeedbackState,
    /// The correction in use, of the sum over all controlled cameras: what the meter says, after
    /// the map's watts are scaled to the app's frame rate.
    pub correction: PowerCorrection,
    /// Standard deviation of the corrected power, watts; `None` before the first reading.
    pub deviation: Option<Watts>,
    /// Number of readings learnt from.
    pub readings: u64,
    /// Whether readings stay off whatever the correction: the scene is no longer the map's. The
    /// controller then selects from the frontier over all views, and predicts more power by as much
    /// as readings are off.
    pub has_left_map: bool,
    /// Number of active controlled cameras.
    cameras: usize,
}

impl Default for PowerFeedback {
    fn default() -> Self {
        Self {
            is_enabled: true,
            state: FeedbackState::Off,
            correction: PowerCorrection::default(),
            deviation: None,
            readings: 0,
            has_left_map: false,
            cameras: 0,
        }
    }
}

impl PowerFeedback {
    /// The correction of one camera's power.
    pub fn per_camera(&self) -> PowerCorrection {
        self.correction.shared_by(self.cameras)
    }
}

/// The model, the number of the meter's last reading, and the app's frame rate as a multiple of the
/// map's.
#[derive(Resource, Default)]
pub(super) struct FeedbackModel {
    model: PowerModel,
    seen: u64,
    rate: Option<f64>,
}

/// Frame rate that a map's watts refer to, and its idle power.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct RatedAt {
    pub(super) frames_per_second: f64,
    pub(super) idle: Watts,
}

/// From a map's watts to those at the app's frame rate, for the sum over all cameras: energy beyond
/// the idle device's is spent by the frame. Neutral where maps differ in their rate, or a camera
/// has none.
///
/// An H100 that held 25 of a map's 60 frames per second took 228 W where the map said 419 W; scaled
/// it said 219 to 224 W.
fn rate_correction(
    rated: impl Iterator<Item = Option<RatedAt>>,
    frames_per_second: Option<f64>,
    held: &mut Option<f64>,
) -> PowerCorrection {
    let mut all = (None, Watts(0.0));
    for at in rated {
        match (at, all.0) {
            (Some(at), None) => all = (Some(at.frames_per_second), at.idle),
            (Some(at), Some(rate)) if at.frames_per_second == rate => {
                all.1 = all.1 + at.idle;
            }
            _ => {
                *held = None;
                return PowerCorrection::default();
            }
        }
    }
    let (Some(rate), idle) = all else { return PowerCorrection::default() };
    let latest = frames_per_second.map(|now| now / rate).filter(|it| it.is_finite() && *it > 0.0);
    if let Some(latest) = latest
        && held.is_none_or(|held| (latest / held - 1.0).abs() > RATE_STEP)
    {
        *held = Some(latest);
    }
    let share = held.unwrap_or(1.0);
    PowerCorrection { gain: share, offset: idle * (1.0 - share) }
}

/// Observes the frame rate, and compares predicted with metered power.
pub(super) fn observe(
    time: Res<Time<Real>>,
    mut clock: ResMut<ControlClock>,
    metered: Option<Res<MeteredPower>>,
    cameras: Query<(&CameraState, &MapFit)>,
    mut model: ResMut<FeedbackModel>,
    mut feedback: ResMut<PowerFeedback>,
) {
    let delta_seconds = time.delta_secs_f64();
    clock.observe(delta_seconds);
    let active = || {
        cameras.iter().filter_map(|(state, fit)| Some((state.predicted()?, fit, state.rated_at)))
    };
    let count = active().count();
    let predicted = active().map(|(predicted, ..)| predicted).sum::<Option<Watts>>();
    let maps_meter = active().all(|(_, fit, _)| fit.meter == Comparison::Same);
    let is_trusted = |metered: &MeteredPower| {
        metered
            .info
            .as_ref()
            .is_some_and(|info| info.provenance == Provenance::Measured || maps_meter)
    };
    let FeedbackModel { model, seen, rate } = &mut *model;
    let rated = active().map(|(.., rated_at)| rated_at);
    let at_rate = rate_correction(rated, clock.frames_per_second(), rate);
    match predicted.filter(|_| count > 0) {
        Some(predicted) => model.predict(at_rate.corrected(predicted), delta_seconds),
        None => model.pause(),
    }
    let trusted = metered.as_deref().filter(|metered| feedback.is_enabled && is_trusted(metered));
    if let Some(metered) = trusted
        && metered.sample_count != *seen
        && let (Some(watts), Some(seconds)) = (metered.latest, metered.interval_seconds)
    {
        *seen = metered.sample_count;
        model.read(watts, seconds);
    }
    let readings = model.readings();
    let state = match trusted {
        None => FeedbackState::Off,
        Some(_) if readings == 0 => FeedbackState::Waiting,
        Some(metered) if metered.state == MeterState::Running => FeedbackState::Running,
        Some(_) => FeedbackState::Held,
    };
    // Without a meter, watts are those of the map's frame rate.
    let correction = match state {
        FeedbackState::Off => PowerCorrection::default(),
        _ => model.correction().after(at_rate),
    };
    let has_left_map = state == FeedbackState::Running && model.has_left_map();
    if has_left_map && !feedback.has_left_map {
        warn!(
            "metered power is off the map's by {:.0} % from view to view: the scene has changed since the map was made. The controller selects more carefully; run `frugal precompute` again",
            100.0 * model.residual()
        );
    }
    let margin = if has_left_map { 1.0 + (model.residual() * 10.0).round() / 10.0 } else { 1.0 };
    let correction =
        PowerCorrection { gain: correction.gain * margin, offset: correction.offset * margin };
    let deviation = model.deviation().filter(|_| state != FeedbackState::Off);
    feedback.set_if_neq(PowerFeedback {
        state,
        correction,
        deviation,
        readings,
        has_left_map,
        cameras: count,
        ..*feedback
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_frame_rate_is_known_after_a_second_and_ignores_pauses() {
        let mut clock = ControlClock::default();
        for odd in [f64::NAN, -1.0, 0.0, 10.0, f64::INFINITY] {
            clock.observe(odd);
        }
        (0..29).for_each(|_| clock.observe(1.0 / 30.0));
        assert_eq!(clock.frames_per_second(), None);
        (0..60).for_each(|_| clock.observe(1.0 / 30.0));
        let rate = clock.frames_per_second().expect("a rate");
        assert!((rate / 30.0 - 1.0).abs() < 0.006, "{rate}");
    }

    #[test]
    fn watts_follow_the_frame_rate_where_maps_agree_on_theirs() {
        let at = |frames_per_second: f64, idle: f64| {
            Some(RatedAt { frames_per_second, idle: Watts(idle) })
        };
        let mut held = None;
        let two = [at(60.0, 5.0), at(60.0, 5.0)];
        let half = rate_correction(two.into_iter(), Some(30.0), &mut held);
        // Two maps of 5 W idle and 20 W of frames.
        assert_eq!(half.corrected(Watts(50.0)), Watts(30.0));
        // A change of less than 3 % is none.
        let near = rate_correction(two.into_iter(), Some(30.6), &mut held);
        assert_eq!(near, half);
        assert_ne!(rate_correction(two.into_iter(), Some(33.0), &mut held), half);
        for mixed in [[at(60.0, 5.0), at(30.0, 5.0)], [at(60.0, 5.0), None]] {
            let none = rate_correction(mixed.into_iter(), Some(30.0), &mut held);
            assert_eq!((none, held), (PowerCorrection::default(), None));
        }
        for odd in [None, Some(0.0), Some(-1.0), Some(f64::NAN), Some(f64::INFINITY)] {
            let none = rate_correction(two.into_iter(), odd, &mut held);
            assert_eq!((none, held), (PowerCorrection::default(), None), "{odd:?}");
        }
        let nobody = rate_correction(std::iter::empty(), Some(30.0), &mut held);
        assert_eq!(nobody, PowerCorrection::default());
    }
}
