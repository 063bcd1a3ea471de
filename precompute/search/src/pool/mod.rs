//! The pool: a few dozen settings that suit all cameras between them.
//!
//! Results of one camera carry over to all others. [`screening_settings`] lowers each knob alone,
//! at a few pilot cameras; [`propose`] searches models of power and error by NSGA-II for the
//! settings to render next; [`portfolio`] keeps the settings whose loss would cost cameras most
//! (Xu, Hoos, Leyton-Brown 2010, "Hydra"). Independent of the renderer.
mod error_model;
mod portfolio;
mod propose;
mod screening;

use std::ops::Range;

use frugal_core::frontier::CostPoint;

pub(crate) use error_model::ErrorModel;
pub(crate) use portfolio::portfolio;
pub(crate) use propose::propose;
pub(crate) use screening::{Screening, screening_settings};

/// Errors below this are visually equal.
pub(crate) const LEAST_ERROR: f64 = 1e-3;

/// Exchange rates, in units of the best settings' power per unit of error: those of error budgets
/// from a few hundredths to a few thousandths.
const RATES: [f64; 8] = [4.0, 8.0, 16.0, 32.0, 64.0, 128.0, 256.0, 512.0];
/// Number of power budgets, evenly spread over the range of power.
const POWER_BUDGETS: usize = 19;
/// The least power budget, as a share of the range: cheaper settings have errors that no app would
/// ship.
const LEAST_POWER_BUDGET: f64 = 0.1;
/// Error budgets, 1 − SSIM: where apps have theirs.
const ERROR_BUDGETS: [f64; 9] = [0.003, 0.005, 0.0075, 0.01, 0.015, 0.02, 0.03, 0.05, 0.1];
/// The greatest possible 1 − SSIM: what counts as the error within a power budget that no settings
/// keep.
const MOST_ERROR: f64 = 2.0;

/// What budgets ask of settings: the scores of a cost at every goal, lower is better. Settings are proposed
/// and kept for them. `range`: power of the cheapest and of the best settings, in any unit; above 0.
///
/// At each exchange rate a score is the logarithm of power + rate × error, at each power budget that of
/// the error, and at each error budget that of the power. Where a budget is exceeded they count as the
/// greatest error, or as the best settings' power. In logarithms a tenth of the power and a tenth of the
/// error weigh alike at every budget. Error budgets have goals of their own, since power budgets have
/// gaps: they are a twentieth of the range apart, which at the cheap end is a fifth of the power.
///
/// Equal weights lost least on views held out.
fn scores<'a>(range: &'a Range<f64>, cost: &'a CostPoint) -> impl Iterator<Item = f64> + 'a {
    let power = cost.power.0 / range.end;
    let rates = RATES.iter().map(move |rate| (power + rate * cost.error).ln());
    let [error, most] = [cost.error.min(MOST_ERROR), MOST_ERROR].map(|e| (e + LEAST_ERROR).ln());
    let within = (0..POWER_BUDGETS)
        .map(move |step| if cost.power.0 <= power_budget(range, step) { error } else { most });
    let less = power.ln().min(0.0);
    let errors =
        ERROR_BUDGETS.iter().map(move |budget| if cost.error <= *budget { less } else { 0.0 });
    rates.chain(within).chain(errors)
}

fn power_budget(Range { start, end }: &Range<f64>, step: usize) -> f64 {
    let share =
        LEAST_POWER_BUDGET + (1.0 - LEAST_POWER_BUDGET) * step as f64 / (POWER_BUDGETS - 1) as f64;
    // The best settings keep the last budget, however sums are rounded.
    (start + (end - start) * share) * (1.0 + 1e-9)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scores(power: f64, error: f64) -> Vec<f64> {
        super::scores(&(1.0..10.0), &CostPoint::new(power, error)).collect()
    }

    #[test]
    fn less_power_or_less_error_is_never_worse_and_always_better_somewhere() {
        let costs = [(1.0, 0.5), (1.5, 0.2), (2.2, 0.045), (4.0, 0.019), (7.0, 0.009), (10.0, 0.0)];
        for (power, error) in costs {
            let here = scores(power, error);
            for better in [scores(0.9 * power, error), scores(power, 0.5 * error - 1e-4)] {
                let pairs = || here.iter().zip(&better);
                assert!(pairs().all(|(here, better)| better <= here), "{power} {error}");
                assert!(pairs().any(|(here, better)| better < here), "{power} {error}");
            }
        }
    }

    #[test]
    fn a_tenth_less_power_counts_between_two_power_budgets() {
        // Both keep the power budgets from 2.35 on.
        let [more, less] = [2.3, 2.1].map(|power| scores(power, 0.04));
        let goals = RATES.len() + POWER_BUDGETS;
        assert_eq!(more[RATES.len()..goals], less[RATES.len()..goals]);
        let gain = more[goals..].iter().zip(&less[goals..]).map(|(more, less)| more - less);
        assert!((gain.sum::<f64>() - 2.0 * (2.3_f64 / 2.1).ln()).abs() < 1e-12);
    }

    #[test]
    fn scores_are_finite_at_the_extremes() {
        for (power, error) in [(1e-30, 0.0), (1e30, 2.0), (1.0, 1e30), (10.0, 0.0)] {
            let scores = scores(power, error);
            assert!(scores.iter().all(|score| score.is_finite()), "{power} {error}: {scores:?}");
        }
    }
}
