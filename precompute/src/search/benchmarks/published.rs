//! ZDT1 to ZDT3 (Zitzler, Deb, Thiele 2000, "Comparison of multiobjective evolutionary algorithms")
//! and DTLZ2 (Deb, Thiele, Laumanns, Zitzler 2002).
//!
//! The problems' optima lie at level 0 of most variables, where the seeding begins. So they are
//! moved to inner levels, a different one for each knob: no seed is on the frontier.

use std::f64::consts::{FRAC_PI_2, PI};

use bevy_frugal_gi::frontier::{CostPoint, Frontier, FrontierPoint};
use bevy_frugal_gi::knobs::{Knob, KnobLevels, KnobSpace};

use super::{Problem, SearchConfig, frontier_of, random_search, search};

const KNOBS: usize = 16;
const LEVELS: usize = 16;
const REFERENCE: CostPoint = CostPoint::new(1.0, 1.0);

fn space() -> KnobSpace {
    KnobSpace::new(
        (0..KNOBS)
            .map(|knob| Knob::new(&format!("x{knob}"), (0..LEVELS).map(|level| level as f64)))
            .collect(),
    )
    .expect("a valid space")
}

fn first(settings: KnobLevels) -> f64 {
    settings.level(0) as f64 / (LEVELS - 1) as f64
}

/// The level at which a knob's variable is 0.
fn optimum(knob: usize) -> usize {
    (5 * knob + 3) % LEVELS
}

fn others(settings: KnobLevels) -> impl Iterator<Item = f64> {
    (1..KNOBS)
        .map(move |knob| settings.level(knob).abs_diff(optimum(knob)) as f64 / (LEVELS - 1) as f64)
}

fn g(settings: KnobLevels) -> f64 {
    1.0 + 9.0 * others(settings).sum::<f64>() / (KNOBS - 1) as f64
}

fn zdt1(settings: KnobLevels) -> CostPoint {
    let (f, g) = (first(settings), g(settings));
    CostPoint::new(f, g * (1.0 - (f / g).sqrt()))
}

fn zdt2(settings: KnobLevels) -> CostPoint {
    let (f, g) = (first(settings), g(settings));
    CostPoint::new(f, g * (1.0 - (f / g).powi(2)))
}

fn zdt3(settings: KnobLevels) -> CostPoint {
    let (f, g) = (first(settings), g(settings));
    CostPoint::new(f, g * (1.0 - (f / g).sqrt() - f / g * (10.0 * PI * f).sin()))
}

fn dtlz2(settings: KnobLevels) -> CostPoint {
    let (angle, g) = (first(settings) * FRAC_PI_2, others(settings).map(|x| x * x).sum::<f64>());
    CostPoint::new((1.0 + g) * angle.cos(), (1.0 + g) * angle.sin())
}

/// The exact frontier of the discrete problem: all variables but the first at 0.
fn exact(cost: fn(KnobLevels) -> CostPoint) -> Frontier {
    let best = space().from_levels(|knob, _| optimum(knob));
    frontier_of((0..LEVELS).map(|level| best.with_level(0, level)), cost)
}

/// Worst share of the exact hypervolume over seeds, and the best share of random search with as
/// many evaluations.
fn compare(cost: fn(KnobLevels) -> CostPoint, reference: CostPoint) -> (f64, f64) {
    let space = space();
    let best = exact(cost).hypervolume(reference);
    let (mut worst, mut random) = (f64::INFINITY, 0.0_f64);
    for seed in 0..5 {
        let mut problem = Problem::new(cost);
        let config = SearchConfig { seed, generations: Some(100), ..SearchConfig::default() };
        let found = search(&space, &mut problem, &[], config).frontier;
        assert!(problem.evaluated.len() <= 24 * 101);
        worst = worst.min(found.hypervolume(reference) / best);
        random = random.max(
            random_search(&space, problem.evaluated.len(), seed, cost).hypervolume(reference)
                / best,
        );
    }

    (worst, random)
}

#[test]
fn discrete_frontiers_have_the_known_hypervolumes() {
    // Each of the 15 steps of a staircase misses at most a column of width 1/15 of the drop beside
    // it: together 1/15.
    let missing = 1.0 / (LEVELS - 1) as f64;
    for (cost, known) in [(zdt1 as fn(_) -> _, 2.0 / 3.0), (zdt2, 1.0 / 3.0)] {
        let area = exact(cost).hypervolume(REFERENCE);
        assert!(area < known && area > known - missing, "{area} of {known}");
    }
    assert!(
        exact(dtlz2)
            .points()
            .iter()
            .all(|point| (point.cost.power.0.hypot(point.cost.error) - 1.0).abs() < 1e-12)
    );
}

#[test]
fn zdt1_is_solved_and_random_search_is_not_close() {
    let (worst, random) = compare(zdt1, REFERENCE);
    assert!(worst > 0.99 && random < 0.3, "{worst} {random}");
}

#[test]
fn zdt2_is_solved_though_it_is_not_convex() {
    let (worst, random) = compare(zdt2, REFERENCE);
    assert!(worst > 0.99 && random < 0.3, "{worst} {random}");
}

#[test]
fn zdt3_is_solved_though_it_has_gaps() {
    let (worst, random) = compare(zdt3, REFERENCE);
    // Its frontier lies in five pieces; a run may miss the smallest.
    assert!(worst > 0.9 && random < 0.3, "{worst} {random}");
}

#[test]
fn dtlz2_ends_on_the_unit_circle() {
    let (worst, random) = compare(dtlz2, CostPoint::new(1.1, 1.1));
    assert!(worst > 0.99 && random < 0.8, "{worst} {random}");
    let mut problem = Problem::new(dtlz2);
    let config = SearchConfig { generations: Some(100), ..SearchConfig::default() };
    let found = search(&space(), &mut problem, &[], config).frontier;
    // One variable a level off its optimum adds (1/15)² = 0.0044 to the radius.
    let radius = |point: &FrontierPoint| point.cost.power.0.hypot(point.cost.error);
    assert!(
        found.points().iter().all(|point| (0.999_999..1.02).contains(&radius(point))),
        "{:?}",
        found.points()
    );
}
