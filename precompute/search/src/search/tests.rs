//! The search on problems with known frontiers: ZDT1 and ZDT2 (Zitzler, Deb, Thiele 2000,
//! "Comparison of multiobjective evolutionary algorithms") on levels instead of real variables, and
//! what holds on any problem.

use frugal_core::frontier::{CostPoint, Frontier, FrontierPoint};
use frugal_core::knobs::{Knob, KnobLevels, KnobSpace};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::{nsga2, random_settings};

const KNOBS: usize = 16;
const LEVELS: usize = 16;
const REFERENCE: CostPoint = CostPoint::new(1.0, 1.0);

type Cost = fn(KnobLevels) -> CostPoint;

fn space() -> KnobSpace {
    let knob = |knob| Knob::new(&format!("x{knob}"), (0..LEVELS).map(|level| level as f64));
    KnobSpace::new((0..KNOBS).map(knob).collect()).expect("a valid space")
}

/// The optimum is an inner level, a different one for each knob: no end of the space is on the
/// frontier.
fn optimum(knob: usize) -> usize {
    (5 * knob + 3) % LEVELS
}

fn share(levels: usize) -> f64 {
    levels as f64 / (LEVELS - 1) as f64
}

fn zdt(settings: KnobLevels, shape: fn(f64) -> f64) -> CostPoint {
    let first = share(settings.level(0));
    let others = (1..KNOBS).map(|knob| share(settings.level(knob).abs_diff(optimum(knob))));
    let g = 1.0 + 9.0 * others.sum::<f64>() / (KNOBS - 1) as f64;
    CostPoint::new(first, g * (1.0 - shape(first / g)))
}

fn zdt1(settings: KnobLevels) -> CostPoint {
    zdt(settings, f64::sqrt)
}

fn zdt2(settings: KnobLevels) -> CostPoint {
    zdt(settings, |x| x * x)
}

fn frontier_of(settings: impl IntoIterator<Item = KnobLevels>, cost: Cost) -> Frontier {
    let point = |settings| FrontierPoint { settings, cost: cost(settings) };
    Frontier::from_points(settings.into_iter().map(point))
}

/// The frontier found, and the settings evaluated, in order.
fn search(space: &KnobSpace, seed: u64, cost: Cost) -> (Frontier, Vec<KnobLevels>) {
    let mut evaluated = Vec::new();
    let found = nsga2(space, seed, &[], &mut |settings| {
        evaluated.push(settings);
        cost(settings)
    });
    (found, evaluated)
}

/// The area that a frontier dominates, bounded by [`REFERENCE`]. Larger is better.
fn hypervolume(frontier: &Frontier) -> f64 {
    let inside = frontier
        .points()
        .iter()
        .filter(|p| p.cost.power < REFERENCE.power && p.cost.error < REFERENCE.error);
    let (mut area, mut error) = (0.0, REFERENCE.error);
    for point in inside {
        area += (REFERENCE.power.0 - point.cost.power.0) * (error - point.cost.error);
        error = point.cost.error;
    }
    area
}

#[test]
fn known_frontiers_are_found_and_random_search_is_not_close() {
    let space = space();
    for cost in [zdt1 as Cost, zdt2] {
        let best = space.from_levels(|knob, _| optimum(knob));
        let exact = frontier_of((0..LEVELS).map(|level| best.with_level(0, level)), cost);
        let (found, evaluated) = search(&space, 1, cost);
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let sampled: Vec<_> =
            (0..evaluated.len()).map(|_| random_settings(&space, &mut random)).collect();
        let [ours, random] = [found, frontier_of(sampled, cost)]
            .map(|found| hypervolume(&found) / hypervolume(&exact));
        assert!(ours > 0.99 && random < 0.3, "{ours} {random}");
    }
}

#[test]
fn nothing_is_evaluated_twice_and_a_seed_decides_everything() {
    let space = space();
    let (found, evaluated) = search(&space, 7, zdt1);
    let mut unique = evaluated.clone();
    unique.sort_unstable();
    unique.dedup();
    assert_eq!((unique.len(), evaluated.len()), (evaluated.len(), 4000));
    assert!(unique.iter().all(|settings| space.canonical(*settings) == *settings));
    assert!(unique.contains(&space.highest()) && unique.contains(&space.lowest()));
    assert_eq!(found, frontier_of(unique, zdt1), "of everything evaluated");
    assert_eq!(search(&space, 7, zdt1), (found, evaluated.clone()));
    assert_ne!(search(&space, 8, zdt1).1, evaluated);
}

#[test]
fn a_small_space_is_enumerated() {
    let knobs = vec![Knob::new("a", [0.0, 1.0, 2.0]), Knob::new("b", [0.0, 1.0]).needing("a", 1)];
    let space = KnobSpace::new(knobs).expect("a valid space");
    assert_eq!(search(&space, 0, |_| REFERENCE).1.len(), 5);
    assert_eq!(search(&KnobSpace::default(), 0, |_| REFERENCE).1.len(), 1);
}

#[test]
fn costs_that_are_not_finite_are_tolerated() {
    let (nothing, _) = search(&space(), 0, |_| CostPoint::new(f64::NAN, 0.0));
    assert!(nothing.is_empty());
    let half = |settings: KnobLevels| {
        let is_broken = settings.level(5).is_multiple_of(2);
        if is_broken { CostPoint::new(f64::INFINITY, f64::NAN) } else { zdt1(settings) }
    };
    let (found, _) = search(&space(), 0, half);
    assert!(found.points().len() > 5 && found.points().iter().all(|point| point.cost.is_finite()));
}
