//! Prediction of the errors of settings that were not rendered.
//!
//! The prior mean is the sum of the single effects of the lowered knobs. A Gaussian process over
//! the residuals learns interactions of knobs (Rasmussen and Williams 2006, "Gaussian Processes for
//! Machine Learning", algorithm 2.1). Distances between settings measure a knob's levels by their
//! effect, so levels of similar images are near.

use frugal_core::knobs::{KnobLevels, KnobSpace};

use super::{LEAST_ERROR, Screening};
use crate::linalg::{cholesky, dot, forward, solve};

/// Prior standard deviation of the logarithm of an error about the sum of single effects.
const SPREAD: f64 = 0.6;
/// Standard deviation of the logarithm of a reading.
const NOISE: f64 = 0.05;
/// Candidate length scales, in units of the logarithm of a knob's effect.
const LENGTHS: [f64; 4] = [1.0, 2.0, 4.0, 8.0];

/// Predicts the logarithm of a mean error.
#[derive(Clone, Debug)]
pub(crate) struct ErrorModel<'a> {
    space: &'a KnobSpace,
    screening: &'a Screening,
    length: f64,
    known: Vec<Vec<f64>>,
    /// K⁻¹ (y − prior).
    weights: Vec<f64>,
    /// The lower triangle of K's Cholesky decomposition.
    factor: Vec<Vec<f64>>,
}

impl<'a> ErrorModel<'a> {
    /// Fits mean errors of settings; errors that are not finite are left out.
    pub(crate) fn fit(
        space: &'a KnobSpace,
        screening: &'a Screening,
        readings: &[(KnobLevels, f64)],
    ) -> Self {
        let finite: Vec<_> = readings.iter().filter(|(_, error)| error.is_finite()).collect();
        let known: Vec<Vec<f64>> =
            finite.iter().map(|(settings, _)| coordinates(space, screening, *settings)).collect();
        let left: Vec<f64> = finite
            .iter()
            .map(|(settings, error)| {
                (error.max(0.0) + LEAST_ERROR).ln() - prior(space, screening, *settings)
            })
            .collect();
        let fits = LENGTHS.iter().filter_map(|length| {
            let factor = cholesky(&covariance(&known, *length))?;
            let weights = solve(&factor, &left);
            // Log marginal likelihood of the readings, up to a constant.
            let fit = dot(&left, &weights);
            let volume: f64 = factor.iter().enumerate().map(|(index, row)| row[index].ln()).sum();
            Some((0.5 * fit + volume, *length, weights, factor))
        });
        let best = fits.min_by(|a, b| a.0.total_cmp(&b.0));
        let (_, length, weights, factor) = best.unwrap_or((0.0, 1.0, Vec::new(), Vec::new()));
        Self { space, screening, length, known, weights, factor }
    }

    /// Mean and standard deviation of ln(error + [`LEAST_ERROR`]).
    pub(crate) fn predict(&self, settings: KnobLevels) -> (f64, f64) {
        let at = coordinates(self.space, self.screening, settings);
        let near: Vec<f64> =
            self.known.iter().map(|known| kernel(known, &at, self.length)).collect();
        let mean = prior(self.space, self.screening, settings) + dot(&near, &self.weights);
        let explained: f64 = forward(&self.factor, &near).iter().map(|v| v * v).sum();
        (mean, (SPREAD * SPREAD - explained).max(0.0).sqrt())
    }
}

/// Effects of the knobs that act, by knob.
fn effects<'s>(
    space: &'s KnobSpace,
    screening: &'s Screening,
    settings: KnobLevels,
) -> impl Iterator<Item = f64> + 's {
    let canonical = space.canonical(settings);
    (0..space.len()).map(move |knob| {
        let levels = space.knobs()[knob].levels.len();
        // An inactive knob counts as level 0, whatever its setting.
        let acts = canonical.level(knob) > 0
            || levels > 1 && space.canonical(canonical.with_level(knob, 1)) != canonical;
        if acts {
            screening.effects[knob].get(canonical.level(knob)).copied().unwrap_or(0.0)
        } else {
            0.0
        }
    })
}

