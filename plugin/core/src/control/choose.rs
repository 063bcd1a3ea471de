//! A frame's choice on the frontier of its view, at the exchange rate that a budget allows.

use super::limits::Limits;
use super::rate::Rate;
use super::select::select_within;
use super::{Choice, Limit, Outcome};
use crate::frontier::{CostPoint, Frontier, FrontierPoint};
use crate::units::Watts;

/// The settings of `frontier` with the least power + λ × error, among those that the budget can bear for
/// the time that settings are held. `None` where the frontier is empty. `limits` are in the watts of the
/// frontier.
///
/// If `may_spend` is false, the best settings that the budget can bear for good. That is where the
/// view has not moved since the last switch, since settings that alternate in a still view are
/// seen, or where the horizon is too short for a mean.
pub fn choose(
    frontier: &Frontier,
    limits: &Limits,
    rate: &Rate,
    may_spend: bool,
) -> Option<Choice> {
    let peak = limits.peak.unwrap_or(Watts(f64::INFINITY));
    let most = CostPoint {
        power: if peak < rate.most.power { peak } else { rate.most.power },
        error: rate.most.error,
    };
    if !may_spend {
        let lower = |a: Watts, b: Watts| if b < a { b } else { a };
        let power = [limits.power, limits.peak].into_iter().flatten().reduce(lower);
        let choice = select_within(frontier, &Limits { power, ..*limits })?;
        let is_by_error = limits.error.is_some() && choice.outcome == Outcome::Met;
        // What is held already may be better than what could stay, for as long as the budget bears it.
        let watts_per_error = if is_by_error { 0.0 } else { f64::INFINITY };
        let binding = binding(frontier, limits, &choice, is_by_error);
        return Some(Choice { binding, most, watts_per_error, ..choice });
    }
    let (cheapest, points) = (frontier.points().first()?, frontier.points());
    let within = &points[..points.partition_point(|point| point.cost.power <= most.power)];
    let mut affordable = within.iter().filter(|point| point.cost.error <= most.error);
    let lambda = rate.watts_per_error;
    let best = if lambda == f64::INFINITY {
        affordable.next_back()
    } else {
        let sum = |point: &FrontierPoint| point.cost.power.0 + lambda * point.cost.error;
        affordable.min_by(|a, b| sum(a).total_cmp(&sum(b)))
    };
    let (point, outcome) = match best {
        Some(point) => {
            let misses = limits.error.is_some_and(|limit| point.cost.error > limit);
            let is_limited = misses && !rate.is_by_error;
            (point, if is_limited { Outcome::LimitedByPower } else { Outcome::Met })
        }
        // Nothing is as good as the error's limit asks for now, or as cheap as the power's.
        None => match within.last() {
            Some(point) if point.cost.power == points[points.len() - 1].cost.power => {
                (point, Outcome::ErrorCannotBeMet)
            }
            Some(point) => (point, Outcome::LimitedByPower),
            None => (cheapest, Outcome::PowerCannotBeMet),
        },
    };
    let choice = Choice {
        settings: point.settings,
        cost: point.cost,
        outcome,
        binding: None,
        most,
        watts_per_error: lambda,
    };
    Some(Choice { binding: binding(frontier, limits, &choice, rate.is_by_error), ..choice })
}

/// What keeps the settings of `choice` from being better; `None`: nothing, they are the best, or no limit
/// was given.
fn binding(
    frontier: &Frontier,
    limits: &Limits,
    choice: &Choice,
    is_by_error: bool,
) -> Option<Limit> {
    let dearer = frontier.points().iter().find(|point| point.cost.power > choice.cost.power);
    let by_power = || match (limits.power, limits.peak) {
        (power, Some(peak)) if power.is_none_or(|power| peak < power) => {
            let is_over = dearer.is_none_or(|dearer| dearer.cost.power > peak);
            if is_over { limits.peak_by } else { limits.power_by }
        }
        _ => limits.power_by,
    };
    match choice.outcome {
        Outcome::ErrorCannotBeMet => Some(Limit::Error),
        Outcome::LimitedByPower | Outcome::PowerCannotBeMet => by_power(),
        _ if dearer.is_none() => None,
        _ if is_by_error => Some(Limit::Error),
        _ => by_power(),
    }
}

#[cfg(test)]
#[path = "choose_tests.rs"]
mod tests;
