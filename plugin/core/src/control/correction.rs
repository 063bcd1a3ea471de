//! Corrects predicted power by metered power: gain and offset, by recursive least squares.
//!
//! metered = gain × predicted + offset, both over the meter's own interval. Readings are forgotten
//! exponentially (Ljung 1999, section 11.2), Huber's weights limit single bad ones (Huber 1964),
//! and the estimate restarts where readings stay off, as after a throttle. So the map predicts at
//! once what a change of view costs, and the meter scales that to this device.
//!
//! One operating point cannot tell gain and offset apart. Readings are therefore forgotten towards
//! a prior (ridge regression with exponential weights), which shares a difference out between the
//! two. A bias takes up the map's error at the present address, which would else pass for a gain.

use glam::{DMat2, DVec2};

use super::delay::{DelayFinder, Energies, MAX_WATTS, PredictionHistory};
use crate::units::Watts;

/// Time constant with which readings are forgotten, seconds. Higher values suppress more noise;
/// lower values follow slow drift, such as a device that warms up, sooner.
const FORGETTING_SECONDS: f64 = 4.0;
/// Standard deviation of a reading, as a share of it.
const NOISE: f64 = 0.03;
/// Standard deviation of a map's power at one address, as a share of it. All readings at an address
/// share this error, so that many say no more of the gain than one. Lower values mistake it for a
/// gain, which misleads at the next address; higher values learn more slowly what other settings
/// cost.
const MAP_NOISE: f64 = 0.08;
/// Time constant of the bias, seconds: what is left beside gain and offset, and belongs to the present
/// address. Lower values follow the map's errors sooner, and the meter's noise more.
const BIAS_SECONDS: f64 = 0.5;
/// Part of a bias that is not corrected, as a share of the power: the meter's noise reaches it, and
/// would make the correction wander.
const MIN_BIAS: f64 = 0.015;
/// Standard deviations beyond which a reading's weight falls.
const HUBER: f64 = 2.0;
/// Gain and offset before the first reading.
const NEUTRAL: DVec2 = DVec2::X;
/// Standard deviations of gain and offset around that; the offset's as a share of the first predicted
/// power.
const PRIOR: DVec2 = DVec2::new(0.5, 0.3);
/// Largest gain, its smallest reciprocal, and the largest offset as a multiple of the first
/// predicted power: beyond, the readings are not those of this renderer.
const MAX_RATIO: f64 = 10.0;
/// Readings in succession beyond that which are no reason to believe it, at the start: an interval may
/// cover what was before the app played.
const ODD_AT_START: u32 = 3;
/// Underestimate of the power, as a share, from which a new correction is used.
const MAX_UNDERESTIMATE: f64 = 0.005;
/// Overestimate from which it is used: room below a limit is less urgent, and settings that follow
/// every reading would flicker.
const MAX_OVERESTIMATE: f64 = 0.03;
/// Change, as a share, of the corrected power at half and at twice the present power from which a
/// correction is used: it decides whether other settings are tried.
const MAX_CHANGE_ELSEWHERE: f64 = 0.1;

/// Time constant of the residual, seconds: a throttle or a switch is over by then.
const RESIDUAL_SECONDS: f64 = 8.0;
/// Largest deviation of one reading that counts, as a share: a single one says no more.
const MAX_RESIDUAL: f64 = 0.5;
/// Residuals, as shares, from which the scene is no longer the map's, and below which it is again.
const MAP_MISMATCH_THRESHOLDS: [f64; 2] = [0.18, 0.1];

/// From the watts of a map to those of the app's meter.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "bevy", derive(bevy_reflect::Reflect))]
pub struct PowerCorrection {
    /// Metered watts per predicted watt; finite, above 0. 1: none.
    pub gain: f64,
    /// Metered power at a predicted power of 0, in watts; finite. 0 W: none.
    pub offset: Watts,
}

impl Default for PowerCorrection {
    fn default() -> Self {
        Self { gain: 1.0, offset: Watts(0.0) }
    }
}