fn prior(space: &KnobSpace, screening: &Screening, settings: KnobLevels) -> f64 {
    (effects(space, screening, settings).sum::<f64>() + LEAST_ERROR).ln()
}

/// Coordinates of settings: one for each knob.
fn coordinates(space: &KnobSpace, screening: &Screening, settings: KnobLevels) -> Vec<f64> {
    effects(space, screening, settings).map(|effect| (1.0 + effect / LEAST_ERROR).ln()).collect()
}

fn kernel(a: &[f64], b: &[f64], length: f64) -> f64 {
    let distance: f64 = a.iter().zip(b).map(|(a, b)| (a - b).abs()).sum();
    SPREAD * SPREAD * (-distance / length).exp()
}

fn covariance(points: &[Vec<f64>], length: f64) -> Vec<Vec<f64>> {
    let row = |a: usize| -> Vec<f64> {
        (0..=a)
            .map(|b| {
                kernel(&points[a], &points[b], length) + if a == b { NOISE * NOISE } else { 0.0 }
            })
            .collect()
    };
    (0..points.len()).map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use frugal_core::frontier::CostPoint;
    use frugal_core::knobs::Knob;

    use crate::pool::screening_settings;
    use crate::table::CostTable;

    fn space() -> KnobSpace {
        KnobSpace::new(
            (0..5).map(|knob| Knob::new(&format!("k{knob}"), [0.0, 1.0, 2.0, 3.0])).collect(),
        )
        .expect("a valid space")
    }

    /// Effects are additive, except that the first two knobs interact.
    fn exact(settings: KnobLevels) -> f64 {
        let missing = |knob: usize| (3 - settings.level(knob)) as f64;
        let single: f64 =
            (0..5).map(|knob| missing(knob).powi(2) * [4e-3, 2e-3, 1e-3, 5e-4, 0.0][knob]).sum();
        single * (1.0 + 0.3 * missing(0) * missing(1) / 3.0)
    }

    #[test]
    fn a_few_readings_reveal_interactions_of_knobs() {
        let space = space();
        let mut table = CostTable::new(1);
        for settings in screening_settings(&space, true) {
            table.set(0, settings, CostPoint::new(1.0, exact(settings)));
        }
        let screening = Screening::of(&space, &table);
        let single: Vec<_> =
            table.settings().iter().map(|settings| (*settings, exact(*settings))).collect();
        let more: Vec<_> = space
            .iter()
            .step_by(23)
            .map(|settings| (settings, exact(settings)))
            .chain(single.clone())
            .collect();
        let spread = |model: &ErrorModel<'_>| {
            let errors = space
                .iter()
                .step_by(7)
                .map(|s| (model.predict(s).0 - (exact(s) + LEAST_ERROR).ln()).powi(2));
            let (sum, count) =
                errors.fold((0.0, 0.0_f64), |(sum, count), error| (sum + error, count + 1.0));
            (sum / count).sqrt()
        };
        let (before, after) = (
            ErrorModel::fit(&space, &screening, &single),
            ErrorModel::fit(&space, &screening, &more),
        );
        assert!(
            spread(&after) < 0.1 && spread(&after) < 0.5 * spread(&before),
            "{} and {}",
            spread(&before),
            spread(&after)
        );
        // Rendered settings are predicted accurately, with a small deviation.
        let (mean, deviation) = after.predict(single[1].0);
        assert!((mean - (single[1].1 + LEAST_ERROR).ln()).abs() < 0.03 && deviation < 0.1);
    }

    #[test]
    fn missing_and_invalid_readings_do_not_panic() {
        let space = space();
        let screening = Screening::of(&space, &CostTable::new(1));
        for readings in [
            vec![],
            vec![(space.lowest(), f64::NAN)],
            vec![(space.lowest(), -1.0), (space.lowest(), 1e20)],
        ] {
            let model = ErrorModel::fit(&space, &screening, &readings);
            assert!(
                model.predict(space.lowest()).0.exp().is_finite()
                    && model.predict(space.highest()).1.is_finite()
            );
        }
    }
}
