//! Tests of shared knobs: what they cost, and which levels cameras agree on.

use super::*;
use crate::knobs::Knob;

fn space() -> KnobSpace {
    let knobs = ["rays", "shadows", "cascades"].map(|name| Knob::new(name, [0.0, 1.0, 2.0]));
    KnobSpace::new(knobs.into()).expect("a space")
}

/// Shadows of 0, 1 and 4 J times one to three cascades, less the lowest.
fn shared() -> SharedKnobs {
    let joules = [0.0, 1.0, 4.0].map(|area| [1.0, 2.0, 3.0].map(|count| area * count));
    SharedKnobs {
        names: vec!["shadows".into(), "cascades".into()],
        joules: joules.into_iter().flatten().collect(),
    }
}

fn at(rays: usize, shadows: usize, cascades: usize) -> KnobLevels {
    KnobLevels::default().with_level(0, rays).with_level(1, shadows).with_level(2, cascades)
}

#[test]
fn a_camera_pays_for_what_others_ask_for_and_it_does_not() {
    let (space, shared) = (space(), shared());
    assert!(shared.is_sound(&space));
    let levels = SharedLevels::new(&shared, &space, 10.0).expect("shared knobs");
    assert_eq!(levels.charge(at(2, 0, 0), at(0, 2, 1)), Watts(80.0));
    assert_eq!(levels.charge(at(2, 2, 0), at(0, 2, 1)), Watts(40.0));
    assert_eq!(levels.charge(at(0, 2, 2), at(2, 1, 1)), Watts(0.0), "its own are higher");
    assert_eq!(levels.highest(at(2, 1, 0), at(1, 0, 2)), at(0, 1, 2));
    assert!(levels.exceeds(at(0, 1, 0), at(2, 0, 2)) && !levels.exceeds(at(2, 0, 0), at(0, 0, 0)));
    // Levels that the space lacks are no danger.
    assert!(levels.charge(KnobLevels::default(), KnobLevels::from_bits(u128::MAX)).0 > 0.0);
}

#[test]
fn faulty_shared_knobs_are_none() {
    let space = space();
    let faults: [fn(&mut SharedKnobs); 5] = [
        |it| it.names[0] = "unknown".into(),
        |it| it.names = vec!["shadows".into(); 5],
        |it| it.joules.truncate(8),
        |it| it.joules[3] = f64::NAN,
        |it| it.joules[3] = -1.0,
    ];
    for (number, fault) in faults.into_iter().enumerate() {
        let mut faulty = shared();
        fault(&mut faulty);
        assert!(!faulty.is_sound(&space), "fault {number}");
        if number < 3 {
            assert!(SharedLevels::new(&faulty, &space, 10.0).is_none(), "fault {number}");
        }
    }
    assert!(SharedKnobs::default().is_sound(&space));
    assert!(SharedLevels::new(&SharedKnobs::default(), &space, 10.0).is_none());
}

#[test]
fn the_best_levels_are_found() {
    let knobs = ["a", "b"].map(|name| Knob::new(name, [0.0, 1.0, 2.0, 3.0]));
    let space = KnobSpace::new(knobs.into()).expect("a space");
    let knobs = SharedKnobs { names: vec!["a".into(), "b".into()], joules: vec![0.0; 16] };
    let shared = SharedLevels::new(&knobs, &space, 1.0).expect("shared knobs");
    // Best at (1, 2); no settings at a = 0.
    let sum = |levels: KnobLevels| {
        let (a, b) = (levels.level(0), levels.level(1));
        (a > 0).then_some((a as f64 - 1.0).abs() + (b as f64 - 2.0).abs())
    };
    for cameras in [2, 64] {
        assert_eq!(shared.agree(both(3, 3), cameras, -1.0, sum), both(1, 2), "{cameras}");
        let mut calls = 0;
        let kept = shared.agree(both(2, 2), cameras, 1.0, |levels| {
            calls += 1;
            sum(levels)
        });
        assert_eq!((kept, calls), (both(2, 2), 1), "{cameras}: what all choose alone");
        assert_eq!(shared.agree(both(0, 0), cameras, 0.0, sum), both(0, 0));
    }
}

fn both(a: usize, b: usize) -> KnobLevels {
    KnobLevels::default().with_level(0, a).with_level(1, b)
}
