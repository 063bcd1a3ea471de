//! NSGA-II (Deb, Pratap, Agarwal, Meyarivan 2002, "A fast and elitist multiobjective genetic
//! algorithm: NSGA-II", section III-C).
//!
//! Differences from the paper, because an evaluation is a rendering: known offspring are replaced
//! by unseen ones; the frontier is taken from everything evaluated and not from the last
//! population; with a small evaluation budget generations are smaller, so that there are several;
//! and the last third of the evaluations is infill of the frontier. A space that is small enough is
//! enumerated.

use std::collections::HashSet;

use bevy_frugal_gi::frontier::{Frontier, FrontierPoint};
use bevy_frugal_gi::knobs::{KnobLevels, KnobSpace};
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::cached::Cached;
use super::crossover::swap_levels;
use super::crowding::{fitness, survivors};
use super::{Evaluate, SearchConfig, infill, mutation, seeding};

/// Greatest share of the evaluations for inherited settings, as a ratio.
const INHERITED: (usize, usize) = (1, 2);

/// Probability of crossover in addition to mutation (Deb et al. 2002, section V).
const CROSSOVER: f64 = 0.9;
/// Share of the evaluations for infill.
const INFILL: f64 = 0.35;
/// Greatest number of combinations that is counted exactly, without inactive knobs: far more than
/// is ever enumerated.
const COUNTABLE: u64 = 1 << 22;
/// Attempts at mutating a known offspring into an unseen one before sampling others, and attempts
/// at sampling one.
const TRIES: usize = 16;

/// Result of a search.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SearchOutcome {
    /// Frontier of everything evaluated. Empty only if no evaluation was finite, or the search was
    /// stopped before the first.
    pub frontier: Frontier,
    /// Number of evaluations.
    pub evaluations: usize,
    /// Whether the search ended without being stopped.
    pub complete: bool,
}

/// Searches a knob space.
#[derive(Clone, Debug)]
pub(crate) struct Search<'a> {
    space: &'a KnobSpace,
    config: SearchConfig,
    combinations: u64,
}

impl<'a> Search<'a> {
    /// A search of `space` by `config`.
    pub(crate) fn new(space: &'a KnobSpace, config: SearchConfig) -> Self {
        Self { space, config, combinations: combinations(space) }
    }

    /// Evaluation budget of the search.
    pub(crate) fn limit(&self) -> usize {
        let evolving = self.config.evaluations(self.combinations);
        let limit = self.config.max_evaluations.unwrap_or(evolving);
        // A space that fits is enumerated, even where the generations alone would end sooner.
        let all = usize::try_from(self.combinations).unwrap_or(usize::MAX);
        if all <= limit { all } else { limit.min(evolving).max(2) }
    }

    /// Finds the frontier. Settings of `inherit` that are in the space are evaluated first;
    /// `keep_going` is called before every evaluation.
    ///
    /// # Errors
    /// When an evaluation fails.
    pub(crate) fn run<E: Evaluate>(
        &self,
        evaluator: &mut E,
        inherit: &[KnobLevels],
        keep_going: &mut dyn FnMut(usize) -> bool,
    ) -> Result<SearchOutcome, E::Error> {
        let mut key = [0; 32];
        key[..8].copy_from_slice(&self.config.seed.to_le_bytes());
        let random = ChaCha8Rng::from_seed(key);
        let cached = Cached::new(evaluator);
        let mut run =
            Run { search: self, cached, random, limit: self.limit(), complete: true, keep_going };
        run.explore(inherit)?;
        Ok(SearchOutcome {
            frontier: Frontier::from_points(run.cached.points()),
            evaluations: run.cached.len(),
            complete: run.complete,
        })
    }
}

/// Number of different settings; in spaces far beyond enumeration, number of their names, at most
/// `u64::MAX`.
fn combinations(space: &KnobSpace) -> u64 {
    let names =
        space.knobs().iter().map(|knob| knob.levels.len() as u64).fold(1, u64::saturating_mul);
    // Exact counting walks over the combinations of dependent knobs, and does not guard against
    // overflow.
    if names > COUNTABLE { names } else { space.combinations() }
}

struct Run<'r, 's, 'e, E> {
    search: &'r Search<'s>,
    cached: Cached<'e, E>,
    random: ChaCha8Rng,
    limit: usize,
    complete: bool,
    keep_going: &'r mut dyn FnMut(usize) -> bool,
}

