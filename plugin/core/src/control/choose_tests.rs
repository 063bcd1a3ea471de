//! Tests of a frame's choice.

use std::time::Duration;

use proptest::prelude::*;

use super::*;
use crate::testing;

fn limits(budget: Budget) -> Limits {
    resolve(&budget, &Observed::default()).expect("valid limits")
}

fn rate(watts_per_error: f64, power: f64, error: f64, is_by_error: bool) -> Rate {
    Rate { watts_per_error, most: CostPoint::new(power, error), is_by_error }
}

const FREE: f64 = f64::INFINITY;

/// Power, outcome and binding limit on 1 W / 0.2, 2 W / 0.05 and 4 W / 0.
fn chosen(budget: Budget, rate: Rate, may_spend: bool) -> Option<(f64, Outcome, Option<Limit>)> {
    let choice = choose(&testing::frontier(1.0), &limits(budget), &rate, may_spend)?;
    Some((choice.cost.power.0, choice.outcome, choice.binding))
}

#[test]
fn a_view_that_moves_takes_the_least_sum_that_can_be_borne() {
    let budget = Budget::power(Watts(2.5));
    let at = |lambda, most| chosen(budget, rate(lambda, most, FREE, false), true);
    let by_power = Some(Limit::Power);
    assert_eq!(at(1.0, FREE), Some((1.0, Outcome::Met, by_power)));
    assert_eq!(at(10.0, FREE), Some((2.0, Outcome::Met, by_power)));
    assert_eq!(at(50.0, FREE), Some((4.0, Outcome::Met, None)), "more than the mean, for a while");
    assert_eq!(at(50.0, 3.9), Some((2.0, Outcome::Met, by_power)));
    assert_eq!(at(FREE, 9.0), Some((4.0, Outcome::Met, None)));
    assert_eq!(at(50.0, 0.5), Some((1.0, Outcome::PowerCannotBeMet, by_power)));
    assert_eq!(chosen(budget, rate(1.0, FREE, FREE, false), false).map(|it| it.0), Some(2.0));
    assert_eq!(
        choose(&Frontier::default(), &limits(budget), &rate(1.0, FREE, FREE, false), true),
        None
    );
}

#[test]
fn a_still_view_takes_what_could_stay() {
    for lambda in [0.0, 10.0, 1e9, FREE] {
        let of = |budget| chosen(budget, rate(lambda, FREE, FREE, false), false).map(|it| it.0);
        assert_eq!(of(Budget::power(Watts(2.5))), Some(2.0), "{lambda}");
        assert_eq!(of(Budget::error(0.1)), Some(2.0), "{lambda}");
        assert_eq!(of(Budget::default()), Some(4.0), "{lambda}");
    }
}

#[test]
fn no_frame_is_above_the_peak() {
    let peak = |watts: f64| Budget::power(Watts(9.0)).with_peak(Watts(watts));
    for may_spend in [false, true] {
        let of = |watts: f64| chosen(peak(watts), rate(FREE, FREE, FREE, false), may_spend);
        assert_eq!(of(4.0), Some((4.0, Outcome::Met, None)));
        assert_eq!(of(3.9), Some((2.0, Outcome::Met, Some(Limit::Peak))), "{may_spend}");
        assert_eq!(of(0.5), Some((1.0, Outcome::PowerCannotBeMet, Some(Limit::Peak))));
    }
}

#[test]
fn an_error_limit_asks_for_no_more_than_it_needs() {
    let of = |lambda, most_power, most_error| {
        let rate = rate(lambda, most_power, most_error, true);
        chosen(Budget::both(Watts(3.0), 0.1), rate, true)
    };
    assert_eq!(of(1.0, FREE, FREE), Some((1.0, Outcome::Met, Some(Limit::Error))));
    assert_eq!(of(1.0, FREE, 0.1), Some((2.0, Outcome::Met, Some(Limit::Error))));
    assert_eq!(of(1.0, 1.5, 0.1), Some((1.0, Outcome::LimitedByPower, Some(Limit::Power))));
    assert_eq!(of(1.0, FREE, -0.1), Some((4.0, Outcome::ErrorCannotBeMet, Some(Limit::Error))));
    let by_power = rate(1.0, FREE, FREE, false);
    let limited = chosen(Budget::both(Watts(3.0), 0.1), by_power, true);
    assert_eq!(limited, Some((1.0, Outcome::LimitedByPower, Some(Limit::Power))));
}