impl PowerCorrection {
    /// The metered power of a predicted one; at least 0 W. NaN stays NaN.
    pub fn corrected(self, predicted: Watts) -> Watts {
        let metered = predicted * self.gain + self.offset;
        if metered.0 < 0.0 { Watts(0.0) } else { metered }
    }

    /// The predicted power of a metered one: the inverse of [`corrected`](Self::corrected), at least
    /// 0 W.
    pub fn uncorrected(self, metered: Watts) -> Watts {
        let predicted = (metered - self.offset) / self.gain;
        if predicted.0 < 0.0 { Watts(0.0) } else { predicted }
    }

    /// This correction of powers that `first` has corrected.
    pub fn after(self, first: Self) -> Self {
        Self { gain: self.gain * first.gain, offset: first.offset * self.gain + self.offset }
    }

    /// This correction for each of `cameras` whose powers add up to the corrected one.
    pub fn shared_by(self, cameras: usize) -> Self {
        Self { offset: self.offset / cameras.max(1) as f64, ..self }
    }
}

/// Learns the correction from predictions and readings. Has no clock.
#[derive(Clone, Debug)]
pub struct PowerModel {
    /// Gain, and offset as a multiple of `scale`: both are near 1 in size.
    estimate: DVec2,
    /// Inverse of the estimate's covariance.
    information: DMat2,
    /// `information` × `estimate`.
    weighted: DVec2,
    /// Predicted power at the first reading, watts.
    scale: f64,
    /// What the present address is off beside the estimate, a multiple of `scale`.
    bias: f64,
    /// Number of readings that share an error of the map.
    alike: f64,
    /// Sign of the last reading's deviation, if it was an outlier.
    outlier: Option<f64>,
    readings: u64,
    /// Number of readings before the first that were beyond all ratios.
    odd: u32,
    used: PowerCorrection,
    history: PredictionHistory,
    delay: DelayFinder,
    /// Mean square of what readings were off their corrected prediction, as a share.
    residual: f64,
    has_left: bool,
    energies: Energies,
}

impl Default for PowerModel {
    fn default() -> Self {
        let mut model = Self {
            estimate: NEUTRAL,
            information: DMat2::ZERO,
            weighted: DVec2::ZERO,
            scale: 0.0,
            bias: 0.0,
            alike: 0.0,
            outlier: None,
            readings: 0,
            odd: 0,
            used: PowerCorrection::default(),
            history: PredictionHistory::default(),
            delay: DelayFinder::default(),
            residual: 0.0,
            has_left: false,
            energies: Energies::default(),
        };
        model.forget(0.0);
        model
    }
}

impl PowerModel {
    /// The correction to use. Changes only where it matters: by more than half a percent of the
    /// power upwards, or 3 % downwards.
    pub fn correction(&self) -> PowerCorrection {
        self.used
    }

    /// The correction of a mean over tens of seconds: metered energy for each predicted one of the last
    /// minutes, or since the device changed by a seventh or more. It does not follow single views. Of a
    /// meter that is late by up to 40 s, the delay is found.
    pub fn mean_correction(&self) -> PowerCorrection {
        let gain = self.delay.energies().unwrap_or(self.energies).gain();
        let is_known = gain.is_finite() && gain > 0.0;
        let gain = if is_known { gain.clamp(1.0 / MAX_RATIO, MAX_RATIO) } else { 1.0 };
        PowerCorrection { gain, offset: Watts(0.0) }
    }

    /// Number of readings learnt from.
    pub fn readings(&self) -> u64 {
        self.readings
    }

    /// What readings of the last seconds were off their corrected predictions, as a share: root mean
    /// square.
    pub fn residual(&self) -> f64 {
        self.residual.sqrt()
    }

    /// Whether readings stay so far off any correction that the map no longer tells what views and
    /// settings cost: the scene is no longer the map's.
    pub fn has_left_map(&self) -> bool {
        self.has_left
    }

