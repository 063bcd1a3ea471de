use frugal_core::frontier::{CostPoint, FrontierPoint};
use frugal_core::knobs::KnobLevels;
use frugal_core::units::Watts;

use super::super::testing::{frontier, map, with_costs, with_noise, with_power};
use super::{compare as compare_with, *};

/// The command's default tolerance.
const TOLERANCE: f64 = 0.01;

fn of(points: &[(f64, f64)]) -> Frontier {
    let point = |(bits, (power, error)): (usize, &(f64, f64))| FrontierPoint {
        settings: KnobLevels::from_bits(bits as u128),
        cost: CostPoint::new(*power, *error),
    };
    Frontier::from_points(points.iter().enumerate().map(point))
}

fn compare(old: &FrontierMap, new: &FrontierMap) -> Result<MapComparison, String> {
    compare_with(old, new, false)
}

fn close(a: f64, b: f64) -> bool {
    (a - b).abs() < 1e-9
}

#[test]
fn power_between_two_points_is_linear_in_the_logarithm_of_error() {
    let frontier = of(&[(2.0, 0.04), (6.0, 0.01), (9.0, 0.0)]);
    let at = |error| power_at(&frontier, error).expect("reached");
    assert!(close(at(0.04), 2.0) && close(at(0.02), 4.0) && close(at(0.01), 6.0));
    // Settings below the requested error keep their cost; an error of 0 counts as the noise of
    // repeated renderings.
    assert!(close(at(0.05), 2.0));
    assert!(close(at(0.005), 6.0 + 3.0 * 2.0_f64.ln() / 10.0_f64.ln()), "{}", at(0.005));
    assert_eq!(power_at(&of(&[(2.0, 0.04), (6.0, 0.01)]), 0.005), None);
    assert_eq!(power_at(&Frontier::default(), 0.05), None);
}

#[test]
fn a_map_is_as_good_as_itself() {
    let comparison = compare(&map(), &map()).expect("comparable");
    assert_eq!(
        (comparison.change, comparison.shared_change, comparison.addresses_change),
        (0.0, Some(0.0), Some(0.0))
    );
    assert!(!comparison.rose_beyond(0.0));
    let counts: Vec<_> = comparison
        .errors
        .iter()
        .filter_map(|level| Some((level.shared?.frontiers, level.addresses?.frontiers)))
        .collect();
    assert_eq!(counts, [(1, 48); 6]);
}

#[test]
fn two_percent_are_found_and_noise_is_not_flagged() {
    for seed in 0..20 {
        let (old, new) =
            (with_noise(&map(), 0.005, 2 * seed), with_noise(&map(), 0.005, 2 * seed + 1));
        let comparison = compare(&old, &new).expect("comparable");
        assert!(!comparison.rose_beyond(TOLERANCE), "seed {seed}: {}", comparison.change);
        let comparison = compare(&old, &with_power(&new, 1.02)).expect("comparable");
        assert!(comparison.rose_beyond(TOLERANCE), "seed {seed}: {}", comparison.change);
        let comparison = compare(&with_power(&new, 1.02), &old).expect("comparable");
        assert!(
            comparison.change < 0.0 && !comparison.rose_beyond(0.0),
            "seed {seed}: {}",
            comparison.change
        );
    }
}

#[test]
fn settings_that_only_one_search_found_are_no_regression() {
    // Every third point is removed, as with another pool.
    let thin = |which: usize| {
        let mut thin = map();
        for frontier in thin.octree.frontiers.iter_mut().chain([&mut thin.shared]) {
            let kept = frontier
                .points()
                .iter()
                .enumerate()
                .filter(|(index, _)| index % 3 != which)
                .map(|(_, point)| *point);
            *frontier = Frontier::from_points(kept);
        }
        thin
    };
    for [old, new] in [[0, 1], [1, 0], [1, 2], [2, 1], [0, 2], [2, 0]] {
        let comparison = compare(&thin(old), &thin(new)).expect("comparable");
        assert!(
            comparison.change.abs() < TOLERANCE,
            "without {old} and without {new}: {}",
            comparison.change
        );
    }
}

#[test]
fn the_same_settings_at_more_error_cost_more_at_equal_error() {
    let worse = with_costs(&map(), |cost| CostPoint::new(cost.power.0, cost.error * 1.1));
    let comparison = compare(&map(), &worse).expect("comparable");
    assert!(comparison.rose_beyond(TOLERANCE) && comparison.change < 0.06, "{}", comparison.change);
}

