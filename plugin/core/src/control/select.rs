//! Selection of the point of a frontier under a budget.
//!
//! Wang et al. 2016, equations 3.2 (least error within a power) and 3.3 (least power within an
//! error), each one binary search.

#[cfg(feature = "bevy")]
use bevy_reflect::Reflect;

use super::limits::Limits;
use super::{Budget, Limit};
use crate::frontier::{CostPoint, ERROR_UNIT, ErrorRates, Frontier, FrontierPoint};
use crate::knobs::KnobLevels;

/// Whether the budget is met, and the fallback where it is not.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "bevy", derive(Reflect))]
pub enum Outcome {
    /// Every limit is met.
    Met,
    /// The selected settings meet the budget; those applied, on the way to them, do not yet. Of the
    /// applied settings only: a choice is never settling.
    Settling,
    /// Even the cheapest settings exceed the power limit; they are selected, whatever their error.
    PowerCannotBeMet,
    /// Even the best settings exceed the error limit, and power is not what limits them; the best
    /// are selected.
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
}

/// Upper limit of a frame's predicted error, as a multiple of the mean that an error budget allows; no
/// unit.
///
/// A mean allows some views above it. Higher values save more power on paths whose views resemble
/// the calibration views; lower values keep the mean on paths with harder views.
pub const MAX_OVER_MEAN: f64 = 2.0;

/// What a frame's error is worth under a budget of the mean error, and what it may be at most.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErrorPrice {
    rate: f64,
    most: f64,
    is_squared: bool,
}

impl ErrorPrice {
    /// By a map's calibration. `rate`: exchange rate λ, watts per unit of error where the error is
    /// 0.01, at least 0 ([`FrontierStore::error_rate`](crate::frontier::FrontierStore::error_rate));
    /// NaN is none. Errors weigh by their squares ([`Frontier::least_weighted`]): views then differ
    /// less, and a path that is unlike the calibration views misses the mean by less.
    pub fn calibrated(rate: f64, budget: f64) -> Self {
        Self { rate, most: MAX_OVER_MEAN * budget, is_squared: true }
    }

    /// By the calibration of a map: what `rates` hold for a `budget` of the mean error. `None` without
    /// calibration.
    pub fn of_budget(rates: &ErrorRates, budget: f64) -> Option<Self> {
        rates.rate(budget).map(|rate| Self::calibrated(rate, budget))
    }

    /// Where errors are measured in play, so that the mean is kept on any path: errors weigh as they
    /// are, which takes the least power for a mean (Everett 1963). `rate` as in
    /// [`calibrated`](Self::calibrated); at `target`, the mean of predicted errors that meets the
    /// budget, a watt is worth as much as by that.
    pub fn measured(rate: f64, target: f64) -> Self {
        let linear = 2.0 * rate * target / ERROR_UNIT;
        Self { rate: linear, most: MAX_OVER_MEAN * target, is_squared: false }
    }

    /// The point of `frontier` with the least sum of power and error. `None` without a rate.
    fn least<'a>(&self, frontier: &'a Frontier) -> Option<&'a FrontierPoint> {
        if self.is_squared {
            frontier.least_weighted(self.rate)
        } else {
            frontier.least_sum(self.rate)
        }
    }
}

/// Selects the point of `frontier` for `budget`. `None` where the frontier is empty or the budget
/// is [invalid](Budget::validate). Source: Wang et al. 2016, equations 3.2 and 3.3.
///
/// `price`: what error is worth under an error budget, where that is known. Without a price, or with
/// a rate of NaN, the budget limits the error of each frame.
///
/// Every point meets an infinite limit: an infinite power limit selects the best settings, an
/// infinite error limit the cheapest. No limit selects the best settings. On a frontier each
/// additional watt reduces the error, so no power is wasted.
pub fn select(frontier: &Frontier, budget: &Budget, price: Option<ErrorPrice>) -> Option<Choice> {
    select_within(frontier, &budget.limits().ok()?, price)
}

