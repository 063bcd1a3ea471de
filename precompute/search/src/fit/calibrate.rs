//! Calibration of exchange rates to error budgets.

use frugal_core::frontier::{ErrorRate, ErrorRates, Frontier};

use crate::table::CostTable;

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

/// Standard deviation of what a camera's error differs from its prediction, as a part of a mean error,
/// before any is known. Higher values leave a larger margin where cameras are few.
const USUAL_SPREAD: f64 = 0.3;
/// The number of cameras' differences that it counts as: two cameras that happen to differ alike say
/// little of the spread.
const USUAL_COUNT: f64 = 2.0;

/// One calibration camera.
#[derive(Clone, Copy)]
pub(crate) struct Calibration<'a> {
    /// The frontier by the map.
    pub frontier: &'a Frontier,
    /// Rendered errors, and the camera's row there.
    pub table: &'a CostTable,
    pub row: usize,
}

/// The rate and the target that keep each budget, for `cameras` that did not contribute to their
/// frontiers: calibration cameras, and training cameras with cross-validated frontiers, those of a
/// track in the track's order. Budgets that the cameras cannot support, or that even the best
/// settings exceed, are left out.
///
/// At run time the controller keeps the mean *predicted* error at the target, whatever views come.
/// What is uncertain is the mean of what errors differ from their predictions. A target is kept
/// where it plus the upper confidence bound of that mean is within the budget (Bates, Angelopoulos,
/// Lei, Malik, Jordan 2021, "Distribution-free, risk-controlling prediction sets", with the bound of
/// the central limit theorem). Between two rates of a grid target and bound are interpolated: the
/// controller lets two settings take turns.
pub(crate) fn calibrate(cameras: &[Calibration<'_>]) -> ErrorRates {
    let outcome = |step: i32| {
        let rate = 10_f64.powf(f64::from(step) / f64::from(STEPS) - 2.0);
        let (predictions, differences): (Vec<f64>, Vec<f64>) = cameras
            .iter()
            .filter_map(|camera| {
                // The controller's own selection.
                let picked = camera.frontier.least_sum(rate)?;
                let error = camera.table.get(camera.row, picked.settings)?.error;
                Some((picked.cost.error, error - picked.cost.error))
            })
            .unzip();
        let predicted = mean(&predictions);
        let bound = predicted + upper_bound(&differences, USUAL_SPREAD * predicted);
        At { rate, predicted, bound }
    };
    let outcomes: Vec<At> = (0..=9 * STEPS).map(outcome).collect();
    let mut supported: Vec<ErrorRate> = Vec::new();
    let budgets =
        [1000.0, 100.0, 10.0].into_iter().flat_map(|part| BUDGETS.map(|budget| budget / part));
    for budget in budgets.filter(|budget| (RANGE.0..=RANGE.1).contains(budget)) {
        // Apart from noise, errors fall as the rate rises: takes the least rate above which every
        // rate keeps the budget.
        let exceeds = outcomes.iter().rposition(|at| at.bound.is_nan() || at.bound > budget);
        let Some(kept) = outcomes.get(exceeds.map_or(0, |at| at + 1)) else { continue };
        // The mean predicted error at which the bound reaches the budget, between this rate and the next
        // lower one, which exceeds it.
        let next = exceeds.map_or(kept, |at| &outcomes[at]);
        let share = (budget - kept.bound) / (next.bound - kept.bound);
        let more = (next.predicted - kept.predicted).max(0.0);
        let target =
            kept.predicted + if share.is_finite() { share.clamp(0.0, 1.0) * more } else { 0.0 };
        supported.push(ErrorRate {
            budget,
            watts_per_error: kept.rate,
            predicted: (target.is_finite() && target > 0.0).then_some(target),
        });
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

/// What a rate gives at the cameras.
struct At {
    rate: f64,
    /// Mean predicted error.
    predicted: f64,
    /// Upper confidence bound of the mean error.
    bound: f64,
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Upper confidence bound of the mean of what `values` are a sample of, in the order in which they
/// were taken along tracks. Infinite for fewer than two, which say nothing of the spread; NaN counts
/// as infinite.
///
/// Cameras lie evenly along tracks, so what changes slowly along a track does not make their mean
/// uncertain. The variance is that of differences between neighbours (von Neumann 1941; Wolter 2007,
/// "Introduction to variance estimation", section 8.2); of independent values it is the usual one. It is
/// averaged with the square of `usual`, which counts as [`USUAL_COUNT`] of them (the mode of an inverse
/// gamma prior; Gelman et al. 2013, "Bayesian data analysis", section 2.6).
fn upper_bound(values: &[f64], usual: f64) -> f64 {
    let count = values.len() as f64;
    if count < 2.0 {
        return f64::INFINITY;
    }
    let mean = mean(values);
    let squares = values.windows(2).map(|two| (two[1] - two[0]).powi(2)).sum::<f64>() / 2.0;
    let freedom = count - 1.0 + USUAL_COUNT;
    let variance = (squares + USUAL_COUNT * usual * usual) / freedom;
    // Student's quantile from the normal one (Cornish and Fisher 1937), to 3 % from two degrees of
    // freedom on.
    let z = QUANTILE;
    let student = z
        + (z.powi(3) + z) / (4.0 * freedom)
        + (5.0 * z.powi(5) + 16.0 * z.powi(3) + 3.0 * z) / (96.0 * freedom * freedom);
    let bound = mean + student * (variance / count).sqrt();
    if bound.is_nan() { f64::INFINITY } else { bound }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_changes_slowly_along_a_track_is_no_uncertainty() {
        // A ramp, in its order and in one that is as good as random: the usual variance.
        let ramp: Vec<f64> = (0..101).map(|index| f64::from(index) / 100.0).collect();
        let mixed: Vec<f64> = (0..101).map(|index| f64::from(index * 37 % 101) / 100.0).collect();
        let margin = |values: &[f64]| upper_bound(values, 0.0) - 0.5;
        let usual = 1.29 * (1.0_f64 / 12.0 / 101.0).sqrt();
        assert!(margin(&ramp) < 0.05 * usual, "{}", margin(&ramp));
        assert!((margin(&mixed) / usual - 1.0).abs() < 0.3, "{} and {usual}", margin(&mixed));
    }

    #[test]
    fn the_bound_is_that_of_students_distribution() {
        // Quantiles of 90 % for 4, 6 and 11 degrees of freedom: 1.533, 1.440 and 1.363.
        for (count, quantile) in [(3_u32, 1.533), (5, 1.440), (10, 1.363)] {
            // Neighbours differ by 1: half of the mean square difference is 0.5, as is the usual one.
            let values: Vec<f64> = (0..count).map(f64::from).collect();
            let n = f64::from(count);
            let expected = (n - 1.0) / 2.0 + quantile * (0.5 / n).sqrt();
            let bound = upper_bound(&values, 0.5_f64.sqrt());
            assert!((bound / expected - 1.0).abs() < 0.02, "{count}: {bound} and {expected}");
        }
        assert_eq!(upper_bound(&[0.3; 7], 0.0), 0.3);
        for (odd, why) in [
            (vec![], "none"),
            (vec![0.1], "one"),
            (vec![0.1, f64::NAN], "NaN"),
            (vec![0.1, f64::INFINITY], "infinite"),
        ] {
            assert_eq!(upper_bound(&odd, 0.01), f64::INFINITY, "{why}");
        }
    }

    #[test]
    fn two_cameras_that_agree_by_chance_leave_a_margin_and_many_hardly_any() {
        let margin = |count: usize| upper_bound(&vec![0.02; count], USUAL_SPREAD * 0.02) / 0.02;
        assert!((1.25..1.4).contains(&margin(2)), "{}", margin(2));
        assert!(margin(30) < 1.03 && margin(30) > 1.0, "{}", margin(30));
    }
}
