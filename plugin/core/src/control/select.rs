//! Selection of the point of a frontier under a budget.
//!
//! Wang et al. 2016, equations 3.2 (least error within a power) and 3.3 (least power within an
//! error), each one binary search.

use super::limits::Limits;
use super::{Budget, Limit};
use crate::frontier::{CostPoint, Frontier, FrontierPoint};
use crate::knobs::KnobLevels;

/// Whether the budget is met, and the fallback where it is not.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "bevy", derive(bevy_reflect::Reflect))]
pub enum Outcome {
    /// Every limit is met.
    Met,
    /// The selected settings meet the budget; the applied ones, on the way to them, do not yet.
    /// Never the outcome of a [`Choice`].
    Settling,
    /// Even the cheapest settings exceed the power limit; they are selected, whatever their error.
    PowerCannotBeMet,
    /// Even the best settings exceed the error limit; they are selected, as the power limit allows
    /// them.
    ErrorCannotBeMet,
    /// No settings meet both limits; the least error within the power limit is selected, above the
    /// error limit.
    LimitedByPower,
}

/// The selected point of a frontier.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Choice {
    /// The settings.
    pub settings: KnobLevels,
    /// Predicted power and error at the sample camera.
    pub cost: CostPoint,
    /// Whether the budget is met.
    pub outcome: Outcome,
    /// What keeps the settings from being better; `None` where nothing does.
    pub binding: Option<Limit>,
    /// The power and the error that the budget can bear for the time that settings are held.
    pub most: CostPoint,
    /// The exchange rate λ by which other settings are compared with these, watts per unit of error:
    /// infinity compares errors alone, and 0 powers.
    pub watts_per_error: f64,
}

/// Selects the point of `frontier` for `budget`. `None` where the frontier is empty or the budget
/// is [invalid](Budget::validate). Source: Wang et al. 2016, equations 3.2 and 3.3.
///
/// The limits hold for this frame alone: for means over a horizon, see [`choose`](super::choose).
///
/// Every point meets an infinite limit: an infinite power limit selects the best settings, an
/// infinite error limit the cheapest. No limit selects the best settings. On a frontier each
/// additional watt reduces the error, so no power is wasted.
pub fn select(frontier: &Frontier, budget: &Budget) -> Option<Choice> {
    select_within(frontier, &budget.limits().ok()?)
}

/// The same within limits that are valid. `None` where the frontier is empty.
pub(super) fn select_within(frontier: &Frontier, limits: &Limits) -> Option<Choice> {
    let cheapest = frontier.points().first()?;
    let best = frontier.points().last()?;
    let choice = |point: &FrontierPoint, outcome| {
        let most = CostPoint::new(f64::INFINITY, f64::INFINITY);
        let (settings, cost, binding) = (point.settings, point.cost, None);
        Some(Choice { settings, cost, outcome, binding, most, watts_per_error: f64::INFINITY })
    };
    match (limits.power, limits.error) {
        (None, None) => choice(best, Outcome::Met),
        (None, Some(limit)) => match frontier.least_power_within(limit) {
            Some(point) => choice(point, Outcome::Met),
            None => choice(best, Outcome::ErrorCannotBeMet),
        },
        (Some(limit), None) => match frontier.least_error_within(limit) {
            Some(point) => choice(point, Outcome::Met),
            None => choice(cheapest, Outcome::PowerCannotBeMet),
        },
        (Some(limit), Some(error)) => {
            let alone = select(frontier, &Budget::error(error))?;
            if alone.cost.power <= limit {
                return Some(alone);
            }
            // More power than the error limit asks for is above the power limit: all within it is
            // used.
            match frontier.least_error_within(limit) {
                Some(point) if point.cost.error <= error => choice(point, Outcome::Met),
                Some(point) => choice(point, Outcome::LimitedByPower),
                None => choice(cheapest, Outcome::PowerCannotBeMet),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::testing;
    use crate::units::Watts;

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
        let never_exact =
            Frontier::from_points(testing::frontier(1.0).points()[..2].iter().copied());
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
}