/// The same within limits that are valid. `None` where the frontier is empty.
pub(super) fn select_within(
    frontier: &Frontier,
    limits: &Limits,
    price: Option<ErrorPrice>,
) -> Option<Choice> {
    let cheapest = frontier.points().first()?;
    let best = frontier.points().last()?;
    let choice = |point: &FrontierPoint, outcome| {
        Some(Choice { settings: point.settings, cost: point.cost, outcome })
    };
    match (limits.power, limits.error) {
        (None, None) => choice(best, Outcome::Met),
        (None, Some(limit)) => {
            let price = price.filter(|_| limit.is_finite());
            let weighted = price.and_then(|price| price.least(frontier));
            let most = price.filter(|_| weighted.is_some()).map_or(limit, |price| price.most);
            let within = frontier.least_power_within(most);
            match (weighted, within) {
                // The better of the two: points rise in power and fall in error together.
                (Some(weighted), Some(within)) if within.cost.power <= weighted.cost.power => {
                    choice(weighted, Outcome::Met)
                }
                (_, Some(within)) => choice(within, Outcome::Met),
                (_, None) => choice(best, Outcome::ErrorCannotBeMet),
            }
        }
        (Some(limit), None) => match frontier.least_error_within(limit) {
            Some(point) => choice(point, Outcome::Met),
            None => choice(cheapest, Outcome::PowerCannotBeMet),
        },
        (Some(limit), Some(error)) => {
            let alone = select(frontier, &Budget::error(error), price)?;
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

impl Limits {
    /// What keeps the settings of `choice` from being better; `None`: nothing, they are the best, or
    /// no limit was given. These limits are in the watts of `frontier`.
    pub fn binds(&self, frontier: &Frontier, choice: &Choice) -> Option<Limit> {
        let dearer = frontier.points().iter().find(|point| point.cost.power > choice.cost.power);
        match choice.outcome {
            Outcome::ErrorCannotBeMet => Some(Limit::Error),
            Outcome::LimitedByPower | Outcome::PowerCannotBeMet => self.power_by,
            _ => {
                let dearer = dearer?;
                let is_power = self.power.is_some_and(|limit| dearer.cost.power > limit);
                if is_power { self.power_by } else { self.error.map(|_| Limit::Error) }
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
        select(&testing::frontier(1.0), &budget, None)
            .map(|choice| (choice.cost.power.0, choice.outcome))
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
        let choice = select(&never_exact, &Budget::error(0.01), None).expect("a choice");
        assert_eq!((choice.cost.power.0, choice.outcome), (2.0, Outcome::ErrorCannotBeMet));
    }

    #[test]
    fn a_rate_keeps_the_mean_and_limits_every_frame() {
        // Points at 1 W / 0.2, 2 W / 0.05 and 4 W / 0: error² ÷ 0.01 is 4, 0.25 and 0.
        let picked = |limit: f64, rate: f64| {
            let price = ErrorPrice::calibrated(rate, limit);
            select(&testing::frontier(1.0), &Budget::error(limit), Some(price))
                .map(|choice| choice.cost.power.0)
        };
        assert_eq!(
            [0.26, 0.27, 7.9, 8.1, f64::INFINITY].map(|rate| picked(0.16, rate)),
            [Some(1.0), Some(2.0), Some(2.0), Some(4.0), Some(4.0)]
        );
        assert_eq!(picked(0.09, 0.0), Some(2.0), "0.2 is more than two budgets");
        assert_eq!(picked(0.01, 0.0), Some(4.0));
        assert_eq!(picked(f64::INFINITY, 1e9), Some(1.0), "no limit is no limit");
        assert_eq!(picked(0.05, f64::NAN), Some(2.0), "as without a rate");
    }

    #[test]
    fn measured_errors_weigh_as_they_are() {
        // 1 W / 0.2, 2 W / 0.05, 4 W / 0: a watt buys 0.15, and then 0.025.
        let picked = |target: f64, rate: f64| {
            let price = ErrorPrice::measured(rate, target);
            select(&testing::frontier(1.0), &Budget::error(0.16), Some(price))
                .map(|choice| choice.cost.power.0)
        };
        // At a target of 0.16 a rate of 1 is worth 32 W for each unit of error.
        assert_eq!(
            [6.0, 7.0, 39.0, 41.0].map(|linear| picked(0.16, linear / 32.0)),
            [Some(1.0), Some(2.0), Some(2.0), Some(4.0)]
        );
        assert_eq!(picked(0.16, f64::INFINITY), Some(4.0));
        assert_eq!(picked(0.09, 0.0), Some(2.0), "0.2 is more than two targets");
        assert_eq!(picked(0.09, f64::NAN), Some(2.0), "as without a rate: 0.16 for each frame");
        let at_target = Frontier::from_points(testing::frontier(1.0).points()[..2].iter().copied());
        for rate in [0.1, 1.0, 10.0] {
            // Both are worth the same about the target.
            let sum = |price: ErrorPrice, error: f64| {
                if price.is_squared {
                    price.rate * error * error / 0.01
                } else {
                    price.rate * error
                }
            };
            let slope = |price| (sum(price, 0.0501) - sum(price, 0.0499)) / 0.0002;
            let both = [ErrorPrice::calibrated(rate, 0.05), ErrorPrice::measured(rate, 0.05)];
            let [a, b] = both.map(slope);
            assert!((a / b - 1.0).abs() < 1e-6, "{a} and {b}");
            assert!(both.iter().all(|price| price.least(&at_target).is_some()));
        }
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
        assert_eq!(select(&Frontier::default(), &Budget::power(Watts(1.0)), None), None);
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
            let at = |power: f64| select(&frontier, &Budget::new(Some(Watts(power)), error), None).expect("a choice");
            let (less, more) = (at(a.min(b)), at(a.max(b)));
            prop_assert!(more.cost.error <= less.cost.error && more.cost.power >= less.cost.power);
        }

        #[test]
        fn a_higher_error_limit_never_takes_more_power(frontier in any_frontier(), a in 0.0..1.5_f64, b in 0.0..1.5_f64) {
            let at = |error: f64| select(&frontier, &Budget::error(error), None).expect("a choice");
            prop_assert!(at(a.max(b)).cost.power <= at(a.min(b)).cost.power);
        }

        #[test]
        fn nothing_within_the_budget_is_better(frontier in any_frontier(), power in prop::option::of(0.0..25.0_f64), error in prop::option::of(0.0..1.5_f64)) {
            let budget = Budget::new(power.map(Watts), error);
            let choice = select(&frontier, &budget, None).expect("a choice");
            prop_assert_eq!(select(&frontier, &budget, None), Some(choice));
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
