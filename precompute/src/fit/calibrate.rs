//! Which exchange rate keeps which error budget.

use bevy_frugal_gi::control::{Budget, select};
use bevy_frugal_gi::frontier::{ErrorRate, ErrorRates, Frontier};
use bevy_frugal_gi::knobs::RenderSettings;

/// Error budgets that are calibrated, times 0.001, 0.01 and 0.1: numbers that people type, a tenth
/// apart.
const BUDGETS: [f64; 23] = [
    1.0, 1.1, 1.2, 1.3, 1.5, 1.6, 1.8, 2.0, 2.2, 2.5, 2.8, 3.0, 3.3, 3.6, 4.0, 4.5, 5.0, 5.5, 6.0,
    6.5, 7.0, 8.0, 9.0,
];
/// From the noise of two renderings of the same settings to images that nobody would ship.
const RANGE: (f64, f64) = (0.0015, 0.2);
/// Rates that are tried, per decade.
const STEPS: i32 = 40;
/// Errors beyond this many budgets count as this many: what conformal risk control calls B. Higher
/// values leave more room, most where cameras are few. At 2, a map of 23 cameras had a tour's mean
/// at 0.0242 for a budget of 0.02: each switch drops the history of indirect light, which clips at
/// calibration cameras do not have.
const BOUND: f64 = 4.0;

/// One calibration camera: the frontier that the map gives it, and the error that each of its
/// settings has there.
pub struct Calibration<'a> {
    /// What the map says.
    pub frontier: &'a Frontier,
    /// What was rendered. `None` where it was not.
    pub error: &'a dyn Fn(RenderSettings) -> Option<f64>,
}

/// The least rate that keeps each budget, for `cameras` that took no part in what the map gives
/// them: calibration cameras, and training cameras with the frontiers that others make
/// (cross-conformal, Vovk 2015). Budgets that so few cameras cannot support, or that not even the
/// best settings keep, are left out. With `is_conformal` false, plain means: for comparison.
pub fn calibrate(cameras: &[Calibration<'_>], is_conformal: bool) -> ErrorRates {
    let count = cameras.len() as f64;
    let rates: Vec<f64> =
        (0..=9 * STEPS).map(|step| 10_f64.powf(f64::from(step) / f64::from(STEPS) - 2.0)).collect();
    let mut supported: Vec<ErrorRate> = Vec::new();
    let budgets =
        [1000.0, 100.0, 10.0].into_iter().flat_map(|part| BUDGETS.map(|budget| budget / part));
    for budget in budgets.filter(|budget| (RANGE.0..=RANGE.1).contains(budget)) {
        // Risk, and the mean of what was predicted.
        let played = |rate: f64| {
            let losses = cameras.iter().filter_map(|camera| {
                // As the controller picks.
                let picked = select(camera.frontier, &Budget::error(budget), Some(rate))?;
                Some(((camera.error)(picked.settings)?.min(BOUND * budget), picked.cost.error))
            });
            let add = |(loss, predicted, known): (f64, f64, f64), camera: (f64, f64)| {
                (loss + camera.0, predicted + camera.1, known + 1.0)
            };
            let (sum, predicted, known) = losses.fold((0.0, 0.0, 0.0), add);
            let risk = if is_conformal {
                (sum + BOUND * budget) / (known + 1.0)
            } else {
                sum / f64::max(known, 1.0)
            };
            (risk, predicted / f64::max(known, 1.0))
        };
        if count == 0.0 {
            continue;
        }
        // Risk falls as the rate rises, but for noise: the least rate from which on every greater
        // one keeps the budget.
        let kept = rates.iter().rev().take_while(|rate| played(**rate).0 <= budget).last();
        if let Some(rate) = kept {
            let predicted = played(*rate).1;
            let predicted = (predicted.is_finite() && predicted > 0.0).then_some(predicted);
            supported.push(ErrorRate { budget, watts_per_error: *rate, predicted });
        }
    }
    // Since no frame is predicted far over its budget, a smaller one may need the lower rate. It
    // then has the greater one's: a better image, never a worse one.
    let mut least = 0.0;
    for rate in supported.iter_mut().rev() {
        rate.watts_per_error = rate.watts_per_error.max(least);
        least = rate.watts_per_error;
    }
    ErrorRates(supported)
}
