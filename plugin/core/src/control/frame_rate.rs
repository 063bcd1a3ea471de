//! Which frames tell how fast the app runs, its mean frame rate, and whether a limit holds that rate.

use super::PowerCorrection;
use crate::units::Watts;

/// Longest frame that is work for certain, seconds. Longer ones are pauses, unless several follow
/// each other: a device that is slow, or an app that waits for events.
const LONG_SECONDS: f64 = 0.25;
/// Number of long frames in succession from which they are work.
const LONG_IN_SUCCESSION: u32 = 3;
/// Longest frame that may be work, seconds. A reactive app of Bevy waits 5 s for an event.
const MAX_WORK_SECONDS: f64 = 4.0;
/// Time constant of the mean frame rate, and time until it is known, seconds.
const RATE_SECONDS: f64 = 1.0;
/// Change of the frame rate, as a share, from which watts are scaled anew: settings that follow
/// every frame's time would flicker.
const RATE_STEP: f64 = 0.03;

/// What the duration of a frame says.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FrameKind {
    /// The app renders continuously.
    #[default]
    Usual,
    /// One of several long frames: of a slow device, or of an app that waits for events.
    Long,
    /// Loading, sleep, or the first long frames: it says nothing.
    Pause,
}

/// The app's frame rate.
#[derive(Debug, Default)]
#[cfg_attr(feature = "bevy", derive(bevy_ecs::resource::Resource))]
pub struct FrameRate {
    kind: FrameKind,
    /// Kind of the frames in the mean.
    counted: FrameKind,
    long_in_succession: u32,
    mean_seconds: f64,
    seen_seconds: f64,
    /// Mean power of the settings by the same weights, watts of the map.
    mean_power: f64,
    response: RateResponse,
    /// The rate in use, as a multiple of the map's.
    held: Option<f64>,
}

impl FrameRate {
    /// Adds a frame of `delta_seconds` that was rendered with settings of the `predicted` power; `None`
    /// is unknown.
    pub fn observe(&mut self, delta_seconds: f64, predicted: Option<Watts>) {
        self.kind = self.kind_of(delta_seconds);
        if self.kind == FrameKind::Pause {
            return;
        }
        if self.kind != self.counted {
            // The mean of the other kind would take seconds to be forgotten.
            (self.counted, self.seen_seconds) = (self.kind, 0.0);
        }
        let weight =
            if self.seen_seconds == 0.0 { 1.0 } else { -(-delta_seconds / RATE_SECONDS).exp_m1() };
        self.mean_seconds += (delta_seconds - self.mean_seconds) * weight;
        self.seen_seconds += delta_seconds;
        let predicted = predicted.filter(|power| power.0.is_finite());
        if let Some(power) = predicted.filter(|_| self.kind == FrameKind::Usual) {
            self.mean_power += (power.0 - self.mean_power) * weight;
            self.response.observe(power, delta_seconds);
        }
    }

    fn kind_of(&mut self, delta_seconds: f64) -> FrameKind {
        if !(delta_seconds > 0.0 && delta_seconds <= MAX_WORK_SECONDS) {
            return FrameKind::Pause;
        }
        if delta_seconds <= LONG_SECONDS {
            self.long_in_succession = 0;
            return FrameKind::Usual;
        }
        self.long_in_succession = self.long_in_succession.saturating_add(1);
        if self.long_in_succession < LONG_IN_SUCCESSION {
            FrameKind::Pause
        } else {
            FrameKind::Long
        }
    }

    /// What the last frame's duration says.
    pub fn kind(&self) -> FrameKind {
        self.kind
    }

    /// Mean frame rate, to 1 %, so that change detection does not fire in every frame; `None` in
    /// the first second.
    pub fn frames_per_second(&self) -> Option<f64> {
        (self.seen_seconds >= RATE_SECONDS).then(|| {
            let steps = (self.mean_seconds.recip().ln() / 0.01).round();
            (steps * 0.01).exp()
        })
    }

