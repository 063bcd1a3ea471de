//! Runs every method from every seed, and summarises the results.

use std::ops::ControlFlow;

use bevy_frugal_gi::knobs::KnobLevels;
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::Serialize;

use super::lookup::Lookup;
use super::others::Others;
use super::{Recorded, RecordedError, frugal};
use crate::pool::SearchedCamera as _;
use crate::search::{Search, SearchConfig};

/// Limit of NSGA-II's requests, per combination of the table, where the table lacks most
/// combinations.
const MOST_ASKED: usize = 10;

/// Configuration of the benchmark.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SearchRuns {
    /// Errors at which power is compared.
    pub errors: Vec<f64>,
    /// Tolerance of a search's power above the table's best, as a share.
    pub within: f64,
    /// Runs of each method: seeds 0, 1, ….
    pub seeds: u64,
    /// Settings proposed per round.
    pub batch: usize,
}

/// Search methods.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Method {
    /// Combinations of the table in random order.
    Random,
    /// [`Search`], on the table itself.
    Nsga2,
    /// The project's own, without prior knowledge.
    FrugalCold,
    /// The project's own, with readings of other cameras.
    FrugalWarm,
}

impl Method {
    /// The name in the JSON.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Random => "random",
            Self::Nsga2 => "nsga2",
            Self::FrugalCold => "frugal-cold",
            Self::FrugalWarm => "frugal-warm",
        }
    }
}

/// A goal of searches.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(crate) struct Goal {
    /// Greatest error.
    pub error: f64,
    /// Least power at that error in the whole table.
    pub best_w: f64,
    /// Power at which the goal counts as reached.
    pub enough_w: f64,
}

/// Quartiles of renderings over the seeds. `None` where a quartile is among the seeds that did not
/// reach the goal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub(crate) struct Spread {
    /// First quartile.
    pub lower_quartile: Option<f64>,
    /// Median.
    pub median: Option<f64>,
    /// Third quartile.
    pub upper_quartile: Option<f64>,
}

/// Renderings of a method for one goal.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct GoalResult {
    /// The goal's error.
    pub error: f64,
    /// Share of the seeds that reached it.
    pub reached: f64,
    /// Quartiles.
    #[serde(flatten)]
    pub spread: Spread,
    /// By seed.
    pub renderings: Vec<Option<usize>>,
}

/// Renderings of a method.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct MethodResult {
    /// The method.
    pub method: Method,
    /// By goal.
    pub goals: Vec<GoalResult>,
    /// Greatest number of combinations that a run requested and the table lacks.
    pub missing: usize,
}

impl SearchRuns {
    /// The goals of searches in a table.
    ///
    /// # Errors
    /// When no combination has as little error as requested.
    pub(crate) fn goals(&self, recorded: &Recorded) -> Result<Vec<Goal>, RecordedError> {
        let goal = |error: &f64| {
            let best = recorded.least_power(*error);
            let best_w = best.ok_or(RecordedError::NoneWithin {
                error: *error,
                least: recorded.least_error(),
            })?;
            Ok(Goal { error: *error, best_w, enough_w: best_w * (1.0 + self.within) })
        };
        self.errors.iter().map(goal).collect()
    }
}

/// Runs every method; the last one only with other cameras. `report` is called after every run;
/// `None` if it breaks.
pub(crate) fn run(
    recorded: &Recorded,
    runs: &SearchRuns,
    goals: &[Goal],
    report: &(dyn Fn() -> ControlFlow<()> + Sync),
) -> Option<Vec<MethodResult>> {
    let others = Others::of(recorded);
    let methods = [Method::Random, Method::Nsga2, Method::FrugalCold]
        .into_iter()
        .chain(others.as_ref().map(|_| Method::FrugalWarm));
    let one = |method: Method| {
        let one = |seed: u64| {
            let mut lookup = Lookup::new(recorded, goals);
            search(recorded, method, others.as_ref(), (seed, runs.batch), &mut lookup);
            report().is_continue().then(|| (lookup.missing(), lookup.reached))
        };
        let all: Option<Vec<_>> = (0..runs.seeds).into_par_iter().map(one).collect();
        all.map(|all| summary(method, goals, &all))
    };
    methods.map(one).collect()
}

