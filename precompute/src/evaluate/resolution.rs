//! The strongest simple baseline: all knobs at the maximum, and the resolution scaled until the
//! budget is met.

use super::ResolvedBudget;
use super::play::FrameRecord;
use super::result::{mean_error, mean_power};

/// Name of the knob that this baseline sets.
pub(crate) const RESOLUTION_KNOB: &str = "resolution_scale";

/// Result of the search.
pub(super) struct Found<T> {
    pub(super) played: Option<(Vec<FrameRecord>, T)>,
    pub(super) met: bool,
}

/// Binary search over levels 0 to `highest` for the one that meets `budget`; `at_highest`: frames
/// of the highest level; `play` renders those of another.
///
/// Under a power budget, with or without an error budget: the highest level with mean power within
/// it. Under an error budget alone: the lowest level with mean error within it. Where no level
/// meets it, the closest (for power, the lowest). Assumes that power rises and error falls with the
/// level.
pub(super) fn search<T, E>(
    highest: usize,
    at_highest: &[FrameRecord],
    budget: &ResolvedBudget,
    mut play: impl FnMut(usize) -> Result<(Vec<FrameRecord>, T), E>,
) -> Result<Found<T>, E> {
    let keeps = |series: &[FrameRecord]| budget.keeps(mean_power(series), mean_error(series));
    let mut best = None;
    // Levels from `low` up to but not including `high` are undecided.
    let (mut low, mut high) = (0, highest);
    match (budget.power_w, budget.error) {
        (Some(limit), _) if mean_power(at_highest) > limit => {
            let mut lowest_played = None;
            while low < high {
                let middle = low.midpoint(high);
                let played = play(middle)?;
                if mean_power(&played.0) <= limit {
                    best = Some(played);
                    low = middle + 1;
                } else {
                    lowest_played = Some(played);
                    high = middle;
                }
            }
            // Where all levels exceed the limit, the last one rendered is level 0.
            best = best.or(lowest_played);
        }
        (None, Some(limit)) => {
            while low < high {
                let middle = low.midpoint(high);
                let played = play(middle)?;
                if mean_error(&played.0) <= limit {
                    best = Some(played);
                    high = middle;
                } else {
                    low = middle + 1;
                }
            }
        }
        _ => {}
    }
    Ok(match best {
        Some(played) => Found { met: keeps(&played.0), played: Some(played) },
        None => Found { met: keeps(at_highest), played: None },
    })
}

#[cfg(test)]
mod tests {
    use bevy_frugal_gi::knobs::KnobLevels;
    use bevy_frugal_gi::units::Watts;

    use super::*;

    const HIGHEST: usize = 5;

    /// Level l takes l + 1 watts and has an error of (5 − l) / 10.
    fn series(level: usize) -> Vec<FrameRecord> {
        let (power, error) = (Watts(level as f64 + 1.0), (HIGHEST - level) as f64 / 10.0);
        vec![FrameRecord {
            time: 0.0,
            settings: KnobLevels::default(),
            power,
            error,
            predicted: None,
        }]
    }

    fn found(power: Option<f64>, error: Option<f64>) -> (usize, bool, usize) {
        let mut plays = 0;
        let budget = ResolvedBudget { power_w: power.map(Watts), error };
        let found = search(HIGHEST, &series(HIGHEST), &budget, |level| {
            plays += 1;
            Ok::<_, std::convert::Infallible>((series(level), ()))
        })
        .unwrap();
        // A level takes one watt more than its number.
        let level = found.played.map_or(HIGHEST, |(series, ())| series[0].power.0 as usize - 1);
        (level, found.met, plays)
    }

    #[test]
    fn finds_the_highest_level_that_is_cheap_enough() {
        for level in 0..=HIGHEST {
            let (at, met, plays) = found(Some(level as f64 + 1.5), None);
            assert_eq!((at, met), (level, true));
            assert!(plays <= 3, "{plays}");
        }
        assert_eq!(
            found(Some(100.0), None),
            (HIGHEST, true, 0),
            "the maximum run is known already"
        );
    }

    #[test]
    fn finds_the_lowest_level_that_is_good_enough() {
        for level in 0..=HIGHEST {
            let (at, met, plays) = found(None, Some((HIGHEST - level) as f64 / 10.0 + 0.05));
            assert_eq!((at, met), (level, true));
            assert!(plays <= 3, "{plays}");
        }
    }

    #[test]
    fn reports_a_budget_that_no_level_meets() {
        assert_eq!(found(Some(0.5), None).0, 0);
        assert!(!found(Some(0.5), None).1);
        let (level, met, _) = found(Some(2.0), Some(0.1));
        assert_eq!((level, met), (1, false), "cheap enough, but then not good enough");
        assert_eq!(found(None, None), (HIGHEST, true, 0));
    }
}
