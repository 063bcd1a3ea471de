//! The search on problems with known frontiers: ZDT1 to ZDT3 (Zitzler, Deb, Thiele 2000,
//! "Comparison of multiobjective evolutionary algorithms") and DTLZ2 (Deb, Thiele, Laumanns,
//! Zitzler 2002) on levels instead of real variables, and a model of rendering costs small enough
//! to enumerate.
//!
//! The problems' optima lie at level 0 of most variables, where the seeding begins. So they are
//! moved to inner levels, a different one for each knob: no seed is on the frontier.

use std::convert::Infallible;
use std::f64::consts::{FRAC_PI_2, PI};

use bevy_frugal_gi::frontier::{CostPoint, Frontier, FrontierPoint};
use bevy_frugal_gi::knobs::{Knob, KnobLevels, KnobSpace};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::*;

const KNOBS: usize = 16;
const LEVELS: usize = 16;
const REFERENCE: CostPoint = CostPoint::new(1.0, 1.0);

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

fn frontier_of(
    settings: impl IntoIterator<Item = KnobLevels>,
    cost: fn(KnobLevels) -> CostPoint,
) -> Frontier {
    Frontier::from_points(
        settings.into_iter().map(|settings| FrontierPoint { settings, cost: cost(settings) }),
    )
}

/// The exact frontier of the discrete problem: all variables but the first at 0.
fn exact(cost: fn(KnobLevels) -> CostPoint) -> Frontier {
    let best = space().from_levels(|knob, _| optimum(knob));
    frontier_of((0..LEVELS).map(|level| best.with_level(0, level)), cost)
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
            .chain((2..evaluations).map(|_| space.canonical(mutation::any(space, &mut random)))),
        cost,
    )
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
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

/// Seven rendering knobs, 16,128 names for 13,536 images: multiplicative costs, errors that mask
/// one another, and one knob without effect.
fn rendering_space() -> KnobSpace {
    let levels = |count: u32| (0..count).map(f64::from);
    KnobSpace::new(vec![
        Knob::new("vpl_count", levels(7)),
        Knob::new("visibility", levels(3)).needing("vpl_count", 1),
        Knob::new("pixel_share", levels(4)).needing("vpl_count", 1),
        Knob::new("shadows", levels(4)),
        Knob::new("antialiasing", levels(6)),
        Knob::new("scale", levels(4)),
        Knob::new("idle", levels(2)),
    ])
    .expect("a valid space")
}

fn rendering(settings: KnobLevels) -> CostPoint {
    let level = |knob: usize| settings.level(knob) as f64;
    let pixels = (0.5 + level(5) / 6.0).powi(2);
    let lights = if settings.level(0) == 0 { 0.0 } else { 2_f64.powf(level(0)) / 64.0 };
    let gi = lights * (0.3 + 0.35 * level(1)) * 2_f64.powf(level(2) - 3.0) * 6.0;
    // The second antialiasing costs more than the third, as measured filters do.
    let filter = [0.0, 0.5, 0.3, 0.4, 0.6, 0.8][settings.level(4)];
    let power = 2.0 + pixels * (1.0 + gi + filter) + 0.2 * 2_f64.powf(level(3));
    let lost = |share: f64, weight: f64| weight * share.powf(1.5);
    let gi_error = if settings.level(0) == 0 {
        0.12
    } else {
        lost(1.0 - level(0) / 6.0, 0.08)
            + lost(1.0 - level(1) / 2.0, 0.02)
            + lost(1.0 - level(2) / 3.0, 0.03)
    };
    let kept = (1.0 - gi_error)
        * (1.0 - lost(1.0 - level(3) / 3.0, 0.04))
        * (1.0 - lost(1.0 - level(4) / 5.0, 0.03))
        * (1.0 - lost(1.0 - level(5) / 3.0, 0.15));
    CostPoint::new(power, 1.0 - kept)
}

#[test]
fn few_evaluations_find_most_of_a_rendering_frontier() {
    let space = rendering_space();
    let reference =
        CostPoint::new(rendering(space.highest()).power.0, rendering(space.lowest()).error);
    let exact = frontier_of(space.iter(), rendering);
    let best = exact.hypervolume(reference);
    let mut lines = Vec::new();
    for evaluations in [15, 30, 60, 120, 240, 480] {
        let (mut cold, mut warm, mut random) = (Vec::new(), Vec::new(), Vec::new());
        for seed in 0..11 {
            let config = SearchConfig {
                seed,
                max_evaluations: Some(evaluations),
                ..SearchConfig::default()
            };
            let mut problem = Problem::new(rendering);
            cold.push(
                search(&space, &mut problem, &[], config.clone()).frontier.hypervolume(reference)
                    / best,
            );
            assert_eq!(problem.evaluated.len(), evaluations);
            // A neighbour that was searched with as small a budget.
            let mut neighbour = Problem::new(|settings| {
                rendering(settings.with_level(3, settings.level(3).max(1)))
            });
            let inherit = search(
                &space,
                &mut neighbour,
                &[],
                SearchConfig { seed: seed + 100, ..config.clone() },
            )
            .frontier;
            let inherit: Vec<_> = inherit.points().iter().map(|point| point.settings).collect();
            warm.push(
                search(&space, &mut Problem::new(rendering), &inherit, config)
                    .frontier
                    .hypervolume(reference)
                    / best,
            );
            random.push(
                random_search(&space, evaluations, seed, rendering).hypervolume(reference) / best,
            );
        }
        lines.push((evaluations, [median(cold), median(warm), median(random)]));
    }

    for (evaluations, [cold, warm, random]) in lines {
        let least = match evaluations {
            ..30 => 0.0,
            30 => 0.9,
            60 => 0.95,
            120 => 0.97,
            240 => 0.985,
            _ => 0.99,
        };
        assert!(cold > least && warm > least, "{evaluations}: {cold} {warm}");
        assert!(cold > random && warm > random, "{evaluations}: {cold} {warm} random {random}");
    }
}

