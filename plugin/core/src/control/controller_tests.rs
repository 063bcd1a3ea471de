//! Tests of the controller without an app.

use super::*;
use crate::testing;

fn inputs(store: &dyn FrontierStore, budget: Budget, current: Option<KnobLevels>) -> Inputs<'_> {
    Inputs {
        store,
        // Along −Z: points at 6 W / 0.2, 7 W / 0.05 and 9 W / 0.
        view: testing::view(),
        budget,
        delta_seconds: 0.125,
        current,
        correction: PowerCorrection::default(),
        mean_correction: PowerCorrection::default(),
        settings: ControlSettings::default(),
        errors: ErrorFeedback::default(),
    }
}

#[test]
fn the_outcome_is_that_of_the_applied_settings() {
    let map = testing::map(1);
    let mut controller = CameraController::default();
    let first = controller.step(&inputs(&map, Budget::default(), None)).expect("a decision");
    assert_eq!((first.outcome, first.applied), (Outcome::Met, first.target));
    assert_eq!(first.predicted, first.predicted_applied);
    // Down from 9 W to 6 W: until it arrives, nothing is met.
    let budget = Budget::power(Watts(6.5));
    let mut current = first.applied;
    let mut powers = Vec::new();
    for _ in 0..10 {
        let found = controller.step(&inputs(&map, budget, Some(current))).expect("a decision");
        assert_eq!(found.predicted.power, Watts(6.0));
        let is_there = found.predicted_applied.power.0 <= 6.5;
        let expected = if is_there { Outcome::Met } else { Outcome::Settling };
        assert_eq!(found.outcome, expected, "{found:?}");
        powers.push(found.predicted_applied.power.0);
        current = found.applied;
    }
    assert!(powers[0] > 6.5 && powers.is_sorted_by(|a, b| a >= b), "{powers:?}");
    assert_eq!(powers.last(), Some(&6.0));
    // Upwards a power budget holds all the way.
    for _ in 0..10 {
        let budget = Budget::power(Watts(9.0));
        let found = controller.step(&inputs(&map, budget, Some(current))).expect("a decision");
        assert_eq!(found.outcome, Outcome::Met);
        current = found.applied;
    }
    // An error budget does not.
    controller.step(&inputs(&map, Budget::power(Watts(6.0)), None)).expect("a decision");
    let current = controller.filter.applied();
    let strict = inputs(&map, Budget::error(0.0), Some(current));
    assert_eq!(controller.step(&strict).map(|found| found.outcome), Some(Outcome::Settling));
}

#[test]
fn a_teleport_needs_no_word_from_the_app() {
    let map = testing::map(1);
    let mut controller = CameraController::default();
    let current = controller.step(&inputs(&map, Budget::default(), None)).expect("9 W").applied;
    let limited = inputs(&map, Budget::power(Watts(6.5)), Some(current));
    let smooth = controller.clone().step(&limited).expect("a decision");
    assert_ne!(smooth.applied, smooth.target);
    let mut elsewhere = limited;
    elsewhere.view.position.x += 100.0;
    let cut = controller.step(&elsewhere).expect("a decision");
    assert_eq!(cut.applied, cut.target);
}

#[test]
fn a_budget_is_in_the_watts_of_the_apps_meter() {
    let map = testing::map(1);
    let correction = PowerCorrection { gain: 2.0, offset: Watts(1.0) };
    let at = |watts: f64| {
        let mut inputs = inputs(&map, Budget::power(Watts(watts)), None);
        (inputs.correction, inputs.mean_correction) = (correction, correction);
        let found = CameraController::default().step(&inputs).expect("a decision");
        (found.predicted.power.0, found.uncorrected.0, found.outcome)
    };
    assert_eq!(at(15.0), (15.0, 7.0, Outcome::Met));
    assert_eq!(at(14.9), (13.0, 6.0, Outcome::Met));
    assert_eq!(at(12.9), (13.0, 6.0, Outcome::PowerCannotBeMet));
    assert_eq!(at(f64::INFINITY), (19.0, 9.0, Outcome::Met));
    let mut invalid = inputs(&map, Budget::power(Watts(-1.0)), None);
    for limit in [f64::NAN, -1.0] {
        invalid.budget = Budget::power(Watts(limit));
        invalid.correction = PowerCorrection { gain: 1.0, offset: Watts(-5.0) };
        invalid.mean_correction = invalid.correction;
        assert_eq!(CameraController::default().step(&invalid), None, "{limit}");
    }
}

