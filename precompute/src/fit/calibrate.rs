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
/// Normal quantile of the confidence with which a budget's mean is kept: 90 %, one-sided. Higher values
/// leave a larger margin.
const QUANTILE: f64 = 1.2816;

/// One calibration camera: its frontier by the map, and the rendered error of each of the
/// frontier's settings.
pub(crate) struct Calibration<'a> {
    /// The frontier by the map.
    pub frontier: &'a Frontier,
    /// The rendered error; `None` where not rendered.
    pub error: &'a dyn Fn(KnobLevels) -> Option<f64>,
}

/// The least rate that keeps each budget, for `cameras` that did not contribute to their frontiers:
/// calibration cameras, and training cameras with cross-validated frontiers. `played` is the error
/// in play as a share of the cameras' own. Budgets that the cameras cannot support, or that even the
/// best settings exceed, are left out.
///
/// A budget is kept where the upper confidence bound of the mean error is within it (Bates,
/// Angelopoulos, Lei, Malik, Jordan 2021, "Distribution-free, risk-controlling prediction sets",
/// with the bound of the central limit theorem). Rejected: conformal risk control (Angelopoulos et
/// al. 2022), whose margin is a bound on the loss, divided by the number of cameras, whatever their
/// spread. With a bound of four budgets a quarter of the error stayed unspent on the courtyard's
/// tour from 0.015 on, and with one of two budgets the budget of 0.005 was exceeded by 3 and 14 %.
/// By their spread, two maps kept 14 of 14 budgets and used 73 to 96 % of them.
pub(crate) fn calibrate(cameras: &[Calibration<'_>], played: f64) -> ErrorRates {
    let rates: Vec<f64> =
        (0..=9 * STEPS).map(|step| 10_f64.powf(f64::from(step) / f64::from(STEPS) - 2.0)).collect();
    let mut supported: Vec<ErrorRate> = Vec::new();
    let budgets =
        [1000.0, 100.0, 10.0].into_iter().flat_map(|part| BUDGETS.map(|budget| budget / part));
    for budget in budgets.filter(|budget| (RANGE.0..=RANGE.1).contains(budget)) {
        // Bound of the error, and mean prediction.
        let outcome = |rate: f64| {
            let (errors, predictions): (Vec<f64>, Vec<f64>) = cameras
                .iter()
                .filter_map(|camera| {
                    // The controller's own selection.
                    let picked = select(camera.frontier, &Budget::error(budget), Some(rate))?;
                    Some(((camera.error)(picked.settings)? * played, picked.cost.error))
                })
                .unzip();
            (upper_bound(&errors), mean(&predictions))
        };
        // Apart from noise, errors fall as the rate rises: takes the least rate above which every
        // rate keeps the budget.
        let kept = rates.iter().rev().take_while(|rate| outcome(**rate).0 <= budget).last();
        if let Some(rate) = kept {
            let predicted = outcome(*rate).1;
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

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Upper confidence bound of the mean of what `values` are a sample of. Infinite for fewer than two,
/// which say nothing of the spread; NaN counts as infinite.
fn upper_bound(values: &[f64]) -> f64 {
    let freedom = values.len() as f64 - 1.0;
    if freedom < 1.0 {
        return f64::INFINITY;
    }
    let mean = mean(values);
    let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / freedom;
    // Student's quantile from the normal one (Cornish and Fisher 1937), to 3 % from two degrees of
    // freedom on.
    let z = QUANTILE;
    let student = z
        + (z.powi(3) + z) / (4.0 * freedom)
        + (5.0 * z.powi(5) + 16.0 * z.powi(3) + 3.0 * z) / (96.0 * freedom * freedom);
    let bound = mean + student * (variance / (freedom + 1.0)).sqrt();
    if bound.is_nan() { f64::INFINITY } else { bound }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bound_is_that_of_students_distribution() {
        // Quantiles of 90 % for 2, 4 and 9 degrees of freedom: 1.886, 1.533 and 1.383.
        for (count, quantile) in [(3_u32, 1.886), (5, 1.533), (10, 1.383)] {
            let values: Vec<f64> = (0..count).map(f64::from).collect();
            let n = f64::from(count);
            let deviation = (n * (n + 1.0) / 12.0).sqrt();
            let expected = (n - 1.0) / 2.0 + quantile * deviation / n.sqrt();
            let bound = upper_bound(&values);
            assert!((bound / expected - 1.0).abs() < 0.02, "{count}: {bound} and {expected}");
        }
        assert_eq!(upper_bound(&[0.3; 7]), 0.3);
        for (odd, why) in [
            (vec![], "none"),
            (vec![0.1], "one"),
            (vec![0.1, f64::NAN], "NaN"),
            (vec![0.1, f64::INFINITY], "infinite"),
        ] {
            assert_eq!(upper_bound(&odd), f64::INFINITY, "{why}");
        }
    }
}