const LOW: KnobLevels = KnobLevels::from_bits(1);
const HIGH: KnobLevels = KnobLevels::from_bits(2);

fn cost(settings: KnobLevels) -> Option<CostPoint> {
    Some(if settings == LOW { CostPoint::new(5.0, 0.03) } else { CostPoint::new(6.0, 0.01) })
}

/// The target where settings cost what `cost` says.
fn choose_by(
    dwell: &mut Dwell,
    wanted: &Choice,
    delta_seconds: f64,
    dwell_seconds: f64,
    cost: fn(KnobLevels) -> Option<CostPoint>,
) -> KnobLevels {
    let settings = ControlSettings {
        dwell: Duration::from_secs_f64(dwell_seconds),
        transition: Duration::ZERO,
        ..Default::default()
    };
    dwell.choose(wanted, delta_seconds, &settings, |held, _| cost(held)).0
}

/// A choice of which the budget can bear `most` watts, at `rate` watts per unit of error.
fn wanting(settings: KnobLevels, most: f64, rate: f64) -> Choice {
    Choice {
        settings,
        cost: cost(settings).expect("a cost"),
        outcome: Outcome::Met,
        binding: None,
        most: CostPoint::new(most, f64::INFINITY),
        watts_per_error: rate,
    }
}

#[test]
fn alternating_targets_change_once_a_second() {
    let (mut dwell, mut last, mut changes) = (Dwell::default(), LOW, 0);
    for frame in 0..600 {
        // One is worth the change, and then the other.
        let (wanted, rate) = if (frame / 6) % 2 == 0 { (LOW, 10.0) } else { (HIGH, 100.0) };
        let target = choose_by(&mut dwell, &wanting(wanted, 7.0, rate), 1.0 / 60.0, 1.0, cost);
        changes += usize::from(target != last);
        last = target;
    }
    assert!((5..=10).contains(&changes), "{changes} in ten seconds");
}

#[test]
fn the_first_change_a_budget_that_cannot_bear_it_and_a_cut_do_not_wait() {
    let start = || {
        let mut dwell = Dwell::default();
        assert_eq!(choose_by(&mut dwell, &wanting(LOW, 7.0, 1.0), 0.1, 1.0, cost), LOW);
        for _ in 0..20 {
            assert_eq!(choose_by(&mut dwell, &wanting(LOW, 7.0, 1.0), 0.1, 1.0, cost), LOW);
        }
        assert_eq!(choose_by(&mut dwell, &wanting(HIGH, 7.0, 100.0), 0.1, 1.0, cost), HIGH);
        dwell
    };
    assert_eq!(choose_by(&mut start(), &wanting(LOW, 7.0, 1.0), 0.1, 1.0, cost), HIGH);
    assert_eq!(choose_by(&mut start(), &wanting(LOW, 5.9, 1.0), 0.1, 1.0, cost), LOW, "not borne");
    let mut cut = start();
    cut.end();
    assert_eq!(choose_by(&mut cut, &wanting(LOW, 7.0, 1.0), 0.1, 1.0, cost), LOW);
    let now = |dwell_seconds, cost: fn(KnobLevels) -> Option<CostPoint>| {
        choose_by(&mut start(), &wanting(LOW, 7.0, 1.0), 0.1, dwell_seconds, cost)
    };
    assert_eq!(now(0.0, cost), LOW);
    assert_eq!(now(1.0, |_| None), LOW, "unknown");
    let nothing = |_| Some(CostPoint::new(f64::NAN, f64::NAN));
    assert_eq!(now(1.0, nothing), LOW, "no number");
}

#[test]
fn a_change_must_be_worth_it() {
    let mut dwell = Dwell::default();
    choose_by(&mut dwell, &wanting(LOW, 7.0, 50.0), 0.1, 0.0, cost);
    // 6 W and 0.01 for 5 W and 0.03: worth it from 50 W for each unit of error.
    for (wanted, rate, expected) in
        [(HIGH, 49.0, LOW), (HIGH, 51.0, HIGH), (LOW, 51.0, HIGH), (LOW, 49.0, LOW)]
    {
        let found = choose_by(&mut dwell, &wanting(wanted, 7.0, rate), 0.1, 0.0, cost);
        assert_eq!(found, expected, "{rate}");
    }
    choose_by(&mut dwell, &wanting(HIGH, 7.0, 51.0), 0.1, 0.0, cost);
    // In a still view errors alone count, and what is better stays while it can be borne.
    assert_eq!(choose_by(&mut dwell, &wanting(LOW, 7.0, f64::INFINITY), 9.0, 0.0, cost), HIGH);
    assert_eq!(choose_by(&mut dwell, &wanting(LOW, 5.5, f64::INFINITY), 9.0, 0.0, cost), LOW);
}

