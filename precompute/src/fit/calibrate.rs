//! Calibration of exchange rates to error budgets.

use bevy_frugal_gi::control::{Budget, select};
use bevy_frugal_gi::frontier::{ErrorRate, ErrorRates, Frontier};
use bevy_frugal_gi::knobs::KnobLevels;

/// Calibrated error budgets, times 0.001, 0.01 and 0.1: round numbers, about a tenth apart.
const BUDGETS: [f64; 23] = [
    1.0, 1.1, 1.2, 1.3, 1.5, 1.6, 1.8, 2.0, 2.2, 2.5, 2.8, 3.0, 3.3, 3.6, 4.0, 4.5, 5.0, 5.5, 6.0,
    6.5, 7.0, 8.0, 9.0,
];
/// From the noise of repeated renderings to errors that no app would ship.
const RANGE: (f64, f64) = (0.0015, 0.2);
/// Rates tried per decade.
const STEPS: i32 = 40;
/// Bound on the loss, in budgets: B of conformal risk control. Higher values leave a larger margin,
/// most where cameras are few. At 2, a map of 23 cameras gave a tour a mean error of 0.0242 for a
/// budget of 0.02.
const BOUND: f64 = 4.0;

/// One calibration camera: its frontier by the map, and the rendered error of each of the
/// frontier's settings.
pub(crate) struct Calibration<'a> {
    /// The frontier by the map.
    pub frontier: &'a Frontier,
    /// The rendered error; `None` where not rendered.
    pub error: &'a dyn Fn(KnobLevels) -> Option<f64>,
}

/// The least rate that keeps each budget, for `cameras` that did not contribute to their frontiers:
/// calibration cameras, and training cameras with cross-validated frontiers (cross-conformal, Vovk
/// 2015). Budgets that the number of cameras cannot support, or that even the best settings exceed,
/// are left out. With `is_conformal` false, plain means are used, for comparison.
pub(crate) fn calibrate(cameras: &[Calibration<'_>], is_conformal: bool) -> ErrorRates {
    let count = cameras.len() as f64;
    let rates: Vec<f64> =
        (0..=9 * STEPS).map(|step| 10_f64.powf(f64::from(step) / f64::from(STEPS) - 2.0)).collect();
    let mut supported: Vec<ErrorRate> = Vec::new();
    let budgets =
        [1000.0, 100.0, 10.0].into_iter().flat_map(|part| BUDGETS.map(|budget| budget / part));
    for budget in budgets.filter(|budget| (RANGE.0..=RANGE.1).contains(budget)) {
        // Risk, and mean prediction.
        let played = |rate: f64| {
            let losses = cameras.iter().filter_map(|camera| {
                // The controller's own selection.
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
        // Apart from noise, risk falls as the rate rises: takes the least rate above which every
        // rate keeps the budget.
        let kept = rates.iter().rev().take_while(|rate| played(**rate).0 <= budget).last();
        if let Some(rate) = kept {
            let predicted = played(*rate).1;
            let predicted = (predicted.is_finite() && predicted > 0.0).then_some(predicted);
            supported.push(ErrorRate { budget, watts_per_error: *rate, predicted });
        }
    }
    // Because single frames are limited too, a smaller budget may need a lower rate. It then takes
    // the rate of the greater budget: the image is better, never worse.
    let mut least = 0.0;
    for rate in supported.iter_mut().rev() {
        rate.watts_per_error = rate.watts_per_error.max(least);
        least = rate.watts_per_error;
    }
    ErrorRates(supported)
}
