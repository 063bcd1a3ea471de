//! Errors in play as a share of those of clips.
//!
//! A clip has few frames, and so a short history. In play the history is longer and averages more
//! noise. How much differs by scene. So a few settings are rendered over stretches of the tracks, as
//! long as the history takes, and over the last frames of the same stretches, as clips.

use frugal_core::frontier::{CostPoint, Frontier, FrontierPoint};
use frugal_core::knobs::{KnobLevels, KnobSpace};

use super::{Job, PipelineError, Purpose, Renderings};
use crate::table::{CostTable, Measure};

/// Errors around which settings are rendered: where error budgets are.
const ERRORS: [f64; 3] = [0.006, 0.015, 0.035];
/// Share of the time limit within which the stretches must be rendered.
const SHARE: f64 = 0.45;
/// Share of a clip's error where nothing is known: without tracks, or without time. The highest of
/// three levels' means.
const ASSUMED: f64 = 0.92;
/// How much of what the rendered settings gain in play others gain, too: history averages noise, and
/// the settings around budgets are noisier than most.
const GAIN_APPLIED: f64 = 0.5;
/// Shares outside this range have other causes than history.
const RANGE: (f64, f64) = (0.5, 1.2);

/// The settings nearest to [`ERRORS`] on the frontier of means over `table`.
fn settings(table: &CostTable) -> Vec<KnobLevels> {
    let points = table.means().map(|(settings, cost)| FrontierPoint { settings, cost });
    let frontier = Frontier::from_points(points);
    let with_error: Vec<&FrontierPoint> =
        frontier.points().iter().filter(|point| point.cost.error > 0.0).collect();
    let nearest = |wanted: &f64| {
        let distance = |point: &FrontierPoint| (point.cost.error / wanted).ln().abs();
        with_error.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)))
    };
    let mut chosen: Vec<_> =
        ERRORS.iter().filter_map(nearest).map(|point| point.settings).collect();
    chosen.dedup();
    chosen
}

/// Renders the stretches, and returns the share of play; `table`: costs of the pool at the pilot
/// cameras.
pub(super) fn share_of_play<M: Measure>(
    table: &CostTable,
    space: &KnobSpace,
    renderings: &mut Renderings<'_, M>,
) -> Result<PlayShare, PipelineError<M::Error>> {
    let chosen = space.canonical_once(settings(table));
    let stretches = renderings.setup.cameras.stretches.len();
    let jobs: Vec<Job> = (0..stretches)
        .flat_map(|stretch| [(Purpose::Play, stretch), (Purpose::Clip, stretch)])
        .map(|camera| Job { camera, settings: chosen.clone() })
        .collect();
    let frames = |job: &Job| renderings.clip(job.camera).len() * (job.settings.len() + 2);
    let of_clip = renderings.setup.clip.0.max(1) as usize;
    let more = jobs.iter().map(frames).sum::<usize>().div_ceil(of_clip);
    if jobs.is_empty() || !renderings.has_time("play", more, SHARE)? {
        return Ok(PlayShare::new(std::iter::empty()));
    }
    renderings.batch("play", &jobs)?;
    let measured = chosen.iter().filter_map(|settings| {
        let pairs = (0..stretches).filter_map(|stretch| {
            let error = |purpose| Some(renderings.get((purpose, stretch), *settings)?.error);
            Some((error(Purpose::Clip)?, error(Purpose::Play)?))
        });
        share_of(&pairs.collect::<Vec<_>>())
    });
    Ok(PlayShare::new(measured))
}

/// The share of play from `pairs` of an error of a clip and one in play: a ratio of means. `None` for
/// fewer than two, or where a number is not above 0 and finite.
fn share_of(pairs: &[(f64, f64)]) -> Option<Share> {
    let count = pairs.len() as f64;
    let mean = |value: fn(&(f64, f64)) -> f64| pairs.iter().map(value).sum::<f64>() / count;
    let (of_clips, of_play) = (mean(|pair| pair.0), mean(|pair| pair.1));
    let ratio = of_play / of_clips;
    // Of a ratio estimate (Cochran 1977, "Sampling techniques", equation 6.13).
    let squares: f64 = pairs.iter().map(|(clip, play)| (play - ratio * clip).powi(2)).sum();
    let error = (squares / (count - 1.0) / count).sqrt() / of_play;
    let is_valid = pairs.len() >= 2
        && [of_clips, of_play].iter().all(|number| number.is_finite() && *number > 0.0);
    is_valid.then(|| Share {
        ln_error: of_clips.ln(),
        share: ratio.clamp(RANGE.0, RANGE.1),
        uncertainty: error,
    })
}

/// The share at one error.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Share {
    /// Logarithm of the mean error of clips.
    ln_error: f64,
    share: f64,
    /// Standard error, as a part of the share.
    uncertainty: f64,
}

/// Errors in play as a share of those of clips, by the error of clips: small errors are mostly noise,
/// which a longer history averages; large ones are mostly what settings leave out.
#[derive(Clone, Debug, PartialEq)]
pub struct PlayShare(Vec<Share>);

impl PlayShare {
    /// From the shares at some errors.
    fn new(measured: impl Iterator<Item = Share>) -> Self {
        let mut known: Vec<Share> = measured.collect();
        known.sort_by(|a, b| a.ln_error.total_cmp(&b.ln_error));
        Self(known)
    }

    /// The share for settings with the mean `error`: half of what the rendered ones gain. Log-linear
    /// between measurements, constant above, and towards 1 at an error of 0.
    pub fn at(&self, error: f64) -> f64 {
        1.0 - GAIN_APPLIED * (1.0 - self.of_rendered(error))
    }

