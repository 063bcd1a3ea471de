//! Errors of settings that a camera has not rendered, from those that it has.
//!
//! A view with a high error at one setting tends to have high errors at others. So a few cameras
//! render every setting of the pool, and all others only the *anchors*, a quarter of the pool.
//!
//! The logarithms of errors are modelled as normally distributed over cameras. Few cameras say
//! little of their covariance, so it is averaged with a prior: settings of similar levels have
//! correlated errors (shrinkage towards a structured target; Ledoit, Wolf 2004, "A well-conditioned
//! estimator for large-dimensional covariance matrices"). Anchors are chosen one by one, each to
//! leave the least variance of all settings (pivoted Cholesky factorisation; Harbrecht, Peters,
//! Schneider 2012, "On the low-rank approximation by the pivoted Cholesky decomposition"). All
//! others get their conditional mean. Without the prior, that would be the maximum-likelihood
//! estimate (Anderson 1957, "Maximum likelihood estimates for a multivariate normal distribution
//! when some observations are missing").

use frugal_core::frontier::CostPoint;
use frugal_core::knobs::{KnobLevels, KnobSpace};

use crate::pool::LEAST_ERROR;
use crate::table::CostTable;

/// Variance of a logarithm that other settings do not explain: noise of a rendering. Higher values
/// rely more on means, which few cameras need.
const NOISE: f64 = 0.02;

/// Number of cameras that the prior covariance counts as. Higher values rely more on settings' levels.
const PRIOR_ROWS: f64 = 6.0;
/// Squared difference of levels, summed over knobs as shares of each knob's range, at which the prior
/// correlation is e^−½.
const PRIOR_REACH: f64 = 1.0;
/// Variance below which errors do not differ between cameras: the best settings have none.
const NO_VARIANCE: f64 = 1e-9;
/// Least number of cameras that have rendered all settings.
const LEAST_ROWS: usize = 3;

/// Predicts errors of all settings from those of the anchors.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Completion {
    settings: Vec<KnobLevels>,
    /// Mean logarithm of each setting's error.
    mean: Vec<f64>,
    /// Index of each anchor, and what one unit of its deviation adds to every setting.
    steps: Vec<(usize, Vec<f64>)>,
    /// Variance of each setting's logarithm that the anchors leave.
    variance: Vec<f64>,
}

impl Completion {
    /// From the rows of `table` with all of `settings` of `space`, with at most `anchors`. `None` for
    /// fewer than three rows, and where there is nothing to save.
    pub(crate) fn fit(
        space: &KnobSpace,
        table: &CostTable,
        settings: &[KnobLevels],
        anchors: usize,
    ) -> Option<Self> {
        let row = |row: usize| -> Option<Vec<f64>> {
            settings
                .iter()
                .map(|settings| Some(logarithm(table.get(row, *settings)?.error)))
                .collect()
        };
        let rows: Vec<Vec<f64>> = (0..table.rows()).filter_map(row).collect();
        let count = rows.len() as f64;
        if anchors == 0 || rows.len() < LEAST_ROWS || settings.len() <= anchors {
            return None;
        }
        let mean: Vec<f64> = (0..settings.len())
            .map(|column| rows.iter().map(|row| row[column]).sum::<f64>() / count)
            .collect();
        let mut rest = covariance(&rows, &mean, |a, b| likeness(space, settings[a], settings[b]));
        let mut steps = Vec::new();
        for _ in 0..anchors {
            // The one that explains most of what remains.
            let gain = |column: &usize| {
                rest.iter().map(|of| of[*column].powi(2)).sum::<f64>() / rest[*column][*column]
            };
            let is_new = |column: &usize| steps.iter().all(|(known, _)| known != column);
            let best = (0..settings.len())
                .filter(|column| is_new(column) && rest[*column][*column] > NOISE * 1.01)
                .max_by(|a, b| gain(a).total_cmp(&gain(b)));
            let Some(best) = best else { break };
            let step: Vec<f64> = rest.iter().map(|of| of[best] / rest[best][best]).collect();
            let explained = rest[best].clone();
            for (of, share) in rest.iter_mut().zip(&step) {
                of.iter_mut().zip(&explained).for_each(|(value, part)| *value -= share * part);
            }
            steps.push((best, step));
        }
        let of_residual = |(index, of): (usize, &Vec<f64>)| (of[index] - NOISE).max(0.0);
        let variance = rest.iter().enumerate().map(of_residual).collect();
        Some(Self { settings: settings.to_vec(), mean, steps, variance })
    }

    /// The settings that every camera renders.
    pub(crate) fn anchors(&self) -> Vec<KnobLevels> {
        self.steps.iter().map(|(anchor, _)| self.settings[*anchor]).collect()
    }