#[test]
fn nothing_is_evaluated_twice_and_everything_is_canonical() {
    let space = rendering_space();
    let mut problem = Problem::new(rendering);
    let outcome = search(&space, &mut problem, &[], SearchConfig::default());
    assert_eq!(outcome.evaluations, problem.evaluated.len());
    let mut unique = problem.evaluated.clone();
    unique.sort_unstable();
    unique.dedup();
    assert_eq!(unique.len(), problem.evaluated.len());
    assert!(unique.iter().all(|settings| space.canonical(*settings) == *settings));
    assert!(unique.contains(&space.highest()) && unique.contains(&space.lowest()));
    assert_eq!(outcome.frontier, frontier_of(unique, rendering), "of everything evaluated");
}

#[test]
fn a_small_space_is_enumerated_and_a_limit_is_kept() {
    let space = KnobSpace::new(vec![
        Knob::new("a", [0.0, 1.0, 2.0]),
        Knob::new("b", [0.0, 1.0]).needing("a", 1),
    ])
    .expect("a valid space");
    let mut problem = Problem::new(rendering);
    assert_eq!(search(&space, &mut problem, &[], SearchConfig::default()).evaluations, 5);
    // Just short of all: evolves, and still evaluates nothing twice.
    let mut problem = Problem::new(rendering);
    assert_eq!(
        search(
            &space,
            &mut problem,
            &[],
            SearchConfig { max_evaluations: Some(4), ..SearchConfig::default() }
        )
        .evaluations,
        4
    );
    let mut problem = Problem::new(rendering);
    let none = search(
        &space,
        &mut problem,
        &[],
        SearchConfig { max_evaluations: Some(0), ..SearchConfig::default() },
    );
    assert_eq!(problem.evaluated, [space.highest(), space.lowest()]);
    assert_eq!(none.frontier.points().len(), 2);
    let empty = KnobSpace::default();
    assert_eq!(
        search(&empty, &mut Problem::new(rendering), &[], SearchConfig::default()).evaluations,
        1
    );
}

#[test]
fn a_seed_decides_everything() {
    let space = rendering_space();
    let order = |seed| {
        let mut problem = Problem::new(rendering);
        search(
            &space,
            &mut problem,
            &[],
            SearchConfig { seed, max_evaluations: Some(100), ..SearchConfig::default() },
        );
        problem.evaluated
    };
    assert_eq!(order(7), order(7));
    assert_ne!(order(7), order(8));
}

#[test]
fn costs_that_are_not_finite_are_tolerated() {
    let space = rendering_space();
    let nothing = search(
        &space,
        &mut Problem::new(|_| CostPoint::new(f64::NAN, 0.0)),
        &[],
        SearchConfig::default(),
    );
    assert!(nothing.frontier.is_empty() && nothing.complete);
    let half = |settings: KnobLevels| {
        if settings.level(5).is_multiple_of(2) {
            CostPoint::new(f64::INFINITY, f64::NAN)
        } else {
            rendering(settings)
        }
    };
    let found = search(&space, &mut Problem::new(half), &[], SearchConfig::default()).frontier;
    assert!(found.points().len() > 5 && found.points().iter().all(|point| point.cost.is_finite()));
}

#[test]
fn it_stops_anywhere_with_the_best_so_far() {
    let space = rendering_space();
    for patience in [0usize, 1, 2, 3, 10, 25, 40, 100] {
        let mut problem = Problem::new(rendering);
        let mut asked = 0;
        let mut keep_going = |_: usize| {
            asked += 1;
            asked < patience
        };
        let Ok(outcome) =
            Search::new(&space, SearchConfig::default()).run(&mut problem, &[], &mut keep_going);
        assert_eq!(outcome.evaluations, patience.saturating_sub(1));
        assert!(!outcome.complete);
        assert_eq!(outcome.frontier, frontier_of(problem.evaluated, rendering));
    }
}
