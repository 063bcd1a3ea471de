//! Cost of a frame: the work of its settings, and a fitted price of each kind of work. Independent
//! of the renderer.
//!
//! Meter readings are noisy, and drift. Work is exact: pixels, VPL–pixel pairs, rays, shadow
//! texels. A model of few prices, fitted to all readings of a run, predicts power better than a
//! reading over two frames does, and also that of settings that were never rendered.
mod nnls;
mod plan;
mod reprice;
mod shared;
mod work;

use frugal_core::units::Watts;

use nnls::nonnegative_least_squares;
pub use plan::reading_plan;
pub use reprice::{DeviceModel, NewConditions, price, reprice};
pub(crate) use shared::saved_joules;
use shared::with_shared_knobs;
pub use shared::{SHARED_KNOBS, work_prices};
pub use work::{
    FrameLayout, MAX_VPLS_PER_PIXEL, POINT_LIGHT_MAPS, VISIBILITY_RAYS, Work, work_names,
};

/// Alternating rounds of fitting prices and camera factors.
const ROUNDS: usize = 6;
/// Prior weight, in readings, of a camera factor of 1.
const CAMERA_PRIOR: f64 = 1.0;
/// Folds of the cross-validation.
const FOLDS: usize = 5;

/// A reading of the meter.
#[derive(Clone, Debug, PartialEq)]
pub struct CostReading {
    /// Number of the camera.
    pub camera: usize,
    /// Work of the frame.
    pub work: Work,
    /// Watts at the target frame rate, above 0.
    pub power_w: f64,
}

/// P = idle + `exp(u_camera)` · Σ βⱼ xⱼ: prices β ≥ 0 of work x, in watts at the target frame rate,
/// and a factor for each camera.
///
/// Idle power is measured apart: at one frame rate a fit cannot tell it from what every frame costs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CostModel {
    /// Watts of the idle device, 0 or more.
    pub idle: Watts,
    /// Watts per unit of each kind of work per frame.
    pub prices: Vec<f64>,
    /// exp(u) by camera.
    cameras: Vec<f64>,
}

