//! NSGA-II (Deb, Pratap, Agarwal, Meyarivan 2002, "A fast and elitist multiobjective genetic
//! algorithm: NSGA-II", section III-C).
//!
//! Differences from the paper: settings are evaluated once, and the frontier is taken from everything
//! evaluated and not from the last population. A space that is small enough is enumerated.

use std::collections::BTreeMap;

use frugal_core::frontier::{CostPoint, Frontier, FrontierPoint};
use frugal_core::knobs::{KnobLevels, KnobSpace};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::ranking::{fitness, survivors};
use super::variation::{mutate, random_settings, swap_levels};

/// Evaluations of a search.
const EVALUATIONS: usize = 4000;
/// Survivors of a generation, and its offspring.
const POPULATION: usize = 48;
/// Greatest share of the evaluations for inherited settings, as a ratio.
const INHERITED: (usize, usize) = (1, 2);
/// Probability of crossover in addition to mutation (Deb et al. 2002, section V).
const CROSSOVER: f64 = 0.9;
/// Greatest number of combinations that is counted exactly, without inactive knobs: far more than
/// is ever enumerated.
const COUNTABLE: u64 = 1 << 22;
/// Generations in succession without unseen settings after which the search ends.
const STALE: usize = 20;

/// A search of a knob space.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Search<'a> {
    /// The space.
    pub space: &'a KnobSpace,
    /// Seed of every random choice.
    pub seed: u64,
}

impl Search<'_> {
    /// Finds the frontier by `cost`. Settings of `inherit` that are in the space are evaluated first.
    /// Costs that are not finite are left out.
    pub(crate) fn run(
        &self,
        inherit: &[KnobLevels],
        cost: &mut dyn FnMut(KnobLevels) -> CostPoint,
    ) -> Frontier {
        let mut key = [0; 32];
        key[..8].copy_from_slice(&self.seed.to_le_bytes());
        let mut run = Run {
            space: self.space,
            cost,
            known: BTreeMap::new(),
            random: ChaCha8Rng::from_seed(key),
        };
        run.explore(inherit);
        Frontier::from_points(run.points())
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

/// At most `count` of `settings`, each once, spread evenly over the list.
fn spread(space: &KnobSpace, settings: &[KnobLevels], count: usize) -> Vec<KnobLevels> {
    let unique =
        space.canonical_once(settings.iter().copied().filter(|settings| space.contains(*settings)));
    if unique.len() <= count {
        return unique;
    }
    (0..count).map(|index| unique[index * unique.len() / count]).collect()
}

struct Run<'a> {
    space: &'a KnobSpace,
    cost: &'a mut dyn FnMut(KnobLevels) -> CostPoint,
    /// Everything evaluated, by canonical settings. Sorted, so that iteration is deterministic.
    known: BTreeMap<KnobLevels, CostPoint>,
    random: ChaCha8Rng,
}

impl Run<'_> {
    fn explore(&mut self, inherit: &[KnobLevels]) {
        self.evaluate(self.space.highest());
        self.evaluate(self.space.lowest());
        if combinations(self.space) <= EVALUATIONS as u64 {
            for settings in self.space.iter() {
                self.evaluate(settings);
            }
            return;
        }
        for settings in spread(self.space, inherit, EVALUATIONS * INHERITED.0 / INHERITED.1) {
            self.evaluate(settings);
        }
        // Random settings keep the population diverse.
        for _ in self.known.len()..POPULATION {
            let settings = random_settings(self.space, &mut self.random);
            self.evaluate(settings);
        }
        let mut population = survivors(self.points(), POPULATION);
        let mut stale = 0;
        while self.known.len() < EVALUATIONS && stale < STALE {
            let before = self.known.len();
            for settings in self.offspring(&population) {
                population.extend(self.evaluate(settings));
            }
            population = survivors(population, POPULATION);
            stale = if self.known.len() == before { stale + 1 } else { 0 };
        }
    }

    /// A generation by binary tournaments, crossover and mutation.
    fn offspring(&mut self, population: &[FrontierPoint]) -> Vec<KnobLevels> {
        let (space, random) = (self.space, &mut self.random);
        if population.is_empty() {
            // No finite cost so far.
            return (0..POPULATION).map(|_| random_settings(space, random)).collect();
        }
        // One knob of each on average (Deb et al. 2002).
        let probability = 1.0 / space.len().max(1) as f64;
        let fitness = fitness(population);
        let tournament = |random: &mut ChaCha8Rng| {
            let [a, b] = [0; 2].map(|_| random.random_range(0..population.len()));
            let winner = if fitness[b].compare(fitness[a]).is_lt() { b } else { a };
            population[winner].settings
        };
        let mut offspring = Vec::new();
        while offspring.len() < POPULATION {
            let parents = [0; 2].map(|_| tournament(random));
            let children = if random.random_bool(CROSSOVER) {
                swap_levels(space, parents, random)
            } else {
                parents
            };
            offspring.extend(children.map(|child| mutate(space, child, probability, random)));
        }
        offspring
    }

    fn points(&self) -> Vec<FrontierPoint> {
        let finite = self.known.iter().filter(|(_, cost)| cost.is_finite());
        finite.map(|(settings, cost)| FrontierPoint { settings: *settings, cost: *cost }).collect()
    }

    /// The point of `settings`. `None` where they are known, where their cost is not finite, and where
    /// all evaluations are spent.
    fn evaluate(&mut self, settings: KnobLevels) -> Option<FrontierPoint> {
        let settings = self.space.canonical(settings);
        if self.known.len() >= EVALUATIONS || self.known.contains_key(&settings) {
            return None;
        }
        let cost = (self.cost)(settings);
        self.known.insert(settings, cost);
        cost.is_finite().then_some(FrontierPoint { settings, cost })
    }
}

#[cfg(test)]
mod tests {
    use frugal_core::knobs::Knob;

    use super::*;

    #[test]
    fn a_long_inheritance_is_thinned_evenly_and_foreign_settings_are_dropped() {
        let space =
            KnobSpace::new(vec![Knob::new("a", [0.0, 1.0, 2.0, 3.0]), Knob::new("b", [0.0, 1.0])])
                .expect("a valid space");
        let all: Vec<_> = space.iter().collect();
        assert_eq!(spread(&space, &all, 4), [all[0], all[2], all[4], all[6]]);
        assert_eq!(spread(&space, &[all[1], all[1], KnobLevels::from_bits(0xffff)], 4), [all[1]]);
    }
}
