//! NSGA-II (Deb, Pratap, Agarwal, Meyarivan 2002, "A fast and elitist multiobjective genetic
//! algorithm: NSGA-II", section III-C).
//!
//! What differs from the paper, because an evaluation is a rendering: offspring that are known
//! already are replaced by unseen ones; the frontier is taken from everything evaluated and not
//! from the last population; with a small allowance generations are smaller, so that there are
//! several; and the last third of the evaluations goes into the frontier's gaps. A space that is
//! small enough is enumerated.

use std::collections::HashSet;

use bevy_frugal_gi::frontier::{Frontier, FrontierPoint};
use bevy_frugal_gi::knobs::{KnobSpace, RenderSettings};
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::cached::Cached;
use super::crossover::swap_levels;
use super::crowding::{fitness, survivors};
use super::{Evaluate, SearchConfig, gaps, mutation, seeding};

/// Most of the evaluations that go into inherited settings, as a ratio.
const INHERITED: (usize, usize) = (1, 2);

/// Probability that two parents swap levels and are not only mutated (Deb et al. 2002, section V).
const CROSSOVER: f64 = 0.9;
/// Share of the evaluations for the frontier's gaps.
const GAPS: f64 = 0.35;
/// Most combinations that are counted exactly, knobs without effect left out: far more than are
/// ever enumerated.
const COUNTABLE: u64 = 1 << 22;
/// Tries at mutating a known offspring into an unseen one before others are drawn, and tries at
/// drawing one.
const TRIES: usize = 16;

/// What a search found.
#[derive(Clone, Debug, PartialEq)]
pub struct SearchOutcome {
    /// Of everything evaluated. Empty only when no evaluation was finite, or the search was stopped
    /// before the first.
    pub frontier: Frontier,
    /// Evaluations that were made.
    pub evaluations: usize,
    /// Whether the search ended by itself.
    pub complete: bool,
}

/// Searches a knob space.
#[derive(Clone, Debug)]
pub struct Search<'a> {
    space: &'a KnobSpace,
    config: SearchConfig,
    combinations: u64,
}

impl<'a> Search<'a> {
    /// Searches `space` as `config` says.
    pub fn new(space: &'a KnobSpace, config: SearchConfig) -> Self {
        Self { space, config, combinations: combinations(space) }
    }

    /// Most evaluations that a search takes by itself.
    pub fn limit(&self) -> usize {
        let evolving = self.config.evaluations(self.combinations);
        let limit = self.config.max_evaluations.unwrap_or(evolving);
        // A space that fits is enumerated, even where the generations alone would end sooner.
        let all = usize::try_from(self.combinations).unwrap_or(usize::MAX);
        if all <= limit { all } else { limit.min(evolving).max(2) }
    }