impl CostModel {
    /// Fits prices and camera factors in alternation, minimising relative errors. Readings that are
    /// not finite and above 0 are left out. An `idle` power above the least of them counts as that.
    pub fn fit(readings: &[CostReading], idle: Watts) -> Self {
        let valid: Vec<_> = readings
            .iter()
            .filter(|reading| reading.power_w.is_finite() && reading.power_w > 0.0)
            .collect();
        let least = valid.iter().map(|reading| reading.power_w).fold(f64::INFINITY, f64::min);
        let idle = Watts(idle.0.max(0.0).min(if valid.is_empty() { 0.0 } else { least }));
        let cameras = valid.iter().map(|reading| reading.camera + 1).max().unwrap_or(0);
        let mut model = Self { idle, prices: Vec::new(), cameras: vec![1.0; cameras] };
        let beyond = |reading: &CostReading| reading.power_w - idle.0;
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
            let shares: Vec<f64> =
                valid.iter().map(|reading| beyond(reading) / reading.power_w).collect();
            model.prices = nonnegative_least_squares(&rows, &shares);
            let mut logarithms = vec![(0.0, CAMERA_PRIOR); cameras];
            for reading in &valid {
                let ratio = beyond(reading) / model.beyond_idle(&reading.work);
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
    pub fn power(&self, work: &Work) -> f64 {
        self.idle.0 + self.beyond_idle(work)
    }

    /// Power of `work` at a known camera, watts.
    pub fn power_at(&self, camera: usize, work: &Work) -> f64 {
        self.idle.0 + self.cameras.get(camera).copied().unwrap_or(1.0) * self.beyond_idle(work)
    }

    fn beyond_idle(&self, work: &Work) -> f64 {
        self.prices.iter().zip(&work.0).map(|(price, work)| price * work).sum()
    }

    /// Deviations of `readings` from the model's predictions.
    fn errors<'a>(&'a self, readings: &'a [CostReading]) -> impl Iterator<Item = f64> + 'a {
        readings.iter().map(|reading| {
            (self.power_at(reading.camera, &reading.work) / reading.power_w - 1.0).abs()
        })
    }

    /// Mean of |predicted ÷ read − 1| by cross-validation: a fifth of the readings is held out in turn,
    /// regardless of camera and settings.
    pub fn cross_validated(readings: &[CostReading], idle: Watts) -> f64 {
        let split = |fold: usize, held_out: bool| -> Vec<CostReading> {
            // Hashed instead of every n-th, because readings are ordered by camera.
            let hash =
                |index: usize| (index as u32).wrapping_mul(2_654_435_769) as usize >> 8 & 0xffff;
            let readings = readings
                .iter()
                .enumerate()
                .filter(|(index, _)| (hash(*index) % FOLDS == fold) == held_out);
            readings.map(|(_, reading)| reading.clone()).collect()
        };
        let errors = |fold: usize| -> Vec<f64> {
            Self::fit(&split(fold, false), idle).errors(&split(fold, true)).collect()
        };
        mean((0..FOLDS).flat_map(errors))
    }
}

/// Numbers that are not finite are left out.
fn mean(errors: impl Iterator<Item = f64>) -> f64 {
    let finite: Vec<f64> = errors.filter(|error| error.is_finite()).collect();
    finite.iter().sum::<f64>() / finite.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(model: &CostModel, readings: &[CostReading]) -> f64 {
        mean(model.errors(readings))
    }

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
        let model = CostModel::fit(&readings(0.0), Watts(0.0));
        assert!(error(&model, &readings(0.0)) < 0.01, "{:?}", error(&model, &readings(0.0)));
        let ratio = |a: usize, b: usize| model.cameras[a] / model.cameras[b];
        assert!(
            (ratio(1, 0) - 1.3).abs() < 0.02 && (ratio(2, 0) - 0.8).abs() < 0.02,
            "{:?}",
            model.cameras
        );
    }

    #[test]
    fn idle_power_is_not_shared_out() {
        let idle = Watts(40.0);
        let with_idle = |mut reading: CostReading| {
            reading.power_w += idle.0;
            reading
        };
        let all: Vec<_> = readings(0.0).into_iter().map(with_idle).collect();
        let (model, without) =
            (CostModel::fit(&all, idle), CostModel::fit(&readings(0.0), Watts(0.0)));
        assert_eq!(model.idle, idle);
        // Prices and cameras' factors share a scale.
        for (price, expected) in model.prices.iter().zip(&without.prices) {
            let (found, expected) = (price / model.prices[0], expected / without.prices[0]);
            assert!((found / expected - 1.0).abs() < 0.01, "{model:?}, {without:?}");
        }
        assert!(error(&model, &all) < 0.001, "{model:?}");
        // A device that was busy when it should have been idle.
        let least = all.iter().map(|it| it.power_w).fold(f64::INFINITY, f64::min);
        for (idle, expected) in [(1e9, least), (f64::NAN, 0.0), (-3.0, 0.0)] {
            let model = CostModel::fit(&all, Watts(idle));
            assert_eq!(model.idle.0, expected);
            assert!(model.prices.iter().all(|price| price.is_finite()), "{model:?}");
        }
        assert_eq!(CostModel::fit(&[], idle).idle.0, 0.0);
    }

    #[test]
    fn noise_of_readings_averages_out() {
        let model = CostModel::fit(&readings(0.1), Watts(0.0));
        let held_out = error(&model, &readings(0.0));
        assert!(held_out < 0.03, "{held_out}, of readings that are off by 5 % in the mean");
        let crossed = CostModel::cross_validated(&readings(0.1), Watts(0.0));
        assert!((0.02..0.08).contains(&crossed), "{crossed}");
    }

    #[test]
    fn invalid_readings_are_left_out() {
        let mut all = readings(0.0);
        for power_w in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            all.push(CostReading { camera: 1, work: Work(vec![1.0, 1.0, 1.0]), power_w });
        }
        assert_eq!(CostModel::fit(&all, Watts(0.0)), CostModel::fit(&readings(0.0), Watts(0.0)));
        let nothing = CostModel::fit(&[], Watts(0.0));
        assert_eq!((nothing.power(&Work(vec![1.0])), error(&nothing, &[])), (0.0, 0.0));
    }
}
