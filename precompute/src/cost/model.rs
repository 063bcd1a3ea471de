//! Prices of work, fitted to readings.

use super::Work;
use super::nnls::nonnegative_least_squares;

/// Alternating rounds of fitting prices and camera factors.
const ROUNDS: usize = 6;
/// Prior weight, in readings, of a camera factor of 1.
const CAMERA_PRIOR: f64 = 1.0;

/// A reading of the meter.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct CostReading {
    /// Number of the camera.
    pub camera: usize,
    /// Work of the frame.
    pub work: Work,
    /// Watts at the target frame rate, above 0.
    pub power_w: f64,
}

/// Quality of a model's predictions.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct FitQuality {
    /// Number of readings compared.
    pub readings: usize,
    /// Mean of |predicted ÷ read − 1|.
    pub mean_absolute_error: f64,
    /// 90th percentile of the same.
    pub ninth_decile: f64,
}

/// P = `exp(u_camera)` · Σ βⱼ xⱼ: prices β ≥ 0 of work x, in watts at the target frame rate, and a
/// factor for each camera.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct CostModel {
    /// Watts per unit of each kind of work per frame.
    pub prices: Vec<f64>,
    /// exp(u) by camera.
    cameras: Vec<f64>,
}

impl CostModel {
    /// Fits prices and camera factors in alternation, minimising relative errors. Readings that are
    /// not finite and above 0 are left out.
    pub(crate) fn fit(readings: &[CostReading]) -> Self {
        let valid: Vec<_> = readings
            .iter()
            .filter(|reading| reading.power_w.is_finite() && reading.power_w > 0.0)
            .collect();
        let cameras = valid.iter().map(|reading| reading.camera + 1).max().unwrap_or(0);
        let mut model = Self { prices: Vec::new(), cameras: vec![1.0; cameras] };
        for _ in 0..ROUNDS {
            // Divided by the reading, so that readings of 1 W and of 20 W weigh alike.
            let rows: Vec<Vec<f64>> = valid
                .iter()
                .map(|reading| {
                    reading
                        .work
                        .0
                        .iter()
                        .map(|work| work * model.cameras[reading.camera] / reading.power_w)
                        .collect()
                })
                .collect();
            model.prices = nonnegative_least_squares(&rows, &vec![1.0; rows.len()]);
            let mut logarithms = vec![(0.0, CAMERA_PRIOR); cameras];
            for reading in &valid {
                let ratio = reading.power_w / model.power(&reading.work);
                if ratio.is_finite() && ratio > 0.0 {
                    logarithms[reading.camera].0 += ratio.ln();
                    logarithms[reading.camera].1 += 1.0;
                }
            }
            model.cameras =
                logarithms.into_iter().map(|(sum, count)| (sum / count).exp()).collect();
        }
        model
    }

    /// Power of `work` at an unknown camera, watts.
    pub(crate) fn power(&self, work: &Work) -> f64 {
        self.prices.iter().zip(&work.0).map(|(price, work)| price * work).sum()
    }

    /// Power of `work` at a known camera, watts.
    pub(crate) fn power_at(&self, camera: usize, work: &Work) -> f64 {
        self.cameras.get(camera).copied().unwrap_or(1.0) * self.power(work)
    }

    /// Deviation of `readings` from the model's predictions.
    pub(crate) fn quality(&self, readings: &[CostReading]) -> FitQuality {
        let mut errors: Vec<f64> = readings
            .iter()
            .map(|reading| {
                (self.power_at(reading.camera, &reading.work) / reading.power_w - 1.0).abs()
            })
            .collect();
        errors.retain(|error| error.is_finite());
        errors.sort_by(f64::total_cmp);
        let count = errors.len();
        FitQuality {
            readings: count,
            mean_absolute_error: errors.iter().sum::<f64>() / count.max(1) as f64,
            ninth_decile: errors.get((0.9 * count as f64) as usize).copied().unwrap_or(0.0),
        }
    }

    /// The same by cross-validation: one reading in `folds` is held out in turn, regardless of
    /// camera and settings.
    pub(crate) fn cross_validated(readings: &[CostReading], folds: usize) -> FitQuality {
        let folds = folds.max(2);
        let split = |fold: usize, held_out: bool| -> Vec<CostReading> {
            // Hashed instead of every n-th, because readings are ordered by camera.
            let hash =
                |index: usize| (index as u32).wrapping_mul(2_654_435_769) as usize >> 8 & 0xffff;
            let readings = readings
                .iter()
                .enumerate()
                .filter(|(index, _)| (hash(*index) % folds == fold) == held_out);
            readings.map(|(_, reading)| reading.clone()).collect()
        };
        let all: Vec<FitQuality> = (0..folds)
            .map(|fold| Self::fit(&split(fold, false)).quality(&split(fold, true)))
            .collect();
        let count: usize = all.iter().map(|quality| quality.readings).sum();
        let mean = |value: fn(&FitQuality) -> f64| {
            all.iter().map(|quality| value(quality) * quality.readings as f64).sum::<f64>()
                / count.max(1) as f64
        };
        FitQuality {
            readings: count,
            mean_absolute_error: mean(|quality| quality.mean_absolute_error),
            ninth_decile: mean(|quality| quality.ninth_decile),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn readings(noise: f64) -> Vec<CostReading> {
        let factors = [1.0, 1.3, 0.8];
        let mut state = 1u64;
        let mut random = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 33) as f64 / (1u64 << 31) as f64 - 0.5
        };
        let mut all = Vec::new();
        for (camera, factor) in factors.into_iter().enumerate() {
            for settings in 0..40 {
                let work = vec![1.0, (settings % 5) as f64, ((settings / 5) % 4) as f64 * 10.0];
                let power = factor * (1.0 + 2.0 * work[1] + 0.3 * work[2]);
                all.push(CostReading {
                    camera,
                    work: Work(work),
                    power_w: power * (1.0 + 2.0 * noise * random()),
                });
            }
        }
        all
    }

    #[test]
    fn prices_and_camera_factors_are_separated() {
        let model = CostModel::fit(&readings(0.0));
        assert!(
            model.quality(&readings(0.0)).mean_absolute_error < 0.01,
            "{:?}",
            model.quality(&readings(0.0))
        );
        let ratio = |a: usize, b: usize| model.cameras[a] / model.cameras[b];
        assert!(
            (ratio(1, 0) - 1.3).abs() < 0.02 && (ratio(2, 0) - 0.8).abs() < 0.02,
            "{:?}",
            model.cameras
        );
    }

    #[test]
    fn noise_of_readings_averages_out() {
        let held_out = CostModel::fit(&readings(0.1)).quality(&readings(0.0)).mean_absolute_error;
        assert!(held_out < 0.03, "{held_out}, of readings that are off by 5 % in the mean");
        let crossed = CostModel::cross_validated(&readings(0.1), 5);
        assert!(
            crossed.readings == 120
                && crossed.mean_absolute_error > 0.02
                && crossed.mean_absolute_error < 0.08,
            "{crossed:?}"
        );
    }

    #[test]
    fn invalid_readings_are_left_out() {
        let mut all = readings(0.0);
        for power_w in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            all.push(CostReading { camera: 1, work: Work(vec![1.0, 1.0, 1.0]), power_w });
        }
        assert_eq!(CostModel::fit(&all), CostModel::fit(&readings(0.0)));
        let nothing = CostModel::fit(&[]);
        assert_eq!((nothing.power(&Work(vec![1.0])), nothing.quality(&[]).readings), (0.0, 0));
    }
}