#[test]
fn power_of_the_idle_device_does_not_hide_a_rise() {
    let idle = |map: &FrontierMap, watts: f64| {
        let mut map = with_costs(map, |cost| CostPoint::new(cost.power.0 + watts, cost.error));
        map.work_prices.idle = Watts(watts);
        map
    };
    let worse = with_power(&map(), 1.02);
    // The device idles at another power in each search.
    let warmer = compare(&idle(&map(), 72.0), &idle(&worse, 75.0)).expect("comparable");
    assert!((warmer.change - 0.02).abs() < 1e-6, "{warmer:?}");
    let comparison = compare(&idle(&map(), 40.0), &idle(&worse, 40.0)).expect("comparable");
    assert!(
        (comparison.change - 0.02).abs() < 1e-6 && comparison.idle_w == [40.0; 2],
        "{comparison:?}"
    );
    // Powers below the idle power have no ratio.
    let mut absurd = map();
    absurd.work_prices.idle = Watts(1e6);
    let refused = compare(&absurd, &map()).expect_err("no ratio").to_string();
    assert!(refused.contains("no error from 0.005 to 0.05 in common"), "{refused}");
}

#[test]
fn the_worse_of_shared_and_addresses_counts() {
    let mut new = map();
    new.shared = with_power(&map(), 1.03).shared;
    let comparison = compare(&map(), &new).expect("comparable");
    assert!(
        close(comparison.change, 0.03) && comparison.addresses_change == Some(0.0),
        "{comparison:?}"
    );
    let mut new = with_power(&map(), 1.03);
    new.shared = map().shared;
    let comparison = compare(&map(), &new).expect("comparable");
    assert!(
        close(comparison.change, 0.03) && comparison.shared_change == Some(0.0),
        "{comparison:?}"
    );
}

#[test]
fn empty_frontiers_are_left_out() {
    let mut bare = map();
    bare.shared = Frontier::default();
    bare.octree.frontiers[..40].fill(Frontier::default());
    for (old, new) in [(&bare, &map()), (&map(), &bare)] {
        let comparison = compare(old, new).expect("comparable");
        assert_eq!((comparison.change, comparison.shared_change), (0.0, None));
        assert!(
            comparison
                .errors
                .iter()
                .all(|level| level.addresses.is_some_and(|change| change.frontiers == 8))
        );
    }
    bare.octree.frontiers.fill(Frontier::default());
    let error = compare(&bare, &map()).expect_err("nothing").to_string();
    assert!(
        error.contains("0.005") && error.contains("0.05") && error.contains("frugal precompute"),
        "{error}"
    );
}

#[test]
fn levels_that_one_map_does_not_reach_are_left_out() {
    let mut short = map();
    short.shared = Frontier::from_points(frontier(1.0, 18).points()[..8].iter().copied());
    let comparison = compare(&map(), &short).expect("comparable");
    let reached: Vec<_> = comparison.errors.iter().map(|level| level.shared.is_some()).collect();
    assert_eq!(reached, [false, false, false, false, true, true]);
    assert_eq!(comparison.shared_change, Some(0.0));
}

#[test]
fn octrees_of_different_depth_meet_at_their_corners() {
    let mut deep = map();
    deep.octree.levels = 3;
    deep.octree
        .corners
        .iter_mut()
        .for_each(|corner| corner.at = corner.at.map(|coordinate| 8 * coordinate));
    let comparison = compare(&map(), &deep).expect("comparable");
    assert_eq!(
        (comparison.change, comparison.errors[0].addresses.map(|change| change.frontiers)),
        (0.0, Some(48))
    );
    deep.bounds.max = [2.0; 3];
    let comparison = compare(&map(), &deep).expect("comparable");
    assert_eq!((comparison.shared_change, comparison.addresses_change), (Some(0.0), None));
}

#[test]
fn extreme_powers_give_finite_changes() {
    for factor in [0.0, 1e-310, 1e-30, 1e30, 1e300, f64::MAX] {
        let new = with_costs(&map(), |cost| CostPoint::new(cost.power.0 * factor, cost.error));
        for (old, new) in [(&map(), &new), (&new, &map()), (&new, &new)] {
            let Ok(comparison) = compare(old, new) else { continue };
            assert!(comparison.change.is_finite(), "{factor}: {comparison:?}");
        }
    }
    assert!(compare(&map(), &with_power(&map(), 2.0)).expect("comparable").rose_beyond(f64::NAN));
}