impl<E: Evaluate> Run<'_, '_, '_, E> {
    fn explore(&mut self, inherit: &[KnobLevels]) -> Result<(), E::Error> {
        let space = self.search.space;
        // The ends first: without them an interrupted frontier does not cover the range of budgets.
        self.measure(space.highest())?;
        self.measure(space.lowest())?;
        for settings in seeding::spread(space, inherit, self.limit * INHERITED.0 / INHERITED.1) {
            self.measure(settings)?;
        }
        if self.search.combinations <= self.limit as u64 {
            // In random order, so that an early end leaves an unbiased sample.
            let mut all: Vec<KnobLevels> = space.iter().collect();
            all.shuffle(&mut self.random);
            return all.into_iter().try_for_each(|settings| self.measure(settings).map(drop));
        }
        if inherit.is_empty() {
            self.seed_cold()?;
        }
        self.evolve()?;
        self.infill()
    }

    fn seed_cold(&mut self) -> Result<(), E::Error> {
        let space = self.search.space;
        for settings in seeding::presets(space) {
            self.measure(settings)?;
        }
        let one_at_a_time = seeding::one_at_a_time(space);
        let Some(highest) = self.measure(space.highest())? else { return Ok(()) };
        // Screening is worthwhile only with enough evaluations left to use its results.
        if self.cached.len() + 2 * one_at_a_time.len() > self.limit {
            return Ok(());
        }
        let mut effects = Vec::new();
        for (knob, settings) in one_at_a_time {
            if let Some(point) = self.measure(settings)? {
                effects.push((knob, point.cost));
            }
        }
        for settings in seeding::descent(space, highest.cost, &effects) {
            self.measure(settings)?;
        }
        Ok(())
    }

    fn evolve(&mut self) -> Result<(), E::Error> {
        let capacity = self.search.config.population.max(4);
        let until = self.limit - (self.limit as f64 * INFILL) as usize;
        let mut population = survivors(self.points(), capacity);
        // Random settings keep the population diverse, but almost all are dominated: at most a
        // quarter of the evaluation budget.
        while population.len() < capacity.min(self.limit / 4) && self.may_spend(until) {
            let random = mutation::random_settings(self.search.space, &mut self.random);
            let Some(settings) = self.unseen(random, &HashSet::new()) else { break };
            population.extend(self.measure(settings)?);
        }
        // Generations as in the paper if the budget allows many; otherwise smaller ones, which
        // converge in fewer evaluations.
        let batch = capacity.min((until.saturating_sub(self.cached.len()) / 8).max(4));
        while self.may_spend(until) {
            let offspring = self.offspring(&population, batch.min(until - self.cached.len()));
            if offspring.is_empty() {
                return Ok(());
            }
            for settings in offspring {
                population.extend(self.measure(settings)?);
            }
            population = survivors(population, capacity);
        }
        Ok(())
    }

    fn infill(&mut self) -> Result<(), E::Error> {
        while self.may_spend(self.limit) {
            let frontier = Frontier::from_points(self.points());
            let cached = &self.cached;
            let proposed =
                infill::propose(self.search.space, &frontier, &mut self.random, |settings| {
                    cached.knows(settings)
                });
            let settings = match proposed {
                Some(settings) => settings,
                None => {
                    let random = mutation::random_settings(self.search.space, &mut self.random);
                    let Some(settings) = self.unseen(random, &HashSet::new()) else {
                        return Ok(());
                    };
                    settings
                }
            };
            self.measure(settings)?;
        }
        Ok(())
    }

    /// `count` unseen settings, or fewer if there are no more, by binary tournaments, crossover and
    /// mutation.
    fn offspring(&mut self, population: &[FrontierPoint], count: usize) -> Vec<KnobLevels> {
        let space = self.search.space;
        let probability =
            self.search.config.mutation_probability.unwrap_or(1.0 / space.len().max(1) as f64);
        let fitness = fitness(population);
        let random = &mut self.random;
        let tournament = |random: &mut ChaCha8Rng| {
            let [a, b] = [0; 2].map(|_| random.random_range(0..population.len()));
            let winner = if fitness[b].compare(fitness[a]).is_lt() { b } else { a };
            population[winner].settings
        };
        let mut candidates = Vec::new();
        while candidates.len() < count {
            if population.is_empty() {
                // No finite cost so far: samples at random.
                candidates.push(mutation::random_settings(space, random));
                continue;
            }
            let parents = [0; 2].map(|_| tournament(random));
            let children = if random.random_bool(CROSSOVER) {
                swap_levels(space, parents, random)
            } else {
                parents
            };
            candidates
                .extend(children.map(|child| mutation::mutate(space, child, probability, random)));
        }
        candidates.truncate(count);
        let mut planned = HashSet::new();
        let mut offspring = Vec::new();
        for settings in candidates {
            let Some(settings) = self.unseen(settings, &planned) else { break };
            planned.insert(settings);
            offspring.push(settings);
        }
        offspring
    }

    /// `settings`, or else settings near them, or else any, that are neither known nor `planned`.
    /// `None` if there are no more.
    fn unseen(
        &mut self,
        settings: KnobLevels,
        planned: &HashSet<KnobLevels>,
    ) -> Option<KnobLevels> {
        let space = self.search.space;
        let (cached, random) = (&self.cached, &mut self.random);
        let new = |settings: KnobLevels| !cached.knows(settings) && !planned.contains(&settings);
        if (cached.len() + planned.len()) as u64 >= self.search.combinations {
            return None;
        }
        let mut candidate = space.canonical(settings);
        for _ in 0..TRIES {
            if new(candidate) {
                return Some(candidate);
            }
            candidate = space.canonical(mutation::mutate_one(space, candidate, random));
        }
        for _ in 0..TRIES {
            candidate = space.canonical(mutation::random_settings(space, random));
            if new(candidate) {
                return Some(candidate);
            }
        }
        // Almost everything is known, so the scan ends soon after the known settings.
        space.iter().find(|settings| new(*settings))
    }

    fn points(&self) -> Vec<FrontierPoint> {
        self.cached.points().collect()
    }

    fn may_spend(&self, until: usize) -> bool {
        self.cached.len() < until && self.complete
    }

    /// The cost of `settings`, evaluated unless known. `None` where it is not finite, or the
    /// evaluation budget is spent.
    fn measure(&mut self, settings: KnobLevels) -> Result<Option<FrontierPoint>, E::Error> {
        let settings = self.search.space.canonical(settings);
        if !self.cached.knows(settings) {
            if self.cached.len() >= self.limit || !self.complete {
                return Ok(None);
            }
            if !(self.keep_going)(self.cached.len()) {
                self.complete = false;
                return Ok(None);
            }
        }
        let cost = self.cached.evaluate(settings)?;
        Ok(cost.is_finite().then_some(FrontierPoint { settings, cost }))
    }
}