    /// Scales maps' watts, summed over all cameras, to the app's frame rate: frames spend the
    /// energy above the idle device's. Neutral where maps differ in their rate, or a camera has
    /// none.
    ///
    /// Where nothing limits the frame rate, cheaper settings give more frames instead of less
    /// power. The power of all settings is then near that of those in use.
    pub fn correction(&mut self, rated: impl Iterator<Item = Option<RatedAt>>) -> PowerCorrection {
        let Some(at) = common(rated) else {
            self.held = None;
            return PowerCorrection::default();
        };
        let latest = self.frames_per_second().map(|now| now / at.frames_per_second);
        let latest = latest.filter(|it| it.is_finite() && *it > 0.0);
        self.held = match (latest, self.held) {
            (Some(latest), Some(held)) if (latest / held - 1.0).abs() <= RATE_STEP => Some(held),
            (latest, _) => latest,
        };
        let share = self.held.unwrap_or(1.0);
        // Of the frames that the rate is the mean of.
        let frames = (self.mean_power - at.idle.0).max(0.0);
        let is_free = self.held.is_some() && frames > 0.0;
        let free = if is_free { self.response.share } else { 0.0 };
        let gain = share * (1.0 - free);
        PowerCorrection { gain, offset: at.idle * (1.0 - gain) + Watts(share * free * frames) }
    }
}

/// Frame rate that a map's watts refer to, and its idle power.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RatedAt {
    /// Frames per second; finite, above 0.
    pub frames_per_second: f64,
    /// Power of the device without work.
    pub idle: Watts,
}

/// The common rate and the sum of idle power; `None` where there is no common one.
fn common(mut rated: impl Iterator<Item = Option<RatedAt>>) -> Option<RatedAt> {
    let mut all = rated.next()??;
    for at in rated {
        let at = at.filter(|at| at.frames_per_second == all.frames_per_second)?;
        all.idle = all.idle + at.idle;
    }
    Some(all)
}

/// Time constant of the response, seconds.
const RESPONSE_SECONDS: f64 = 8.0;
/// Least standard deviation of the power's logarithm from which a response is known: settings have
/// changed by some percent.
const LEAST_SPREAD: f64 = 0.05;
/// Smallest slope that counts: uneven frames of a limited rate show smaller ones by chance.
const LEAST_SLOPE: f64 = 0.25;
/// Largest share: below 1, so that a correction can be inverted.
const MAX_SHARE: f64 = 0.98;

/// How the frame rate answers to the settings' power: the slope of ln rate over ln power, by
/// regression with forgetting. 0 where a limit holds the rate; −1 where cheaper settings give more
/// frames at the same power.
#[derive(Clone, Copy, Debug, Default)]
struct RateResponse {
    weight: f64,
    /// Means of ln power and ln rate.
    mean: [f64; 2],
    /// Variance of ln power, and its covariance with ln rate.
    moments: [f64; 2],
    /// 0: a limit holds the frame rate; near 1: it follows the settings.
    share: f64,
}

