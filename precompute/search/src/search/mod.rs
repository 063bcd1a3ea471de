//! Search for the Pareto frontier of power and error over the settings of a
//! [`KnobSpace`](frugal_core::knobs::KnobSpace), on models that cost nothing to evaluate: NSGA-II (Deb,
//! Pratap, Agarwal, Meyarivan 2002, "A fast and elitist multiobjective genetic algorithm: NSGA-II",
//! section III-C), as in Wang et al. 2016, section 3.5.1.
//!
//! Differences from the paper: known offspring are replaced by unseen ones; the frontier is taken from
//! everything evaluated and not from the last population; and the last third of the evaluations is
//! infill of the frontier. A space that is small enough is enumerated.

mod infill;
mod ranking;
#[cfg(test)]
mod tests;
mod variation;

use std::collections::{BTreeMap, HashSet};

use frugal_core::frontier::{CostPoint, Frontier, FrontierPoint};
use frugal_core::knobs::{KnobLevels, KnobSpace};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use ranking::{compare, fitness, survivors};
pub(crate) use variation::random_settings;
use variation::{mutate, mutate_one, swap_levels};

/// Evaluations of a search.
const EVALUATIONS: usize = 4000;
/// Survivors of a generation, and its offspring.
const POPULATION: usize = 48;
/// Probability of crossover in addition to mutation (Deb et al. 2002, section V).
const CROSSOVER: f64 = 0.9;
/// Share of the evaluations for infill.
const INFILL: f64 = 0.35;
/// Attempts at mutating a known offspring into an unseen one before sampling others, and attempts
/// at sampling one.
const TRIES: usize = 16;

/// Finds the frontier of `space` by `cost`. Settings of `inherit`, which are in the space, are
/// evaluated first. Costs that are not finite are left out. `seed` decides
/// every random choice.
pub(crate) fn nsga2(
    space: &KnobSpace,
    seed: u64,
    inherit: &[KnobLevels],
    cost: &mut dyn FnMut(KnobLevels) -> CostPoint,
) -> Frontier {
    let mut key = [0; 32];
    key[..8].copy_from_slice(&seed.to_le_bytes());
    let combinations = space.combinations();
    let limit = usize::try_from(combinations).unwrap_or(usize::MAX).min(EVALUATIONS);
    let (known, random) = (BTreeMap::new(), ChaCha8Rng::from_seed(key));
    let mut run = Run { space, cost, known, random, limit };
    run.evaluate(space.highest());
    run.evaluate(space.lowest());
    for settings in inherit {
        run.evaluate(*settings);
    }
    if combinations <= limit as u64 {
        for settings in space.iter() {
            run.evaluate(settings);
        }
    } else {
        run.evolve();
        run.infill();
    }
    Frontier::from_points(run.points())
}

struct Run<'a> {
    space: &'a KnobSpace,
    cost: &'a mut dyn FnMut(KnobLevels) -> CostPoint,
    /// Everything evaluated, by canonical settings. Sorted, so that iteration is deterministic.
    known: BTreeMap<KnobLevels, CostPoint>,
    random: ChaCha8Rng,
    limit: usize,
}

impl Run<'_> {
    fn evolve(&mut self) {
        let until = self.limit - (self.limit as f64 * INFILL) as usize;
        let mut population = survivors(self.points(), POPULATION);
        // Random settings keep the population diverse.
        while population.len() < POPULATION && self.known.len() < until {
            let Some(settings) = self.unseen_at_random() else { break };
            population.extend(self.evaluate(settings));
        }
        while self.known.len() < until {
            let offspring = self.offspring(&population, POPULATION.min(until - self.known.len()));
            if offspring.is_empty() {
                return;
            }
            for settings in offspring {
                population.extend(self.evaluate(settings));
            }
            population = survivors(population, POPULATION);
        }
    }

    fn infill(&mut self) {
        while self.known.len() < self.limit {
            let frontier = Frontier::from_points(self.points());
            let known = &self.known;
            let proposed = infill::propose(self.space, &frontier, &mut self.random, |settings| {
                known.contains_key(&settings)
            });
            let Some(settings) = proposed.or_else(|| self.unseen_at_random()) else { return };
            self.evaluate(settings);
        }
    }

    /// `count` unseen settings, or fewer if there are no more, by binary tournaments, crossover and
    /// mutation.
    fn offspring(&mut self, population: &[FrontierPoint], count: usize) -> Vec<KnobLevels> {
        let space = self.space;
        // One knob of each on average (Deb et al. 2002).
        let probability = 1.0 / space.len().max(1) as f64;
        let fitness = fitness(population);
        let random = &mut self.random;
        let tournament = |random: &mut ChaCha8Rng| {
            let [a, b] = [0; 2].map(|_| random.random_range(0..population.len()));
            let winner = if compare(fitness[b], fitness[a]).is_lt() { b } else { a };
            population[winner].settings
        };
        let mut candidates = Vec::new();
        while candidates.len() < count {
            if population.is_empty() {
                // No finite cost so far: samples at random.
                candidates.push(random_settings(space, random));
                continue;
            }
            let parents = [0; 2].map(|_| tournament(random));
            let children = if random.random_bool(CROSSOVER) {
                swap_levels(space, parents, random)
            } else {
                parents
            };
            candidates.extend(children.map(|child| mutate(space, child, probability, random)));
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

    fn unseen_at_random(&mut self) -> Option<KnobLevels> {
        let settings = random_settings(self.space, &mut self.random);
        self.unseen(settings, &HashSet::new())
    }

    /// `settings`, or else settings near them, or else any, that are neither known nor `planned`.
    /// `None` if there are no more.
    fn unseen(
        &mut self,
        settings: KnobLevels,
        planned: &HashSet<KnobLevels>,
    ) -> Option<KnobLevels> {
        let space = self.space;
        let (known, random) = (&self.known, &mut self.random);
        let new =
            |settings: KnobLevels| !known.contains_key(&settings) && !planned.contains(&settings);
        let mut candidate = space.canonical(settings);
        for _ in 0..TRIES {
            if new(candidate) {
                return Some(candidate);
            }
            candidate = space.canonical(mutate_one(space, candidate, random));
        }
        for _ in 0..TRIES {
            candidate = space.canonical(random_settings(space, random));
            if new(candidate) {
                return Some(candidate);
            }
        }
        // Almost everything is known, so the scan ends soon after the known settings.
        space.iter().find(|settings| new(*settings))
    }

    fn points(&self) -> Vec<FrontierPoint> {
        let finite = self.known.iter().filter(|(_, cost)| cost.is_finite());
        finite.map(|(settings, cost)| FrontierPoint { settings: *settings, cost: *cost }).collect()
    }

    /// The point of `settings`, evaluated unless known. `None` where its cost is not finite, or all
    /// evaluations are spent.
    fn evaluate(&mut self, settings: KnobLevels) -> Option<FrontierPoint> {
        let settings = self.space.canonical(settings);
        let cost = match self.known.get(&settings) {
            Some(cost) => *cost,
            None if self.known.len() >= self.limit => return None,
            None => {
                let cost = (self.cost)(settings);
                self.known.insert(settings, cost);
                cost
            }
        };
        cost.is_finite().then_some(FrontierPoint { settings, cost })
    }
}
