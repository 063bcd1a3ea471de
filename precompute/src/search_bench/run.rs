//! Runs every method from every seed, and says what they came to.

use std::ops::ControlFlow;

use bevy_frugal_gi::knobs::RenderSettings;
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::Serialize;

use super::lookup::Lookup;
use super::others::Others;
use super::{Recorded, RecordedError, frugal};
use crate::search::{Search, SearchConfig};

/// Where a table lacks most combinations, NSGA-II asks for at most this many for each that it
/// holds.
const MOST_ASKED: usize = 10;

/// What is run.
#[derive(Clone, Debug, PartialEq)]
pub struct SearchRuns {
    /// Errors at which power is compared.
    pub errors: Vec<f64>,
    /// Share by which a search's power may be above the table's best.
    pub within: f64,
    /// How often each method is run: seeds 0, 1, ….
    pub seeds: u64,
    /// Settings that are proposed together.
    pub batch: usize,
}

/// How a table is searched.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// Combinations of the table in random order.
    Random,
    /// [`Search`], on the table itself.
    Nsga2,
    /// The project's own, with nothing known.
    FrugalCold,
    /// The project's own, with other cameras known.
    FrugalWarm,
}

impl Method {
    /// As in the JSON.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Random => "random",
            Self::Nsga2 => "nsga2",
            Self::FrugalCold => "frugal-cold",
            Self::FrugalWarm => "frugal-warm",
        }
    }
}

/// What is to be reached.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Goal {
    /// Most error.
    pub error: f64,
    /// Least power at that error in the whole table.
    pub best_w: f64,
    /// Power that is as good as the best.
    pub enough_w: f64,
}

/// Quartiles of renderings over the seeds. `None` where it lies among the seeds that did not get
/// there.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Spread {
    /// A quarter of the seeds needs no more.
    pub lower_quartile: Option<f64>,
    /// Half of them.
    pub median: Option<f64>,
    /// Three quarters.
    pub upper_quartile: Option<f64>,
}

/// What a method needs at one goal.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GoalResult {
    /// The goal's error.
    pub error: f64,
    /// Share of the seeds that got there.
    pub reached: f64,
    /// Quartiles.
    #[serde(flatten)]
    pub spread: Spread,
    /// By seed.
    pub renderings: Vec<Option<usize>>,
}

/// What a method needs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MethodResult {
    /// The method.
    pub method: Method,
    /// By goal.
    pub goals: Vec<GoalResult>,
    /// Most combinations that a run asked for and that the table lacks.
    pub missing: usize,
}

impl SearchRuns {
    /// What is to be reached in a table.
    ///
    /// # Errors
    /// When no combination has as little error.
    pub fn goals(&self, recorded: &Recorded) -> Result<Vec<Goal>, RecordedError> {
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

/// Runs every method; the last one only where other cameras are known. `report` is asked after
/// every run whether to go on: `None` where not.
pub fn run(
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
            let mut all: Vec<RenderSettings> = recorded.costs.keys().copied().collect();
            all.shuffle(&mut ChaCha8Rng::seed_from_u64(seed));
            lookup.ask_all(all);
        }
        (Method::Nsga2, _) => nsga2(recorded, seed, lookup),
        (Method::FrugalWarm, Some(others)) => frugal::warm(recorded, others, batch, seed, lookup),
        (Method::FrugalCold | Method::FrugalWarm, _) => frugal::cold(recorded, batch, seed, lookup),
    }
}

fn nsga2(recorded: &Recorded, seed: u64, lookup: &mut Lookup<'_>) {
    let all = usize::try_from(recorded.space.combinations()).unwrap_or(usize::MAX);
    // One less than all: what may take all of them enumerates. As many generations as it takes.
    let most = all.saturating_sub(1).min(MOST_ASKED * recorded.costs.len());
    let config = SearchConfig {
        seed,
        generations: Some(most),
        max_evaluations: Some(most),
        ..Default::default()
    };
    // It ends by itself, or with an error when all goals are reached: what it took is in the
    // look-up either way.
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
            let place = share * (sorted.len().checked_sub(1)?) as f64;
            let (low, high) = (sorted[place.floor() as usize], sorted[place.ceil() as usize]);
            // Between two of them; where they are equal there is nothing between, which matters for
            // those that are infinite.
            let value = if low == high { low } else { low + (high - low) * place.fract() };
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
    fn quartiles_lie_between_seeds_and_know_no_number_beyond_the_last_that_got_there() {
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
