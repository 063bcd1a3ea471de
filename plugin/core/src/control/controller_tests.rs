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
        inputs.correction = correction;
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
