//! Corrects predicted errors by measured ones.
//!
//! A map's error budgets are calibrated before anybody plays, with a margin for views that differ.
//! Errors measured in play replace that margin by a ratio: the mean measured error divided by the
//! mean predicted one. The calibration counts as a few early measurements, and fades as all do (a
//! ratio estimator with a prior; Cochran 1977, "Sampling Techniques", section 6.3).

use std::time::Duration;

#[cfg(feature = "bevy")]
use bevy_ecs::reflect::ReflectComponent;
#[cfg(feature = "bevy")]
use bevy_reflect::std_traits::ReflectDefault;

/// Mean period of error meters that an app does not set.
pub const MEASUREMENT_PERIOD: Duration = Duration::from_secs(20);
/// Measurements that the map's calibration counts for. Higher values keep its margin for longer;
/// lower values follow the first measurements, which may be of an unusual view.
const PRIOR: f64 = 4.0;
/// What a measurement counts after the next one, as a share: 1/e after 128. Higher values average more
/// views; lower values follow a camera to another part of the level.
const FADING: f64 = 1.0 - 1.0 / 128.0;
/// Margin on the ratio, in standard errors. Higher values keep budgets in more views; lower values
/// use budgets more fully.
const MARGIN: f64 = 0.75;
/// Spread of measurements about the ratio times their predictions, as a share of their mean, before any
/// is known.
const USUAL_SPREAD: f64 = 0.4;
/// Measurements that the usual spread counts for. Higher values keep its margin for longer; lower values
/// trust a few measurements that agree by chance.
const USUAL_COUNT: f64 = 8.0;
/// Largest ratio of measured to predicted errors, either way: a larger one has other causes than the
/// views.
const MAX_RATIO: f64 = 8.0;

/// How measured errors of a camera's frames compare with those that its map predicted. Without
/// measurements the map's own calibration holds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "bevy", derive(bevy_ecs::component::Component, bevy_reflect::Reflect))]
#[cfg_attr(feature = "bevy", reflect(Component, Default, Clone, Debug, PartialEq))]
pub struct ErrorFeedback {
    /// Sums in which older ones fade: measured and predicted errors, 1 − SSIM, their products measured²,
    /// measured × predicted and predicted², and the number of measurements.
    sums: [f64; 6],
}

impl ErrorFeedback {
    /// Takes account of a frame's `measured` error (1 − SSIM, 0 or more), of which `predicted` was
    /// expected. Values that are negative or not finite, or a prediction of 0, change nothing.
    pub fn observe(&mut self, measured: f64, predicted: f64) {
        let is_error = |error: f64| error.is_finite() && error >= 0.0;
        if !is_error(measured) || !is_error(predicted) || predicted == 0.0 {
            return;
        }
        // Reflection may write anything.
        if !self.sums.into_iter().all(is_error) {
            *self = Self::default();
        }
        let products = [measured * measured, measured * predicted, predicted * predicted];
        let values = [measured, predicted].into_iter().chain(products).chain([1.0]);
        for (sum, value) in self.sums.iter_mut().zip(values) {
            *sum = FADING * *sum + value;
        }
    }

    /// Number of measurements that count, 0 to 128; older ones count less.
    pub fn count(&self) -> f64 {
        self.sums[5]
    }

    /// Mean predicted error at which the mean measured one meets `budget`. `calibrated`: the same by
    /// the map's calibration, which alone counts before anything is measured; `None` where the map
    /// has none.
    pub fn target(&self, budget: f64, calibrated: Option<f64>) -> Option<f64> {
        let is_positive = |value: f64| value > 0.0 && value.is_finite();
        let [measured, predicted, .., count] = self.sums;
        if !is_positive(count) || !is_positive(predicted) || !is_positive(budget) {
            return calibrated;
        }
        let prior = calibrated.filter(|target| is_positive(*target)).map_or(1.0, |t| budget / t);
        let mean = predicted / count;
        // n measurements count (1 - f^n) / (1 - f), and what was there before them f^n.
        let weight = PRIOR * (1.0 - count * (1.0 - FADING)).clamp(0.0, 1.0);
        let ratio = (measured + weight * mean * prior) / (predicted + weight * mean);
        // The calibration has its own margin.
        let share = count / (count + weight);
        let margin = 1.0 + share * MARGIN * self.spread() / (count + weight).sqrt();
        Some(budget / (ratio * margin).clamp(MAX_RATIO.recip(), MAX_RATIO))
    }

