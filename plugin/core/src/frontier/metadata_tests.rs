//! Tests of error rates and of effects of knobs.

use super::*;
use crate::testing;

fn rates(pairs: &[(f64, f64)]) -> ErrorRates {
    ErrorRates(
        pairs
            .iter()
            .map(|(budget, watts_per_error)| ErrorRate {
                budget: *budget,
                watts_per_error: *watts_per_error,
                predicted: None,
            })
            .collect(),
    )
}

#[test]
fn a_budget_gets_the_target_of_the_next_lower_calibrated_one() {
    let rates = rates(&[(0.01, 1000.0), (0.04, 10.0), (0.1, 0.0)]);
    assert!(rates.is_sound());
    let mut with_target = rates.clone();
    with_target.0[0].predicted = Some(0.008);
    assert_eq!(
        [0.005, 0.01, 0.02, 0.05].map(|budget| with_target.target(budget)),
        [Some(0.0), Some(0.008), Some(0.016), None]
    );
    assert_eq!([f64::NAN, f64::INFINITY].map(|budget| with_target.target(budget)), [None, None]);
    assert_eq!([0.0, -1.0].map(|budget| rates.target(budget)), [Some(0.0); 2]);
    assert_eq!(ErrorRates::default().target(0.1), None);
}

#[test]
fn rates_out_of_order_or_range_are_invalid() {
    assert!(ErrorRates::default().is_sound());
    for invalid in [
        rates(&[(0.01, 1.0), (0.01, 0.5)]),
        rates(&[(0.01, 1.0), (0.02, 2.0)]),
        rates(&[(0.0, 1.0)]),
        rates(&[(0.01, -1.0)]),
        rates(&[(f64::NAN, 1.0)]),
        rates(&[(0.01, f64::INFINITY)]),
    ] {
        assert!(!invalid.is_sound(), "{invalid:?}");
    }
}

#[test]
fn effects_belong_to_the_levels_of_a_space() {
    // Knobs of five and three levels.
    let space = testing::space();
    let levels = |of: fn(usize) -> f64| [5, 3].map(|count| (0..count).map(of).collect()).to_vec();
    let effects = KnobEffects {
        joules: levels(|level| 0.01 * (4.0 - level as f64)),
        errors: levels(|level| 0.1 / (1.0 + level as f64)),
    };
    assert!(effects.is_sound(&space) && KnobEffects::default().is_sound(&space));
    let found = effects.of(0, 1, 30.0).expect("an effect");
    assert!((found.power.0 - 0.9).abs() < 1e-12 && (found.error - 0.05).abs() < 1e-12);
    assert_eq!((effects.of(2, 0, 30.0), effects.of(1, 3, 30.0)), (None, None));
    let faults: [fn(&mut KnobEffects); 5] = [
        |it| it.joules[0][0] = -1.0,
        |it| it.joules[1][0] = f64::NAN,
        |it| it.errors[1][2] = 2.1,
        |it| it.errors.truncate(1),
        |it| it.joules[0].truncate(4),
    ];
    for (number, fault) in faults.into_iter().enumerate() {
        let mut faulty = effects.clone();
        fault(&mut faulty);
        assert!(!faulty.is_sound(&space), "fault {number}");
    }
}