    /// Standard deviation of the corrected power at the power predicted last, watts; `None` before
    /// the first reading.
    pub fn deviation(&self) -> Option<Watts> {
        let regressor = DVec2::new(self.history.last()? / self.scale, 1.0);
        let variance = (self.covariance()? * regressor).dot(regressor);
        (self.readings > 0).then(|| Watts(variance.max(0.0).sqrt() * self.scale))
    }

    /// Adds a frame of `delta_seconds` with the predicted power of its settings, without
    /// correction. Ignored unless the power is from 0 W to 100 kW, and the time above 0.
    pub fn predict(&mut self, predicted: Watts, delta_seconds: f64) {
        if self.history.push(predicted.0, delta_seconds) {
            self.delay.predict(predicted.0, delta_seconds);
        }
    }

    /// Forgets the predictions, but not what was learnt: for frames without a prediction.
    pub fn pause(&mut self) {
        self.history.clear();
        self.delay.pause();
    }

    /// Adds a reading: the mean power of the last `interval_seconds`. Ignored if it is not from 0 W
    /// to 100 kW, or there are no predictions of that interval.
    pub fn read(&mut self, metered: Watts, interval_seconds: f64) {
        let is_time = interval_seconds > 0.0 && interval_seconds.is_finite();
        let is_valid = (0.0..=MAX_WATTS).contains(&metered.0) && is_time;
        if !is_valid {
            return;
        }
        self.delay.read(metered.0, interval_seconds);
        let of_reading = match self.delay.delay() {
            0 => self.history.mean(interval_seconds),
            _ => self.delay.of_reading(interval_seconds),
        };
        let Some((predicted, spread)) = of_reading else { return };
        let is_odd = !(1.0 / MAX_RATIO..=MAX_RATIO).contains(&(metered.0 / predicted));
        if self.readings == 0 && is_odd && self.odd < ODD_AT_START {
            self.odd += 1;
            return;
        }
        self.energies.add(predicted, metered.0, interval_seconds);
        if self.readings == 0 {
            self.scale = predicted.max(1e-3);
        } else {
            self.compare(predicted, metered.0, spread, interval_seconds);
        }
        self.forget((-interval_seconds / FORGETTING_SECONDS).exp());
        // Readings that share the memory, and with it an error of the map: the first is the only
        // one.
        self.alike = (self.alike + 1.0).min((FORGETTING_SECONDS / interval_seconds).max(1.0));
        // At most half of a time constant: a slow meter's bias would swing.
        let bias_weight = -(-(interval_seconds / BIAS_SECONDS).min(0.5)).exp_m1();
        let [predicted, metered, spread] =
            [predicted, metered.0, spread].map(|watts| watts / self.scale);
        self.learn(predicted, metered, spread, bias_weight);
        self.readings += 1;
        self.use_estimate();
    }

    /// Adds a reading to the residual. Where settings have just changed it says nothing.
    fn compare(&mut self, predicted: f64, metered: f64, spread: f64, interval_seconds: f64) {
        let expected = self.used.corrected(Watts(predicted)).0;
        let size = expected.max(metered);
        if size <= 0.0 || spread > 0.05 * predicted {
            return;
        }
        let off = ((metered - expected) / size).clamp(-MAX_RESIDUAL, MAX_RESIDUAL);
        let weight = -(-interval_seconds / RESIDUAL_SECONDS).exp_m1();
        self.residual += (off * off - self.residual) * weight;
        let [left, back] = MAP_MISMATCH_THRESHOLDS;
        self.has_left = self.residual() > if self.has_left { back } else { left };
    }

    /// Keeps a share of what was learnt; the prior takes the place of the rest.
    fn forget(&mut self, kept: f64) {
        let prior = (PRIOR * PRIOR).recip() * (1.0 - kept);
        self.information = self.information * kept + DMat2::from_diagonal(prior);
        self.weighted = self.weighted * kept + prior * NEUTRAL;
    }

