//! A frame's choice on the frontier of its view, within limits (Wang et al. 2016, equations 3.2 and 3.3)
//! or at the exchange rate that a budget allows, and its dwell: how long a target stays before another
//! takes its place.
//!
//! A change of settings is visible, a brief gain is not. So a target stays for a least time, and then until
//! staying has lost as much as the change shows: the mean error of both settings for the time of a
//! transition (as in renting or buying skis: Karlin et al. 1988, "Competitive snoopy caching"). What the
//! budget cannot bear does not stay.

use glam::Vec3;

use super::limits::{Limits, resolve};
use super::observed::Observed;
use super::rate::Rate;
use super::{Budget, ControlSettings, Limit};
use crate::frontier::{CostPoint, Frontier, FrontierPoint};
use crate::knobs::KnobLevels;
use crate::units::Watts;

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
/// The limits hold for this frame alone: for means over a horizon, see [`Inputs::choose`](super::Inputs::choose).
///
/// Every point meets an infinite limit: an infinite power limit selects the best settings, an
/// infinite error limit the cheapest. No limit selects the best settings. On a frontier each
/// additional watt reduces the error, so no power is wasted.
pub fn select(frontier: &Frontier, budget: &Budget) -> Option<Choice> {
    select_within(frontier, &resolve(budget, &Observed::default()).ok()?)
}

/// The same within limits that are valid. `None` where the frontier is empty.
fn select_within(frontier: &Frontier, limits: &Limits) -> Option<Choice> {
    let (cheapest, best) = (frontier.points().first()?, frontier.points().last()?);
    let choice = |point: &FrontierPoint, outcome| {
        let most = CostPoint::new(f64::INFINITY, f64::INFINITY);
        let (settings, cost, binding) = (point.settings, point.cost, None);
        Some(Choice { settings, cost, outcome, binding, most, watts_per_error: f64::INFINITY })
    };
    let (wanted, outcome) = match limits.error {
        None => (best, Outcome::Met),
        Some(limit) => match frontier.least_power_within(limit) {
            Some(point) => (point, Outcome::Met),
            None => (best, Outcome::ErrorCannotBeMet),
        },
    };
    let Some(limit) = limits.power else { return choice(wanted, outcome) };
    if wanted.cost.power <= limit {
        return choice(wanted, outcome);
    }
    // More power than the error limit asks for is above the power limit: all within it is used.
    match frontier.least_error_within(limit) {
        Some(point) if limits.error.is_none_or(|error| point.cost.error <= error) => {
            choice(point, Outcome::Met)
        }
        Some(point) => choice(point, Outcome::LimitedByPower),
        None => choice(cheapest, Outcome::PowerCannotBeMet),
    }
}

/// The settings of `frontier` with the least power + λ × error, among those that the budget can bear for
/// the time that settings are held. `None` where the frontier is empty. `limits` are in the watts of the
/// frontier.
///
/// If `may_spend` is false, the best settings that the budget can bear for good. That is where the
/// view has not moved since the last switch, since settings that alternate in a still view are
/// seen, or where the horizon is too short for a mean.
pub(super) fn choose(
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

/// Distance, metres, and cosine of the angle from which a view has moved.
const MOVED: (f32, f32) = (0.2, 0.996);
/// Exchange rate that stands for an infinite one, where powers decide between equal errors.
const LARGE_RATE: f64 = 1e12;

/// The target in use, and since when.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Dwell {
    /// With its error in this frame's view, and its power where a frontier had it last.
    target: Option<(KnobLevels, CostPoint)>,
    seconds: f64,
    /// What better targets would have gained since, error × seconds.
    lost: f64,
    /// Position and viewing direction at the last change.
    view: Option<(Vec3, Vec3)>,
    /// Whether the view has moved since the target changed last.
    pub(super) has_moved: bool,
}

impl Dwell {
    /// Tells of this frame's position and viewing direction.
    pub(super) fn see(&mut self, (position, forward): (Vec3, Vec3)) {
        let then = *self.view.get_or_insert((position, forward));
        // Not `<`, so that NaN is no movement.
        self.has_moved |= position.distance(then.0) > MOVED.0 || forward.dot(then.1) < MOVED.1;
    }

    /// The target of this frame, `delta_seconds` after the last, and what it costs here: that of `wanted`,
    /// or the one in use. `cost_of`: what settings cost here, in the watts of `wanted`, from what they cost
    /// before.
    pub(super) fn choose(
        &mut self,
        wanted: &Choice,
        delta_seconds: f64,
        settings: &ControlSettings,
        cost_of: impl FnOnce(KnobLevels, CostPoint) -> Option<CostPoint>,
    ) -> (KnobLevels, CostPoint) {
        let delta_seconds = if delta_seconds > 0.0 { delta_seconds } else { 0.0 };
        self.seconds += delta_seconds;
        let target = match self.target {
            Some((held, known)) if held != wanted.settings => cost_of(held, known)
                .filter(|cost| self.stays(*cost, wanted, delta_seconds, settings))
                .map(|cost| (held, cost)),
            Some(_) => Some((wanted.settings, wanted.cost)),
            None => None,
        };
        let target = target.unwrap_or_else(|| {
            (self.seconds, self.lost, self.view, self.has_moved) = (0.0, 0.0, None, false);
            (wanted.settings, wanted.cost)
        });
        self.target = Some(target);
        target
    }

    /// Whether a target of this `cost` stays though another is `wanted`. Adds what that loses.
    fn stays(
        &mut self,
        cost: CostPoint,
        wanted: &Choice,
        delta_seconds: f64,
        settings: &ControlSettings,
    ) -> bool {
        let is_borne = cost.power <= wanted.most.power && cost.error <= wanted.most.error;
        let rate = wanted.watts_per_error.min(LARGE_RATE);
        let sum = |cost: CostPoint| cost.power.0 + rate * cost.error;
        let gain = sum(cost) - sum(wanted.cost);
        self.lost = (self.lost + gain / rate * delta_seconds).max(0.0);
        let shown = 0.5 * (cost.error + wanted.cost.error) * settings.transition.as_secs_f64();
        let is_early = self.seconds < settings.dwell.as_secs_f64();
        // Not `>=`, so that NaN does not wait for ever.
        is_borne && (is_early || self.lost < shown || gain < 0.0)
    }

    /// Lets the next target in at once.
    pub(super) fn end(&mut self) {
        self.target = None;
    }
}

#[cfg(test)]
#[path = "choose_tests.rs"]
mod tests;