    /// Standard deviation of measurements about the ratio times their predictions, as a share of
    /// their mean, 0 or more: what the ratio is uncertain by (Cochran 1977, chapter 6). Averaged with
    /// the usual one, as few measurements say little of it.
    fn spread(&self) -> f64 {
        let [measured, predicted, squares, cross, of_predicted, count] = self.sums;
        let ratio = measured / predicted;
        let residual = squares - 2.0 * ratio * cross + ratio * ratio * of_predicted;
        let mean = measured / count;
        let usual = USUAL_COUNT * USUAL_SPREAD.powi(2);
        // Rounding may leave less than nothing.
        let variance = (residual.max(0.0) / mean.powi(2) + usual) / (count + USUAL_COUNT);
        if variance.is_finite() { variance.sqrt() } else { USUAL_SPREAD }
    }
}

/// Time from an error meter's measurement number `count` to the next: ½ to 1½ times `period`, by the golden
/// ratio. A fixed period could meet the same views of a round again and again.
pub fn measurement_interval(period: Duration, count: u32) -> Duration {
    let share = 0.5 + (0.618_033_988_749_895 * f64::from(count)).fract();
    Duration::try_from_secs_f64(period.as_secs_f64() * share).unwrap_or(Duration::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_calibration_gives_way_to_measurements() {
        let mut feedback = ErrorFeedback::default();
        assert_eq!(feedback.target(0.02, Some(0.015)), Some(0.015), "nothing is measured");
        assert_eq!(feedback.target(0.02, None), None);
        let mut targets = vec![0.015];
        for _ in 0..400 {
            // Three quarters of what is predicted.
            feedback.observe(0.012, 0.016);
            targets.extend(feedback.target(0.02, Some(0.015)));
        }
        assert!(targets.is_sorted(), "{targets:?}");
        let last = targets[400];
        assert!((0.985..0.999).contains(&(last / (0.02 / 0.75))), "with a margin alone: {last}");
        assert!((feedback.count() - 128.0).abs() < 8.0, "{}", feedback.count());
        assert!((targets[4] / targets[0]) < 1.4, "four count as much as the calibration");
    }

    #[test]
    fn views_that_are_harder_than_predicted_lower_the_target() {
        let mut feedback = ErrorFeedback::default();
        for _ in 0..8 {
            feedback.observe(0.03, 0.015);
        }
        let target = feedback.target(0.02, Some(0.019)).unwrap();
        assert!((0.010..0.013).contains(&target), "{target}");
    }

    #[test]
    fn the_margin_follows_how_far_measurements_differ_from_their_predictions() {
        // Margins with measurements of `spread` about a ratio of 1, in turns above and below.
        let margin = |spread: f64, count: usize| {
            let mut feedback = ErrorFeedback::default();
            for index in 0..count {
                // Predictions vary, too, which is not what the ratio is uncertain by.
                let predicted = [0.01, 0.03][index / 2 % 2];
                let beyond = [spread, -spread][index % 2] * 0.02;
                feedback.observe(predicted + beyond, predicted);
            }
            0.02 / feedback.target(0.02, Some(0.02)).unwrap() - 1.0
        };
        for spread in [0.2, 0.3, 0.4] {
            let (found, expected) = (margin(spread, 400), MARGIN * spread / 122.0_f64.sqrt());
            assert!((found / expected - 1.0).abs() < 0.15, "{spread}: {found} for {expected}");
        }
        // Two that agree by chance.
        assert!(margin(0.0, 2) > 0.7 * margin(USUAL_SPREAD, 2), "{}", margin(0.0, 2));
        assert!(margin(0.0, 400) < 0.3 * margin(USUAL_SPREAD, 400));
    }

    #[test]
    fn odd_measurements_change_nothing_and_odd_ratios_are_bounded() {
        let mut feedback = ErrorFeedback::default();
        for odd in [f64::NAN, f64::INFINITY, -1.0] {
            feedback.observe(odd, 0.01);
            feedback.observe(0.01, odd);
        }
        feedback.observe(0.01, 0.0);
        assert_eq!(feedback, ErrorFeedback::default());
        for (measured, predicted) in [(1e300, 1e-300), (0.0, 1.0), (1e-20, 1e20)] {
            let mut feedback = ErrorFeedback::default();
            for _ in 0..1000 {
                feedback.observe(measured, predicted);
            }
            for budget in [0.0, 0.02, 1e300, f64::INFINITY, f64::NAN] {
                let target = feedback.target(budget, Some(0.02));
                assert!(target.is_some_and(|target| target > 0.0), "{budget}: {target:?}");
            }
            let target = feedback.target(0.02, Some(0.02)).unwrap();
            assert!((0.02 / MAX_RATIO..=0.02 * MAX_RATIO).contains(&target), "{target}");
        }
        let mut broken = ErrorFeedback { sums: [f64::NAN, 1.0, 0.0, 0.0, 0.0, 1.0] };
        broken.observe(0.01, 0.01);
        assert_eq!(broken.count(), 1.0);
    }
}
