//! Tests of frontiers: dominance, look-ups, estimates, and their text.

use proptest::prelude::*;

use super::*;
use crate::testing;

fn point(bits: u128, power: f64, error: f64) -> FrontierPoint {
    FrontierPoint { settings: KnobLevels::from_bits(bits), cost: CostPoint::new(power, error) }
}

fn staircase() -> Frontier {
    Frontier::from_points([
        point(0, 1.0, 0.5),
        point(1, 2.0, 0.3),
        point(2, 2.5, 0.3), // dominated
        point(3, 4.0, 0.0),
        point(4, f64::NAN, 0.0),
        point(5, 3.0, f64::NAN),
        point(6, f64::INFINITY, 0.0),
    ])
}

#[test]
fn dominated_and_non_finite_points_are_dropped() {
    let kept: Vec<_> = staircase().points().iter().map(|p| p.settings.bits()).collect();
    assert_eq!(kept, [0, 1, 3]);
}

#[test]
fn both_searches_take_the_best_within_the_budget() {
    let frontier = staircase();
    let by_power = |watts| frontier.least_error_within(Watts(watts)).map(|p| p.settings.bits());
    assert_eq!(
        [0.0, 0.999, 1.0, 3.9, 4.0, f64::INFINITY].map(by_power),
        [None, None, Some(0), Some(1), Some(3), Some(3)]
    );
    assert_eq!([f64::NAN, f64::NEG_INFINITY, -1.0].map(by_power), [None; 3]);
    let by_error = |error| frontier.least_power_within(error).map(|p| p.settings.bits());
    assert_eq!(
        [0.0, 0.29, 0.3, 0.5, f64::INFINITY].map(by_error),
        [Some(3), Some(3), Some(1), Some(0), Some(0)]
    );
    assert_eq!([f64::NAN, f64::NEG_INFINITY, -1.0].map(by_error), [None; 3]);
    assert_eq!(Frontier::default().least_error_within(Watts(1.0)), None);
    assert_eq!(Frontier::default().least_power_within(1.0), None);
}

#[test]
fn a_rate_selects_the_least_sum() {
    let frontier = staircase();
    let at = |rate| frontier.least_sum(rate).map(|p| p.settings.bits());
    // A watt buys 0.2 of error, and then 0.15.
    assert_eq!(
        [0.0, 4.9, 5.1, 6.6, 6.7, f64::INFINITY].map(at),
        [Some(0), Some(0), Some(1), Some(1), Some(3), Some(3)]
    );
    assert_eq!((at(f64::NAN), at(-1.0), Frontier::default().least_sum(1.0)), (None, Some(0), None));
}

#[test]
fn dominance_is_strict_and_ignores_nan() {
    let a = CostPoint::new(1.0, 0.1);
    assert!(!a.dominates(a));
    assert!(a.dominates(CostPoint::new(1.0, 0.2)));
    assert!(a.dominates(CostPoint::new(2.0, 0.1)));
    assert!(!a.dominates(CostPoint::new(0.5, 0.2)));
    assert!(!CostPoint::new(f64::NAN, 0.0).dominates(a));
}

#[test]
fn points_are_short_tuples() {
    let frontier =
        Frontier::from_points([point(3, 7.123_449, 0.123_456_7), point(17, 1_234.56, 0.0)]);
    assert_eq!(ron::to_string(&frontier), Ok("[(3,7.123,0.123457),(17,1235.0,0.0)]".into()));
}

#[test]
fn points_that_rounding_makes_equal_are_written_once() {
    let frontier = Frontier::from_points([
        point(1, 7.000_1, 0.2),
        point(2, 7.000_2, 0.1),
        point(3, 8.0, 0.099_999_9),
    ]);
    let text = ron::to_string(&frontier).expect("serialisable");
    assert_eq!(text, "[(2,7.0,0.1)]");
    assert_eq!(ron::from_str::<Frontier>(&text), Ok(frontier.rounded()));
}

#[test]
fn invalid_frontiers_are_rejected() {
    for (bad, why) in [
        ("[(0,2.0,0.1),(1,1.0,0.2)]", "out of order"),
        ("[(0,1.0,0.1),(1,2.0,0.2)]", "dominated"),
        ("[(0,1.0,0.1),(1,1.0,0.1)]", "dominated"),
        ("[(0,NaN,0.1)]", "finite"),
        ("[(0,1.0,inf)]", "finite"),
        ("[(0,1.0)]", ""),
    ] {
        let error = ron::from_str::<Frontier>(bad).expect_err(bad).to_string();
        assert!(error.contains(why), "{bad}: {error}");
    }
}

proptest! {
    #[test]
    fn written_frontiers_are_read_back(costs in prop::collection::vec((0.0..500.0_f64, 0.0..2.0_f64), 0..40)) {
        let points = costs.iter().enumerate().map(|(bits, (power, error))| point(bits as u128, *power, *error));
        let frontier = Frontier::from_points(points);
        let text = ron::to_string(&frontier).expect("serialisable");
        let back: Frontier = ron::from_str(&text).expect("the written text");
        prop_assert_eq!(&back, &frontier.rounded());
        prop_assert_eq!(ron::to_string(&back), Ok(text));
        for (kept, original) in back.points().iter().filter_map(|p| Some((p, frontier.points().iter().find(|o| o.settings == p.settings)?))) {
            prop_assert!((kept.cost.power.0 - original.cost.power.0).abs() <= 0.000_501 * original.cost.power.0);
            prop_assert!((kept.cost.error - original.cost.error).abs() <= 0.000_000_501);
        }
    }
}

fn at(samples: usize, scale: usize) -> KnobLevels {
    KnobLevels::default().with_level(0, samples).with_level(1, scale)
}

#[test]
fn points_are_exact_and_settings_between_lie_between() {
    // (0, 0): 1 W / 0.2; (2, 0): 2 W / 0.05; (4, 2): 4 W / 0.
    let (frontier, space) = (testing::frontier(1.0), testing::space());
    let estimate = |settings| frontier.estimate(&space, settings).expect("a cost");
    for point in frontier.points() {
        assert_eq!(estimate(point.settings), point.cost);
    }
    let mut before = 1.0;
    for settings in [at(1, 0), at(3, 0), at(3, 1), at(4, 1)] {
        let power = estimate(settings).power.0;
        assert!(power > before && power < 4.0, "{power} W at {settings:?}");
        before = power;
    }
    assert_eq!(estimate(at(1, 0)).power.0, 1.5);
    // Comparable with no point but the ends.
    let odd = estimate(at(0, 2)).power.0;
    assert!((1.0..=4.0).contains(&odd), "{odd}");
    assert_eq!(Frontier::default().estimate(&space, at(0, 0)), None);
    // Levels that the space lacks are no danger.
    assert!(estimate(KnobLevels::from_bits(u128::MAX)).is_finite());
}