    /// Fills in, in every row of `table` with all anchors, the errors of the other settings;
    /// `power_w`: their power, by row and setting. Rows without an anchor stay as they are.
    pub(crate) fn complete(
        &self,
        table: &CostTable,
        power_w: impl Fn(usize, KnobLevels) -> f64,
    ) -> CostTable {
        let mut complete = table.clone();
        for row in 0..table.rows() {
            let Some(predicted) = self.logarithms(|settings| Some(table.get(row, settings)?.error))
            else {
                continue;
            };
            for (index, settings) in self.settings.iter().enumerate() {
                if table.get(row, *settings).is_none() {
                    // Budgets limit arithmetic means: the mean of a log-normal error.
                    let error = (predicted[index] + self.variance[index] / 2.0).exp() - LEAST_ERROR;
                    let cost = CostPoint::new(power_w(row, *settings), error.clamp(0.0, 2.0));
                    complete.set(row, *settings, cost);
                }
            }
        }
        complete
    }

    /// Expected logarithms of all settings' errors, given those of the anchors.
    fn logarithms(&self, error: impl Fn(KnobLevels) -> Option<f64>) -> Option<Vec<f64>> {
        let mut expected = self.mean.clone();
        for (anchor, step) in &self.steps {
            let beyond = logarithm(error(self.settings[*anchor])?) - expected[*anchor];
            expected.iter_mut().zip(step).for_each(|(value, share)| *value += share * beyond);
        }
        Some(expected)
    }
}

fn logarithm(error: f64) -> f64 {
    (error + LEAST_ERROR).ln()
}

/// Prior correlation of two settings' errors (squared exponential; Rasmussen, Williams 2006, "Gaussian
/// processes for machine learning", equation 4.9).
fn likeness(space: &KnobSpace, a: KnobLevels, b: KnobLevels) -> f64 {
    let apart = space.knobs().iter().enumerate().map(|(knob, described)| {
        let top = described.levels.len().saturating_sub(1).max(1) as f64;
        ((a.level(knob) as f64 - b.level(knob) as f64) / top).powi(2)
    });
    (-0.5 * apart.sum::<f64>() / PRIOR_REACH).exp()
}

/// Covariance of the columns: that of the rows, averaged with a prior of the columns' `likeness`, and
/// [`NOISE`] of each alone.
fn covariance(
    rows: &[Vec<f64>],
    mean: &[f64],
    likeness: impl Fn(usize, usize) -> f64,
) -> Vec<Vec<f64>> {
    let freedom = rows.len() as f64 - 1.0;
    let sum = |a: usize, b: usize| {
        rows.iter().map(|row| (row[a] - mean[a]) * (row[b] - mean[b])).sum::<f64>()
    };
    let variances: Vec<f64> = (0..mean.len()).map(|column| sum(column, column) / freedom).collect();
    let varies = |column: usize| variances[column] > NO_VARIANCE;
    let varying = variances.iter().filter(|variance| **variance > NO_VARIANCE);
    let (total, count) = varying.fold((0.0, 0.0_f64), |(sum, count), of| (sum + of, count + 1.0));
    let usual = total / count.max(1.0);
    let of = |a: usize, b: usize| {
        let prior = if varies(a) && varies(b) { usual * likeness(a, b) } else { 0.0 };
        (sum(a, b) + PRIOR_ROWS * prior) / (freedom + PRIOR_ROWS) + if a == b { NOISE } else { 0.0 }
    };
    (0..mean.len()).map(|a| (0..mean.len()).map(|b| of(a, b)).collect()).collect()
}

#[cfg(test)]
mod tests {
    use frugal_core::knobs::Knob;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    const SETTINGS: u128 = 12;

    fn settings() -> Vec<KnobLevels> {
        (0..SETTINGS).map(KnobLevels::from_bits).collect()
    }

    fn space() -> KnobSpace {
        let levels = (0..SETTINGS).map(|level| level as f64);
        KnobSpace::new(vec![Knob::new("quality", levels)]).expect("a valid space")
    }

    fn fitted(table: &CostTable, count: usize, anchors: usize) -> Option<Completion> {
        Completion::fit(&space(), table, &settings()[..count], anchors)
    }

    /// Mean square of what completed logarithms differ from those of `table`, at rows from `full` on.
    fn lost(table: &CostTable, full: usize) -> f64 {
        let first: Vec<usize> = (0..full).collect();
        let completion = fitted(&table.with_rows(&first), SETTINGS as usize, 3).expect("rows");
        let complete = completion.complete(&thinned(table, &completion, full), |_, _| 1.0);
        let ln =
            |table: &CostTable, row, one| table.get(row, one).map(|cost| logarithm(cost.error));
        let rows =
            (full..table.rows()).flat_map(|row| settings().into_iter().map(move |one| (row, one)));
        let squares: Vec<f64> = rows
            .filter_map(|(row, one)| {
                Some((ln(&complete, row, one)? - ln(table, row, one)?).powi(2))
            })
            .collect();
        squares.iter().sum::<f64>() / squares.len() as f64
    }

