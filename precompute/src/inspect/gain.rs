//! Whether a level needs a map: how much distinguishing views lowers the error at equal power.
//!
//! Uses the map's own frontiers, each as often as views of the octree have it. They are smoothed,
//! and undivided where division saved nothing at held-out cameras, so that noise hardly looks like
//! a gain. A short search may therefore miss that views differ: the result is about the map, not
//! the level.

use std::collections::{BTreeMap, BTreeSet};

use frugal_core::frontier::{Corner, CostPoint, Frontier, FrontierMap};
use frugal_core::knobs::KnobLevels;
use frugal_core::units::Watts;

/// Budgets, as shares of the range of power.
const BUDGETS: [f64; 7] = [0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9];
/// Exchange rates: this many, each so many times the one before, about the range of power.
const RATES: (i32, f64) = (300, 1.08);
/// Less than this share is no reason for a map: plays differ from predictions by more.
const LEAST: f64 = 0.05;

/// Shares of the error that settings by view save, medians over budgets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Gain {
    /// Of that with one frontier for all views.
    pub over_frontier: f64,
    /// Of that with the best constant.
    pub over_constant: f64,
}

impl Gain {
    /// The gain in a sentence.
    pub(crate) fn sentence(self) -> String {
        let percent = |share: f64| format!("{:.0} %", 100.0 * share.max(0.0));
        let (frontier, constant) = (percent(self.over_frontier), percent(self.over_constant));
        if self.over_frontier >= LEAST {
            format!(
                "they differ: telling them apart takes {frontier} off the error of one frontier at equal power, {constant} off that of one constant"
            )
        } else if self.over_constant >= LEAST {
            format!(
                "the map hardly tells them apart, which takes {frontier} off the error of one frontier at equal power; a controller takes {constant} off that of one constant, as it uses the whole budget"
            )
        } else {
            format!(
                "the map hardly tells them apart, and takes {constant} off the error of one constant at equal power: a constant is enough"
            )
        }
    }
}

/// The gain that `map` expects; `None` where it holds no choice.
pub(crate) fn gain(map: &FrontierMap) -> Option<Gain> {
    let octree = &map.octree;
    let mut counts: BTreeMap<u32, f64> = BTreeMap::new();
    for index in octree.corners.iter().flat_map(|corner| corner.frontiers) {
        let is_known = index != Corner::UNKNOWN
            && octree.frontiers.get(index as usize).is_some_and(|it| !it.is_empty());
        if is_known {
            *counts.entry(index).or_default() += 1.0;
        }
    }
    let all: f64 = counts.values().sum();
    let views: Vec<(&Frontier, f64)> = counts
        .iter()
        .map(|(index, count)| (&octree.frontiers[*index as usize], count / all))
        .collect();
    let constants = constants(&views);
    let powers = || constants.iter().map(|cost| cost.power.0);
    let (low, high) = (powers().reduce(f64::min)?, powers().reduce(f64::max)?);
    if high <= low {
        return None;
    }
    let apart = apart(&views, high - low);
    let mut gains = [Vec::new(), Vec::new()];
    for share in BUDGETS {
        let limit = low + share * (high - low);
        let own = in_turns(&apart, limit)?;
        let constant = constants
            .iter()
            .filter(|cost| cost.power.0 <= limit)
            .map(|cost| cost.error)
            .reduce(f64::min)?;
        for (gains, other) in gains.iter_mut().zip([in_turns(&constants, limit)?, constant]) {
            gains.push(if other > 0.0 { 1.0 - own / other } else { 0.0 });
        }
    }
    let [over_frontier, over_constant] = gains.map(|mut gains| {
        gains.sort_by(f64::total_cmp);
        gains[gains.len() / 2]
    });
    Some(Gain { over_frontier, over_constant })
}

/// Mean costs of each setting over the views. Where a view's frontier lacks it, its error there is at
/// least that of the frontier at its power: the gain is, if anything, larger.
fn constants(views: &[(&Frontier, f64)]) -> Vec<CostPoint> {
    let points = || views.iter().flat_map(|(frontier, _)| frontier.points());
    let settings: BTreeSet<KnobLevels> = points().map(|point| point.settings).collect();
    let mean = |settings: KnobLevels| {
        let of = || points().filter(move |point| point.settings == settings);
        let power = of().map(|point| point.cost.power.0).sum::<f64>() / of().count() as f64;
        let cost = |frontier: &Frontier| {
            let own = frontier.points().iter().find(|point| point.settings == settings);
            let instead =
                || frontier.least_error_within(Watts(power)).or(frontier.points().first());
            own.map(|point| point.cost)
                .or_else(|| Some(CostPoint::new(power, instead()?.cost.error)))
        };
        mean(views.iter().filter_map(|(frontier, share)| Some((cost(frontier)?, *share))))
    };
    settings.into_iter().map(mean).collect()
}