#[test]
fn settings_stay_until_staying_has_lost_what_a_change_shows() {
    // An error of 0.02 less for 1 W more: at 1000 W per unit of error a gain of 0.019 a second. A change
    // shows 0.02, the mean of both errors, for the transition's two seconds.
    let settings = ControlSettings {
        dwell: Duration::ZERO,
        transition: Duration::from_secs(2),
        ..Default::default()
    };
    let frames = |rate: f64, most: f64| {
        let mut dwell = Dwell::default();
        let mut choose =
            |wanted: &Choice| dwell.choose(wanted, 0.01, &settings, |held, _| cost(held)).0;
        assert_eq!(choose(&wanting(LOW, 7.0, 1.0)), LOW);
        (1..2000).find(|_| choose(&wanting(HIGH, most, rate)) == HIGH)
    };
    assert_eq!(frames(1000.0, 7.0), Some(211));
    assert!(matches!(frames(f64::INFINITY, 7.0), Some(200 | 201)), "by errors alone");
    assert_eq!(frames(50.5, 7.0), None, "a gain of 0.0002 a second");
    assert_eq!(frames(1000.0, 4.9), Some(1), "not borne");
}

#[test]
fn a_view_moves_by_distance_or_angle_and_rests_at_a_change() {
    let mut dwell = Dwell::default();
    choose_by(&mut dwell, &wanting(LOW, 7.0, 1.0), 0.1, 1.0, cost);
    for (position, forward, expected) in [
        (Vec3::ZERO, Vec3::NEG_Z, false),
        (Vec3::X * 0.1, Vec3::NEG_Z, false),
        (Vec3::splat(f32::NAN), Vec3::NEG_Z, false),
        (Vec3::X * 0.3, Vec3::NEG_Z, true),
        (Vec3::ZERO, Vec3::NEG_Z, true),
    ] {
        dwell.see((position, forward));
        assert_eq!(dwell.has_moved, expected, "{position}");
    }
    choose_by(&mut dwell, &wanting(HIGH, 7.0, 100.0), 9.0, 1.0, cost);
    assert!(!dwell.has_moved);
    dwell.see((Vec3::ZERO, Vec3::NEG_Z));
    dwell.see((Vec3::ZERO, Vec3::new(0.1, 0.0, -1.0).normalize()));
    assert!(dwell.has_moved, "turned");
}

fn picked(budget: Budget) -> Option<(f64, Outcome)> {
    // Points at 1 W / 0.2, 2 W / 0.05 and 4 W / 0.
    select(&testing::frontier(1.0), &budget).map(|choice| (choice.cost.power.0, choice.outcome))
}

#[test]
fn a_power_limit_selects_the_least_error() {
    assert_eq!(picked(Budget::power(Watts(1.0))), Some((1.0, Outcome::Met)));
    assert_eq!(picked(Budget::power(Watts(3.999))), Some((2.0, Outcome::Met)));
    assert_eq!(picked(Budget::power(Watts(f64::INFINITY))), Some((4.0, Outcome::Met)));
    assert_eq!(picked(Budget::power(Watts(0.0))), Some((1.0, Outcome::PowerCannotBeMet)));
    assert_eq!(picked(Budget::power(Watts(0.999))), Some((1.0, Outcome::PowerCannotBeMet)));
}

#[test]
fn an_error_limit_selects_the_least_power() {
    assert_eq!(picked(Budget::error(0.0)), Some((4.0, Outcome::Met)));
    assert_eq!(picked(Budget::error(0.05)), Some((2.0, Outcome::Met)));
    assert_eq!(picked(Budget::error(0.199)), Some((2.0, Outcome::Met)));
    assert_eq!(picked(Budget::error(f64::INFINITY)), Some((1.0, Outcome::Met)));
    let never_exact = Frontier::from_points(testing::frontier(1.0).points()[..2].iter().copied());
    let choice = select(&never_exact, &Budget::error(0.01)).expect("a choice");
    assert_eq!((choice.cost.power.0, choice.outcome), (2.0, Outcome::ErrorCannotBeMet));
}