    /// Errors by two properties of each view, which settings feel differently, and noise of
    /// `noise`. The last settings are the best, without error.
    fn cameras(count: usize, noise: f64, seed: u64) -> CostTable {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut uniform = || random.random_range(-1.0..1.0);
        let mut table = CostTable::new(count);
        for row in 0..count {
            let (a, b) = (uniform(), uniform());
            for (index, settings) in settings().into_iter().enumerate() {
                let part = index as f64 / SETTINGS as f64;
                let ln = -4.0 + part + (1.0 - part) * a + part * b + noise * uniform();
                let error = if index + 1 == SETTINGS as usize { 0.0 } else { ln.exp() };
                table.set(row, settings, CostPoint::new(1.0, error));
            }
        }
        table
    }

    /// Only the anchors of rows from `full` on.
    fn thinned(table: &CostTable, completion: &Completion, full: usize) -> CostTable {
        let mut thin = CostTable::new(table.rows());
        for row in 0..table.rows() {
            for settings in settings() {
                if row < full || completion.anchors().contains(&settings) {
                    thin.set(row, settings, table.get(row, settings).expect("known"));
                }
            }
        }
        thin
    }

    #[test]
    fn errors_that_are_not_rendered_follow_from_the_anchors() {
        let table = cameras(300, 0.1, 1);
        let first: Vec<usize> = (0..24).collect();
        let completion = fitted(&table.with_rows(&first), SETTINGS as usize, 3).expect("rows");
        assert_eq!(completion.anchors().len(), 3);
        let thin = thinned(&table, &completion, 24);
        let complete = completion.complete(&thin, |_, settings| settings.bits() as f64);
        let (mut squares, mut spread, mut count) = (0.0, 0.0, 0.0);
        for (index, one) in settings().into_iter().enumerate() {
            let mean = |table: &CostTable| {
                table.mean(index, 24..300).map(|cost| cost.error).expect("complete")
            };
            // Errors average without bias, as budgets need it.
            let (found, expected) = (mean(&complete), mean(&table));
            assert!((found - expected).abs() <= 0.06 * expected + 1e-12, "{found} for {expected}");
            for row in 24..300 {
                let (found, expected) = (complete.get(row, one), table.get(row, one));
                let (found, expected) = (found.expect("complete"), expected.expect("known"));
                if completion.anchors().contains(&one) {
                    assert_eq!(found, expected, "rendered errors stay");
                    continue;
                }
                assert_eq!(found.power.0, one.bits() as f64);
                squares += (logarithm(found.error) - logarithm(expected.error)).powi(2);
                spread += (logarithm(expected.error) - completion.mean[index]).powi(2);
                count += 1.0;
            }
        }
        assert!(count > 2000.0 && squares < 0.1 * spread, "{squares} of {spread}");
    }

    #[test]
    fn few_cameras_go_far_because_settings_that_are_alike_go_together() {
        let table = cameras(300, 0.1, 4);
        let spread = lost(&table, 24);
        let of_three = lost(&table, 3);
        // The noise of a rendering alone is 0.0033; the spread of errors between cameras is 0.2.
        assert!(spread < 0.02 && of_three < 0.05, "{spread} and {of_three}");
    }

    #[test]
    fn too_few_cameras_and_equal_settings_complete_nothing() {
        let table = cameras(8, 0.1, 2);
        let all = SETTINGS as usize;
        assert_eq!(fitted(&table.with_rows(&[0, 1]), all, 4), None, "two cameras");
        assert_eq!(fitted(&table, all, 0), None);
        assert_eq!(fitted(&table, 3, 3), None, "nothing to save");
        assert_eq!(fitted(&CostTable::new(0), all, 2), None);
        // Errors that do not vary need no anchor: each has its mean.
        let mut flat = CostTable::new(9);
        for row in 0..9 {
            for (index, settings) in settings().into_iter().enumerate() {
                flat.set(row, settings, CostPoint::new(1.0, 0.01 * index as f64));
            }
        }
        let completion = fitted(&flat, all, 3).expect("rows");
        assert!(completion.anchors().is_empty());
        let complete = completion.complete(&CostTable::new(1), |_, _| 2.0);
        let error = complete.get(0, settings()[5]).expect("complete").error;
        assert!((error / 0.05 - 1.0).abs() < 0.05, "{error}");
    }

    #[test]
    fn extreme_errors_stay_in_range() {
        let completion = fitted(&cameras(24, 0.1, 3), SETTINGS as usize, 3).expect("rows");
        for error in [0.0, 1e-300, 2.0, f64::INFINITY, f64::NAN] {
            let mut table = CostTable::new(1);
            for anchor in completion.anchors() {
                table.set(0, anchor, CostPoint::new(1.0, error));
            }
            let complete = completion.complete(&table, |_, _| 1.0);
            for settings in settings() {
                let Some(found) = complete.get(0, settings) else { continue };
                // Rendered errors stay as they are.
                let is_rendered = completion.anchors().contains(&settings);
                assert!(is_rendered || (0.0..=2.0).contains(&found.error), "{}", found.error);
            }
        }
    }
}