    /// Inverse of the information; `None` where numbers have left the range of 64 bits.
    fn covariance(&self) -> Option<DMat2> {
        let (determinant, [a, b, c, d]) =
            (self.information.determinant(), self.information.to_cols_array());
        (determinant > 0.0 && determinant.is_finite())
            .then(|| DMat2::from_cols_array(&[d, -b, -c, a]) / determinant)
    }

    /// What a reading is off the estimate. All powers are multiples of `scale`.
    fn rest(&self, predicted: f64, metered: f64) -> f64 {
        metered - self.estimate.x * predicted - self.estimate.y
    }

    /// Adds a reading, of whose rest `bias_weight` belongs to the bias. All powers are multiples of
    /// `scale`.
    fn learn(&mut self, predicted: f64, metered: f64, spread: f64, mut bias_weight: f64) {
        let regressor = DVec2::new(predicted, 1.0);
        let deviation = self.rest(predicted, metered) - self.bias;
        // Where settings have just changed, the reading may belong to either.
        let unsure = 0.5 * spread * self.estimate.x;
        let size = metered.max(predicted);
        let noise = (NOISE * size).powi(2) + unsure * unsure + 1e-12;
        let of_map = (MAP_NOISE * size).powi(2);
        let Some(covariance) = self.covariance() else {
            self.forget(0.0);
            return;
        };
        let expected = ((covariance * regressor).dot(regressor) + noise + of_map).sqrt();
        let mut weight = (HUBER * expected / deviation.abs()).min(1.0);
        if weight < 1.0 {
            let sign = deviation.signum();
            if self.outlier == Some(sign) {
                // Two in succession are no accident: the device has changed.
                self.forget(0.0);
                // What the prior does not believe of the new device is a bias at once.
                (self.alike, bias_weight) = (1.0, 1.0);
                (self.outlier, weight) = (None, 1.0);
            } else {
                self.outlier = Some(sign);
            }
        } else {
            self.outlier = None;
        }
        let precision = weight / (noise + of_map * self.alike);
        let weighted = regressor * precision;
        self.information += DMat2::from_cols(weighted * predicted, weighted);
        self.weighted += weighted * metered;
        let Some(covariance) = self.covariance() else {
            self.forget(0.0);
            return;
        };
        let estimate = covariance * self.weighted;
        if estimate.is_finite() {
            let least = DVec2::new(1.0 / MAX_RATIO, -MAX_RATIO);
            self.estimate = estimate.clamp(least, DVec2::splat(MAX_RATIO));
        }
        let rest = self.rest(predicted, metered);
        // An outlier is none of the address, and a reading across a switch partly.
        let sure = if weight < 1.0 { 0.0 } else { of_map / (of_map + unsure * unsure + 1e-12) };
        let bias = self.bias + (rest - self.bias) * (bias_weight * sure);
        self.bias = if bias.is_finite() { bias } else { 0.0 };
    }

    fn use_estimate(&mut self) {
        let Some(predicted) = self.history.last() else { return };
        let DVec2 { x: gain, y: offset } = self.estimate;
        let there = (predicted / self.scale * gain + offset).abs();
        let least = MIN_BIAS * there;
        let bias = self.bias - self.bias.clamp(-least, least);
        let latest = PowerCorrection { gain, offset: Watts((offset + bias) * self.scale) };
        let change = |at: f64| {
            let [new, old] = [latest, self.used].map(|it| it.corrected(Watts(predicted * at)).0);
            new / old - 1.0
        };
        let here = change(1.0);
        let is_far_off = [0.5, 2.0].into_iter().any(|at| change(at).abs() > MAX_CHANGE_ELSEWHERE);
        if !(-MAX_OVERESTIMATE..=MAX_UNDERESTIMATE).contains(&here) || is_far_off {
            self.used = latest;
        }
    }
}

#[cfg(test)]
#[path = "correction_tests.rs"]
mod tests;