fn search(
    recorded: &Recorded,
    method: Method,
    others: Option<&Others>,
    (seed, batch): (u64, usize),
    lookup: &mut Lookup<'_>,
) {
    match (method, others) {
        (Method::Random, _) => {
            let mut all: Vec<KnobLevels> = recorded.costs.keys().copied().collect();
            all.shuffle(&mut ChaCha8Rng::seed_from_u64(seed));
            let Ok(()) = lookup.ask_all(all);
        }
        (Method::Nsga2, _) => nsga2(recorded, seed, lookup),
        (Method::FrugalWarm, Some(others)) => frugal::warm(recorded, others, batch, seed, lookup),
        (Method::FrugalCold | Method::FrugalWarm, _) => frugal::cold(recorded, batch, seed, lookup),
    }
}

fn nsga2(recorded: &Recorded, seed: u64, lookup: &mut Lookup<'_>) {
    let all = usize::try_from(recorded.space.combinations()).unwrap_or(usize::MAX);
    // One less than all, because a search with a budget for all enumerates. Enough generations for
    // the budget.
    let most = all.saturating_sub(1).min(MOST_ASKED * recorded.costs.len());
    let config = SearchConfig {
        seed,
        generations: Some(most),
        max_evaluations: Some(most),
        ..Default::default()
    };
    // Ends by itself, or with an error when all goals are reached; the look-up has the count in
    // both cases.
    let _ = Search::new(&recorded.space, config).run(lookup, &[], &mut |_| true);
}

fn summary(method: Method, goals: &[Goal], runs: &[(usize, Vec<Option<usize>>)]) -> MethodResult {
    let result = |(index, goal): (usize, &Goal)| {
        let renderings: Vec<Option<usize>> =
            runs.iter().map(|(_, reached)| reached[index]).collect();
        let count = renderings.iter().flatten().count();
        GoalResult {
            error: goal.error,
            reached: count as f64 / runs.len().max(1) as f64,
            spread: Spread::of(&renderings),
            renderings,
        }
    };
    let missing = runs.iter().map(|(missing, _)| *missing).max().unwrap_or(0);
    MethodResult { method, goals: goals.iter().enumerate().map(result).collect(), missing }
}

impl Spread {
    fn of(renderings: &[Option<usize>]) -> Self {
        let mut sorted: Vec<f64> = renderings
            .iter()
            .map(|count| count.map_or(f64::INFINITY, |count| count as f64))
            .collect();
        sorted.sort_by(f64::total_cmp);
        let at = |share: f64| {
            let position = share * (sorted.len().checked_sub(1)?) as f64;
            let (low, high) = (sorted[position.floor() as usize], sorted[position.ceil() as usize]);
            // Linear interpolation; equal values are returned as they are, because infinite ones
            // have no difference.
            let value = if low == high { low } else { low + (high - low) * position.fract() };
            value.is_finite().then_some(value)
        };
        Self { lower_quartile: at(0.25), median: at(0.5), upper_quartile: at(0.75) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn methods_are_called_the_same_everywhere() {
        for method in [Method::Random, Method::Nsga2, Method::FrugalCold, Method::FrugalWarm] {
            assert_eq!(serde_json::to_value(method).expect("a name"), method.name());
        }
    }

    #[test]
    fn quartiles_lie_between_seeds_and_are_none_beyond_the_last_that_reached_the_goal() {
        let spread = Spread::of(&[Some(4), Some(1), None, Some(3), Some(2)]);
        assert_eq!(
            spread,
            Spread { lower_quartile: Some(2.0), median: Some(3.0), upper_quartile: Some(4.0) }
        );
        let spread = Spread::of(&[Some(10), Some(20), None, None]);
        assert_eq!(
            spread,
            Spread { lower_quartile: Some(17.5), median: None, upper_quartile: None }
        );
        assert_eq!(Spread::of(&[]), Spread::default());
    }
}