#[test]
fn settings_of_others_are_where_the_transition_starts() {
    let map = testing::map(1);
    let mut controller = CameraController::default();
    let cheap = inputs(&map, Budget::power(Watts(6.0)), None);
    let low = controller.step(&cheap).expect("a decision").applied;
    let high = map.knobs.highest();
    let found = controller.step(&inputs(&map, cheap.budget, Some(high))).expect("a decision");
    assert_eq!(found.applied, high, "at t = 0");
    let found = controller.step(&inputs(&map, cheap.budget, Some(high))).expect("a decision");
    assert!(found.applied != high && found.applied != low, "{found:?}");
}

#[test]
fn settings_that_a_views_frontier_lacks_cost_what_they_did() {
    let mut map = testing::map(1);
    let here = map.look_up(&testing::view()).expect("a frontier").frontier.clone();
    let ends = Frontier::from_points([here.points()[0], here.points()[2]]);
    let others = map.octree.frontiers.iter_mut().filter(|one| **one != here);
    others.for_each(|one| *one = ends.clone());
    let mut controller = CameraController::default();
    let mut inputs = inputs(&map, Budget::power(Watts(8.0)), None);
    let first = controller.step(&inputs).expect("a decision");
    assert_eq!(first.predicted.power, Watts(7.0));
    // Along +X, where these settings are on no frontier: between its points they would cost 6.75 W.
    inputs.view.rotation = glam::Quat::from_rotation_y(-1.4);
    assert_eq!(map.look_up(&inputs.view).map(|found| found.frontier), Some(&ends));
    inputs.current = Some(first.applied);
    let held = controller.step(&inputs).expect("a decision");
    assert_eq!((held.target, held.predicted.power), (first.target, Watts(7.0)));
}

/// Plays `seconds` at eight frames a second along a view that `x` moves; returns applied powers.
fn walk(budget: Budget, seconds: usize, x: impl Fn(f32) -> f32) -> Vec<(KnobLevels, f64)> {
    let map = testing::map(1);
    let (mut controller, mut current) = (CameraController::default(), None);
    let frame = |frame: usize| {
        let mut inputs = inputs(&map, budget, current);
        inputs.view.position.x = x(frame as f32 / 8.0);
        let found = controller.step(&inputs).expect("a decision");
        current = Some(found.applied);
        (found.applied, found.predicted_applied.power.0)
    };
    (0..8 * seconds).map(frame).collect()
}

fn changes(played: &[(KnobLevels, f64)]) -> usize {
    played.windows(2).filter(|two| two[0].0 != two[1].0).count()
}

#[test]
fn a_still_view_does_not_switch_to_spend_what_is_left() {
    // 6 W, 7 W and 9 W.
    for limit in [6.2, 6.9, 7.5, 8.9] {
        let played = walk(Budget::power(Watts(limit)), 120, |_| 0.0);
        assert_eq!(changes(&played), 0, "{limit} W");
        // Nor where a hand shakes.
        let shaken = walk(Budget::power(Watts(limit)), 120, |time| 0.05 * (9.0 * time).sin());
        assert_eq!(changes(&shaken), 0, "{limit} W");
    }
}

#[test]
fn a_moving_view_spends_the_mean_and_a_peak_holds_in_every_frame() {
    let to_and_fro = |time: f32| (time * 0.7).sin();
    let played = walk(Budget::power(Watts(7.8)), 180, to_and_fro);
    let mean = played.iter().map(|(_, power)| power).sum::<f64>() / played.len() as f64;
    assert!((0.97 * 7.8..1.013 * 7.8).contains(&mean), "{mean}");
    assert!(played.iter().any(|(_, power)| *power > 8.9), "9 W for a while");
    let held = walk(Budget::power(Watts(7.8)).with_peak(Watts(8.0)), 180, to_and_fro);
    assert!(held.iter().all(|(_, power)| *power <= 8.0));
    let instant = Budget::power(Watts(7.8)).with_horizon(std::time::Duration::ZERO);
    assert!(walk(instant, 60, to_and_fro).iter().all(|(_, power)| *power <= 7.8));
}