#[test]
fn power_takes_priority_over_error() {
    assert_eq!(picked(Budget::both(Watts(3.0), 0.1)), Some((2.0, Outcome::Met)));
    assert_eq!(
        picked(Budget::both(Watts(9.0), 0.1)),
        Some((2.0, Outcome::Met)),
        "no more power than the error limit asks for"
    );
    assert_eq!(picked(Budget::both(Watts(1.5), 0.1)), Some((1.0, Outcome::LimitedByPower)));
    assert_eq!(picked(Budget::both(Watts(0.5), 0.3)), Some((1.0, Outcome::PowerCannotBeMet)));
    assert_eq!(
        picked(Budget::both(Watts(f64::INFINITY), f64::INFINITY)),
        Some((1.0, Outcome::Met))
    );
    for error in [0.0, 0.02, 0.1, 0.2, 1.0, f64::INFINITY] {
        assert_eq!(
            picked(Budget::both(Watts(f64::INFINITY), error)),
            picked(Budget::error(error)),
            "{error}"
        );
    }
}

#[test]
fn no_limit_selects_the_best_and_an_invalid_limit_nothing() {
    assert_eq!(picked(Budget::default()), Some((4.0, Outcome::Met)));
    for limit in [f64::NAN, -1.0, f64::NEG_INFINITY] {
        assert_eq!(picked(Budget::power(Watts(limit))), None);
        assert_eq!(picked(Budget::error(limit)), None);
    }
    assert_eq!(select(&Frontier::default(), &Budget::power(Watts(1.0))), None);
}

fn any_frontier() -> impl Strategy<Value = Frontier> {
    prop::collection::vec((0.0..20.0_f64, 0.0..1.0_f64), 1..60).prop_map(|costs| {
        Frontier::from_points(costs.iter().enumerate().map(|(bits, (power, error))| {
            FrontierPoint {
                settings: KnobLevels::from_bits(bits as u128),
                cost: CostPoint::new(*power, *error),
            }
        }))
    })
}

proptest! {
    #[test]
    fn more_power_never_gives_more_error(frontier in any_frontier(), a in 0.0..25.0_f64, b in 0.0..25.0_f64, error in prop::option::of(0.0..1.0_f64)) {
        let at = |power: f64| select(&frontier, &Budget::new(Some(Watts(power)), error)).expect("a choice");
        let (less, more) = (at(a.min(b)), at(a.max(b)));
        prop_assert!(more.cost.error <= less.cost.error && more.cost.power >= less.cost.power);
    }

    #[test]
    fn a_higher_error_limit_never_takes_more_power(frontier in any_frontier(), a in 0.0..1.5_f64, b in 0.0..1.5_f64) {
        let at = |error: f64| select(&frontier, &Budget::error(error)).expect("a choice");
        prop_assert!(at(a.max(b)).cost.power <= at(a.min(b)).cost.power);
    }

    #[test]
    fn nothing_within_the_budget_is_better(frontier in any_frontier(), power in prop::option::of(0.0..25.0_f64), error in prop::option::of(0.0..1.5_f64)) {
        let budget = Budget::new(power.map(Watts), error);
        let choice = select(&frontier, &budget).expect("a choice");
        prop_assert_eq!(select(&frontier, &budget), Some(choice));
        let fits_power = |cost: CostPoint| power.is_none_or(|limit| cost.power.0 <= limit);
        let fits_error = |cost: CostPoint| error.is_none_or(|limit| cost.error <= limit);
        for point in frontier.points() {
            let cost = point.cost;
            prop_assert!(!cost.dominates(choice.cost));
            match choice.outcome {
                Outcome::Met => {
                    prop_assert!(fits_power(choice.cost) && fits_error(choice.cost));
                    if error.is_none() {
                        prop_assert!(!fits_power(cost) || cost.error >= choice.cost.error);
                    } else {
                        prop_assert!(
                            !(fits_power(cost) && fits_error(cost))
                                || cost.power >= choice.cost.power
                        );
                    }
                }
                Outcome::Settling => prop_assert!(false, "a choice is never settling"),
                Outcome::PowerCannotBeMet => prop_assert!(!fits_power(cost) && cost.power >= choice.cost.power),
                Outcome::ErrorCannotBeMet => prop_assert!(!fits_error(cost) && cost.error >= choice.cost.error),
                Outcome::LimitedByPower => prop_assert!(!(fits_power(cost) && fits_error(cost)) && fits_power(choice.cost)),
            }
        }
    }
}
