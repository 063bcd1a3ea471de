//! Tests of a frame's choice.

use super::*;
use crate::control::Budget;
use crate::testing;

fn limits(budget: Budget) -> Limits {
    budget.limits().expect("valid limits")
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