    /// Finds the frontier. Those of `inherit` that are of the space are evaluated first;
    /// `keep_going` is asked before every evaluation.
    ///
    /// # Errors
    /// When an evaluation fails.
    pub fn run<E: Evaluate>(
        &self,
        evaluator: &mut E,
        inherit: &[RenderSettings],
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

/// How many different settings there are; in spaces far beyond enumeration, how many names for
/// settings, at most `u64::MAX`.
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
    fn explore(&mut self, inherit: &[RenderSettings]) -> Result<(), E::Error> {
        let space = self.search.space;
        // The ends first: without them a frontier cut short says nothing about the range of
        // budgets.
        self.measure(space.highest())?;
        self.measure(space.lowest())?;
        for settings in seeding::spread(space, inherit, self.limit * INHERITED.0 / INHERITED.1) {
            self.measure(settings)?;
        }
        if self.search.combinations <= self.limit as u64 {
            // In random order, so that an early end leaves a fair sample.
            let mut all: Vec<RenderSettings> = space.iter().collect();
            all.shuffle(&mut self.random);
            return all.into_iter().try_for_each(|settings| self.measure(settings).map(drop));
        }
        if inherit.is_empty() {
            self.seed_cold()?;
        }
        self.evolve()?;
        self.fill_gaps()
    }

    fn seed_cold(&mut self) -> Result<(), E::Error> {
        let space = self.search.space;
        for settings in seeding::presets(space) {
            self.measure(settings)?;
        }
        let probes = seeding::probes(space);
        let Some(highest) = self.measure(space.highest())? else { return Ok(()) };
        // Probes pay when there is enough left to use what they say.
        if self.cached.len() + 2 * probes.len() > self.limit {
            return Ok(());
        }
        let mut probed = Vec::new();
        for (knob, settings) in probes {
            if let Some(point) = self.measure(settings)? {
                probed.push((knob, point.cost));
            }
        }
        for settings in seeding::descent(space, highest.cost, &probed) {
            self.measure(settings)?;
        }
        Ok(())
    }

    fn evolve(&mut self) -> Result<(), E::Error> {
        let capacity = self.search.config.population.max(4);
        let until = self.limit - (self.limit as f64 * GAPS) as usize;
        let mut population = survivors(self.points(), capacity);
        // Random settings keep the population diverse, but almost all are beaten: no more of them
        // than a quarter of the allowance brings in.
        while population.len() < capacity.min(self.limit / 4) && self.may_spend(until) {
            let random = mutation::any(self.search.space, &mut self.random);
            let Some(settings) = self.unseen(random, &HashSet::new()) else { break };
            population.extend(self.measure(settings)?);
        }
        // As in the paper where there is time for many generations; smaller ones, which learn
        // sooner, where there is not.
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

    fn fill_gaps(&mut self) -> Result<(), E::Error> {
        while self.may_spend(self.limit) {
            let frontier = Frontier::from_points(self.points());
            let cached = &self.cached;
            let proposed =
                gaps::propose(self.search.space, &frontier, &mut self.random, |settings| {
                    cached.knows(settings)
                });
            let settings = match proposed {
                Some(settings) => settings,
                None => {
                    let random = mutation::any(self.search.space, &mut self.random);
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

    /// `count` unseen settings, or fewer when there are no more: by binary tournaments, crossover
    /// and mutation.
    fn offspring(&mut self, population: &[FrontierPoint], count: usize) -> Vec<RenderSettings> {
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
        let mut drawn = Vec::new();
        while drawn.len() < count {
            if population.is_empty() {
                // Nothing finite so far: keep looking anywhere.
                drawn.push(mutation::any(space, random));
                continue;
            }
            let parents = [0; 2].map(|_| tournament(random));
            let children = if random.random_bool(CROSSOVER) {
                swap_levels(space, parents, random)
            } else {
                parents
            };
            drawn.extend(children.map(|child| mutation::mutate(space, child, probability, random)));
        }
        drawn.truncate(count);
        let mut planned = HashSet::new();
        let mut offspring = Vec::new();
        for settings in drawn {
            let Some(settings) = self.unseen(settings, &planned) else { break };
            planned.insert(settings);
            offspring.push(settings);
        }
        offspring
    }

    /// `settings`, or else something near them, or else anything, that is neither known nor
    /// `planned`. `None` when there is no more.
    fn unseen(
        &mut self,
        settings: RenderSettings,
        planned: &HashSet<RenderSettings>,
    ) -> Option<RenderSettings> {
        let space = self.search.space;
        let (cached, random) = (&self.cached, &mut self.random);
        let new =
            |settings: RenderSettings| !cached.knows(settings) && !planned.contains(&settings);
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
            candidate = space.canonical(mutation::any(space, random));
            if new(candidate) {
                return Some(candidate);
            }
        }
        // Almost everything is known, so this ends soon after it has passed the known ones.
        space.iter().find(|settings| new(*settings))
    }

    fn points(&self) -> Vec<FrontierPoint> {
        self.cached.points().collect()
    }

    fn may_spend(&self, until: usize) -> bool {
        self.cached.len() < until && self.complete
    }

    /// The cost of `settings`, evaluated unless known. `None` where that is not finite, or nothing
    /// more may be evaluated.
    fn measure(&mut self, settings: RenderSettings) -> Result<Option<FrontierPoint>, E::Error> {
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
