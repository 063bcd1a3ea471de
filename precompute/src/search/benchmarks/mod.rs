//! The search on problems with known frontiers.
//!
//! | file | problems |
//! |---|---|
//! | `published` | ZDT1 to ZDT3 and DTLZ2, on levels instead of real variables |
//! | `rendering` | a model of rendering costs, small enough to enumerate |
//! | `rules` | what holds on any problem: nothing twice, limits, seeds, values that are not finite |

mod published;
mod rendering;
mod rules;

use std::convert::Infallible;

use bevy_frugal_gi::frontier::{CostPoint, Frontier, FrontierPoint};
use bevy_frugal_gi::knobs::{KnobLevels, KnobSpace};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::*;

/// A cost function, and the settings at which it was evaluated, in order.
struct Problem {
    cost: fn(KnobLevels) -> CostPoint,
    evaluated: Vec<KnobLevels>,
}

impl Problem {
    fn new(cost: fn(KnobLevels) -> CostPoint) -> Self {
        Self { cost, evaluated: Vec::new() }
    }
}

impl Evaluate for Problem {
    type Error = Infallible;

    fn evaluate(&mut self, settings: KnobLevels) -> Result<CostPoint, Infallible> {
        self.evaluated.push(settings);
        Ok((self.cost)(settings))
    }
}

fn frontier_of(
    settings: impl IntoIterator<Item = KnobLevels>,
    cost: fn(KnobLevels) -> CostPoint,
) -> Frontier {
    Frontier::from_points(
        settings.into_iter().map(|settings| FrontierPoint { settings, cost: cost(settings) }),
    )
}

fn search(
    space: &KnobSpace,
    problem: &mut Problem,
    inherit: &[KnobLevels],
    config: SearchConfig,
) -> SearchOutcome {
    let Ok(outcome) = Search::new(space, config).run(problem, inherit, &mut |_| true);
    outcome
}

fn random_search(
    space: &KnobSpace,
    evaluations: usize,
    seed: u64,
    cost: fn(KnobLevels) -> CostPoint,
) -> Frontier {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let ends = [space.highest(), space.lowest()];
    frontier_of(
        ends.into_iter()
            .chain((2..evaluations).map(|_| space.canonical(random_settings(space, &mut random)))),
        cost,
    )
}
