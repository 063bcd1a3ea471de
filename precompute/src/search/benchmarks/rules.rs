//! What holds on any problem.

use bevy_frugal_gi::frontier::CostPoint;
use bevy_frugal_gi::knobs::{Knob, KnobLevels, KnobSpace};

use super::rendering::{rendering, rendering_space};
use super::{Problem, Search, SearchConfig, frontier_of, search};

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