    /// The same of the settings that are rendered.
    fn of_rendered(&self, error: f64) -> f64 {
        let Some(first) = self.0.first() else { return ASSUMED };
        let below = (error.ln() - first.ln_error).exp();
        if below < 1.0 {
            1.0 - (1.0 - first.share) * below
        } else {
            self.interpolated(error, |share| share.share)
        }
    }

    /// Standard error of the share for settings with the mean `error`, as a part of it.
    pub(super) fn uncertainty(&self, error: f64) -> f64 {
        self.interpolated(error, |share| share.uncertainty)
    }

    /// A value interpolated in the error's logarithm; 0 where nothing is known.
    fn interpolated(&self, error: f64, value: fn(&Share) -> f64) -> f64 {
        let at = error.ln();
        let (Some(first), Some(last)) = (self.0.first(), self.0.last()) else { return 0.0 };
        if at.is_nan() || at <= first.ln_error {
            return value(first);
        }
        let between = self.0.windows(2).find(|two| at < two[1].ln_error);
        between.map_or(value(last), |two| {
            let part = (at - two[0].ln_error) / (two[1].ln_error - two[0].ln_error);
            value(&two[0]) + part * (value(&two[1]) - value(&two[0]))
        })
    }

    /// `table` with errors as in play: each setting's times the share for its mean error over the
    /// known rows of `means`.
    pub(super) fn apply(&self, table: &CostTable, means: &CostTable) -> CostTable {
        let mut played = CostTable::new(table.rows());
        for (column, settings) in table.settings().iter().enumerate() {
            let share = self.at(means.known_mean_error(*settings).unwrap_or(f64::NAN));
            for (row, cost) in table.known(column) {
                let error = cost.error * share;
                played.set(row, *settings, CostPoint::new(cost.power.0, error));
            }
        }
        played
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_are_those_of_the_frontier_around_common_budgets() {
        let mut table = CostTable::new(1);
        let costs = [(9.0, 0.0), (5.0, 0.005), (5.5, 0.006), (3.0, 0.02), (1.0, 0.4)];
        for (bits, (power, error)) in costs.into_iter().enumerate() {
            table.set(0, KnobLevels::from_bits(bits as u128), CostPoint::new(power, error));
        }
        // The third is dominated; the best have no error, and so no share.
        assert_eq!(settings(&table), [1, 3].map(KnobLevels::from_bits));
        assert_eq!(settings(&CostTable::new(0)), []);
    }

    fn known(shares: &[(f64, f64)]) -> PlayShare {
        PlayShare::new(shares.iter().map(|(error, share)| Share {
            ln_error: error.ln(),
            share: *share,
            uncertainty: 0.1 * share,
        }))
    }

    #[test]
    fn shares_are_interpolated() {
        let share = known(&[(0.04, 0.9), (0.01, 0.7)]);
        assert!((share.at(0.02) - 0.9).abs() < 1e-9, "{share:?}");
        assert!((share.uncertainty(0.02) - 0.08).abs() < 1e-9, "{share:?}");
        assert_eq!([0.01, f64::NAN].map(|error| share.of_rendered(error)), [0.7; 2]);
        assert!((share.at(0.005) - 0.925).abs() < 1e-9 && share.at(0.0) == 1.0, "{share:?}");
        assert_eq!([0.04, 0.5, f64::INFINITY].map(|error| share.of_rendered(error)), [0.9; 3]);
        assert_eq!((known(&[]).of_rendered(0.1), known(&[]).uncertainty(0.1)), (ASSUMED, 0.0));
    }

    #[test]
    fn the_share_is_a_ratio_of_means_with_its_standard_error() {
        let share = |pairs: &[(f64, f64)]| share_of(pairs).map(|of| (of.share, of.uncertainty));
        let (same, none) = share(&[(0.01, 0.008), (0.03, 0.024)]).expect("two pairs");
        assert!((same - 0.8).abs() < 1e-12 && none < 1e-9, "{same} {none}");
        // Residuals of +0.001 and −0.001 about 0.8: a standard error of 0.001 of 0.016.
        let (mean, error) = share(&[(0.02, 0.017), (0.02, 0.015)]).expect("two pairs");
        assert!((mean - 0.8).abs() < 1e-12 && (error - 0.0625).abs() < 1e-9, "{mean} {error}");
        assert_eq!(share(&[(0.1, 1e-9), (0.1, 1e-9)]).map(|of| of.0), Some(RANGE.0));
        for (odd, why) in [
            (&[][..], "none"),
            (&[(0.1, 0.1)][..], "one"),
            (&[(0.1, 0.0), (0.1, 0.0)][..], "0 is nothing measured"),
            (&[(0.1, f64::NAN), (0.1, 0.1)][..], "NaN"),
        ] {
            assert_eq!(share(odd), None, "{why}");
        }
    }

    #[test]
    fn each_setting_gets_the_share_of_its_mean() {
        // The last row is not rendered.
        let mut table = CostTable::new(3);
        let (good, bad) = (KnobLevels::from_bits(1), KnobLevels::from_bits(2));
        for (row, errors) in [(0, [0.005, 0.03]), (1, [0.015, 0.05])] {
            table.set(row, good, CostPoint::new(2.0, errors[0]));
            table.set(row, bad, CostPoint::new(1.0, errors[1]));
        }
        let share = known(&[(0.01, 0.7), (0.04, 0.9)]);
        let played = share.apply(&table, &table);
        let error = |row, settings| played.get(row, settings).map(|cost| cost.error);
        for (found, expected) in [
            (error(0, good), 0.00425),
            (error(1, good), 0.01275),
            (error(0, bad), 0.0285),
            (error(1, bad), 0.0475),
        ] {
            assert!((found.expect("known") - expected).abs() < 1e-12, "{found:?}, {expected}");
        }
    }
}