impl RateResponse {
    fn observe(&mut self, predicted: Watts, delta_seconds: f64) {
        let point = [predicted.0.ln(), -delta_seconds.ln()];
        if !point.iter().all(|value| value.is_finite()) {
            return;
        }
        let kept = (-delta_seconds / RESPONSE_SECONDS).exp();
        self.weight = self.weight * kept + delta_seconds;
        let part = delta_seconds / self.weight;
        let off = [point[0] - self.mean[0], point[1] - self.mean[1]];
        for (mean, off) in self.mean.iter_mut().zip(off) {
            *mean += part * off;
        }
        for (moment, product) in self.moments.iter_mut().zip([off[0] * off[0], off[0] * off[1]]) {
            *moment = (1.0 - part) * (*moment + part * product);
        }
        // What was learnt stays while the settings do.
        if self.moments[0] > LEAST_SPREAD * LEAST_SPREAD {
            let slope = -self.moments[1] / self.moments[0];
            self.share = if slope < LEAST_SLOPE { 0.0 } else { slope.min(MAX_SHARE) };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frames(rate: &mut FrameRate, seconds: f64, count: usize) {
        (0..count).for_each(|_| rate.observe(seconds, None));
    }

    #[test]
    fn the_frame_rate_is_known_after_a_second_and_ignores_pauses() {
        let mut rate = FrameRate::default();
        for odd in [f64::NAN, -1.0, 0.0, 10.0, f64::INFINITY] {
            rate.observe(odd, None);
            assert_eq!(rate.kind(), FrameKind::Pause);
        }
        frames(&mut rate, 1.0 / 30.0, 29);
        assert_eq!(rate.frames_per_second(), None);
        frames(&mut rate, 1.0 / 30.0, 60);
        rate.observe(2.0, None);
        let known = rate.frames_per_second().expect("a rate");
        assert!((known / 30.0 - 1.0).abs() < 0.006, "{known}");
    }

    #[test]
    fn long_frames_in_succession_count_and_are_forgotten_at_once() {
        let mut rate = FrameRate::default();
        frames(&mut rate, 1.0 / 60.0, 120);
        frames(&mut rate, 0.5, 2);
        assert_eq!(rate.kind(), FrameKind::Pause);
        frames(&mut rate, 0.5, 6);
        let slow = rate.frames_per_second().expect("a rate");
        assert!(rate.kind() == FrameKind::Long && (slow / 2.0 - 1.0).abs() < 0.01, "{slow}");
        // Waiting for events.
        frames(&mut rate, 5.0, 20);
        assert_eq!(rate.kind(), FrameKind::Pause);
        frames(&mut rate, 1.0 / 60.0, 30);
        assert_eq!(rate.frames_per_second(), None, "the long frames are forgotten");
        frames(&mut rate, 1.0 / 60.0, 40);
        let back = rate.frames_per_second().expect("a rate");
        assert!((back / 60.0 - 1.0).abs() < 0.006, "{back}");
    }

    fn at(frames_per_second: f64, idle: f64) -> Option<RatedAt> {
        Some(RatedAt { frames_per_second, idle: Watts(idle) })
    }

    fn steady(frames_per_second: f64) -> FrameRate {
        let mut rate = FrameRate::default();
        frames(&mut rate, 1.0 / frames_per_second, 3 * frames_per_second as usize);
        rate
    }

    #[test]
    fn watts_follow_the_frame_rate_where_maps_agree_on_theirs() {
        let two = [at(60.0, 5.0), at(60.0, 5.0)];
        let mut rate = steady(30.0);
        let half = rate.correction(two.into_iter());
        // Two maps of 5 W idle and 20 W of frames; the rate is known to 1 %.
        assert!((half.corrected(Watts(50.0)).0 / 30.0 - 1.0).abs() < 0.006, "{half:?}");
        // A change of less than 3 % is none.
        frames(&mut rate, 1.0 / 30.6, 200);
        assert_eq!(rate.correction(two.into_iter()), half);
        frames(&mut rate, 1.0 / 33.0, 200);
        assert_ne!(rate.correction(two.into_iter()), half);
        for mixed in [[at(60.0, 5.0), at(30.0, 5.0)], [at(60.0, 5.0), None]] {
            assert_eq!(rate.correction(mixed.into_iter()), PowerCorrection::default());
        }
        for odd in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let none = rate.correction([at(odd, 5.0)].into_iter());
            assert_eq!(none, PowerCorrection::default(), "{odd}");
        }
        assert_eq!(rate.correction(std::iter::empty()), PowerCorrection::default());
    }

    /// Frames whose settings take from 4 W to 14 W, each `seconds_of` its watts long.
    fn answered(seconds_of: impl Fn(f64) -> f64) -> FrameRate {
        let mut rate = FrameRate::default();
        let mut passed = 0.0;
        while passed < 10.0 {
            let watts = 4.0 + f64::from(passed as u32 % 10);
            let seconds = seconds_of(watts);
            rate.observe(seconds, Some(Watts(watts)));
            passed += seconds;
        }
        rate
    }

    #[test]
    fn without_a_limit_of_the_rate_all_settings_take_the_power_of_those_in_use() {
        // 60 W whatever the settings.
        let mut free = answered(|watts| watts / 60.0 / 60.0);
        let correction = free.correction([at(60.0, 0.0)].into_iter());
        let power = |watts: f64| correction.corrected(Watts(watts)).0;
        assert!((power(4.0) / power(14.0) - 1.0).abs() < 0.05, "{correction:?}");
        // The rate is known to 1 %.
        assert!((power(13.0) / 60.0 - 1.0).abs() < 0.015, "{correction:?}");
        // At a fixed rate of 120 they take what their energy says.
        let mut limited = answered(|_| 1.0 / 120.0);
        let correction = limited.correction([at(60.0, 0.0)].into_iter());
        assert!((correction.gain / 2.0 - 1.0).abs() < 0.01, "{correction:?}");
        assert_eq!(correction.offset, Watts(0.0));
    }
}