/// Mean costs with the settings of each view by one exchange rate, for many rates. `range`: of power.
fn apart(views: &[(&Frontier, f64)], range: f64) -> Vec<CostPoint> {
    let (count, step) = RATES;
    let rates = (-count / 2..count / 2).map(|number| range * step.powi(number));
    let at = |rate: f64| {
        let picked = |frontier: &Frontier| Some(frontier.least_sum(rate)?.cost);
        mean(views.iter().filter_map(|(frontier, share)| Some((picked(frontier)?, *share))))
    };
    let mut costs: Vec<CostPoint> = rates.map(at).collect();
    costs.dedup();
    costs
}

fn mean(costs: impl Iterator<Item = (CostPoint, f64)>) -> CostPoint {
    costs.fold(CostPoint::new(0.0, 0.0), |sum, (cost, share)| {
        CostPoint::new(sum.power.0 + share * cost.power.0, sum.error + share * cost.error)
    })
}

/// Least mean error of two costs in turns whose mean power is `limit`.
fn in_turns(costs: &[CostPoint], limit: f64) -> Option<f64> {
    let (within, beyond): (Vec<&CostPoint>, Vec<&CostPoint>) =
        costs.iter().partition(|cost| cost.power.0 <= limit);
    let alone = within.iter().map(|cost| cost.error).reduce(f64::min)?;
    let both = within.iter().flat_map(|from| beyond.iter().map(move |to| (from, to)));
    let errors = both.map(|(from, to)| {
        let share = (limit - from.power.0) / (to.power.0 - from.power.0);
        from.error + share * (to.error - from.error)
    });
    Some(errors.fold(alone, f64::min))
}

#[cfg(test)]
mod tests {
    use frugal_core::frontier::FrontierPoint;
    use frugal_core::testing::cube;

    use super::super::testing::map;
    use super::*;

    /// Frontiers of two settings in between the cheapest and the best, which errors tell apart.
    fn views(errors: [[f64; 2]; 2]) -> FrontierMap {
        let point = |level: usize, power: f64, error: f64| FrontierPoint {
            settings: KnobLevels::default().with_level(0, level),
            cost: CostPoint::new(power, error),
        };
        let frontier = |errors: [f64; 2]| {
            Frontier::from_points([
                point(0, 1.0, 0.2),
                point(1, 5.0, errors[0]),
                point(2, 5.1, errors[1]),
                point(3, 9.0, 0.0),
            ])
        };
        let frontiers = (0..48).map(|number| frontier(errors[number % 2])).collect();
        FrontierMap { octree: cube(frontiers), ..map() }
    }

    #[test]
    fn views_with_settings_of_their_own_gain_by_being_told_apart() {
        // One setting saves nothing where the other does.
        let gain = gain(&views([[0.02, 0.019], [0.19, 0.02]])).expect("a gain");
        assert!(gain.over_frontier < gain.over_constant + 1e-9, "{gain:?}");
        let apart = super::gain(&views([[0.001, 0.0009], [0.15, 0.149]])).expect("a gain");
        assert!(apart.over_frontier > 0.1, "{apart:?}");
        assert!(apart.sentence().starts_with("they differ"), "{}", apart.sentence());
    }

    #[test]
    fn equal_views_gain_nothing_over_one_frontier() {
        let gain = gain(&views([[0.02, 0.019]; 2])).expect("a gain");
        assert!(gain.over_frontier.abs() < 1e-9 && gain.over_constant > 0.05, "{gain:?}");
        assert!(gain.sentence().contains("hardly"), "{}", gain.sentence());
    }

    #[test]
    fn maps_without_a_choice_have_no_gain() {
        assert_eq!(
            gain(&FrontierMap { octree: cube(vec![Frontier::default(); 48]), ..map() }),
            None
        );
        let single = || Frontier::from_points(map().shared.points().first().copied());
        assert_eq!(gain(&FrontierMap { octree: cube(vec![single(); 48]), ..map() }), None);
    }
}
