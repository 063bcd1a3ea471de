//! One power limit for all cameras, divided among them, and the levels that they share.

use bevy::log::warn_once;
use frugal_core::control::{Rank, agree};

use super::frame::{Agreement, Frame, same_space};
use super::{AppBudget, Limit, Outcome, PowerCorrection, PowerDivision, PowerFeedback};
use crate::frontier::{CostPoint, Frontier, FrontierPoint};
use crate::knobs::KnobLevels;
use crate::units::Watts;

impl AppBudget {
    /// The valid and finite limit.
    fn limit(&self) -> Option<Watts> {
        let limit = self.power.filter(|limit| limit.0 != f64::INFINITY)?;
        if limit.0 >= 0.0 {
            return Some(limit);
        }
        warn_once!("AppBudget of {} W is ignored: give a number of watts of 0 or more", limit.0);
        None
    }
}

/// Divides the app's budget among the cameras, each within its own, and agrees on the levels of the
/// knobs that they share. Changes their choices.
pub(super) fn divide(
    app_budget: &AppBudget,
    feedback: &PowerFeedback,
    division: &mut PowerDivision,
    frames: &mut [Frame<'_>],
) {
    let app_limit = app_budget.limit();
    let correction = feedback.per_camera();
    // The cameras of the first one's knob space share levels, if there are several cameras.
    let wanted = if frames.len() > 1 { wanted(frames) } else { None };
    if frames.is_empty() || (app_limit.is_none() && wanted.is_none()) {
        return;
    }
    // Every frontier includes the device's idle power; a meter's offset takes that into account.
    let is_metered = feedback.correction != PowerCorrection::default();
    let counted_again = if is_metered { 0.0 } else { frames.len() as f64 - 1.0 };
    let idle = frames.last().and_then(|frame| frame.store.conditions()).map(|it| it.idle);
    let limit = app_limit.map_or(Watts(f64::INFINITY), |limit| {
        feedback.correction.uncorrected(limit) + idle.unwrap_or(Watts(0.0)) * counted_again
    });
    let alone = frames.iter().map(|frame| frame.weight * frame.choice.cost.error).sum();
    let mut is_kept = true;
    let mut among = |frames: &[Frame<'_>], agreed: Option<(usize, Agreement<'_>)>| {
        division.clear();
        let mut missed = 0;
        for frame in frames {
            let shared =
                agreed.filter(|(first, _)| same_space(&frames[*first].space, &frame.space));
            let own = frame.limits.power.map(|limit| correction.uncorrected(limit));
            let limits = (own, frame.choice.cost.power);
            let shared = shared.map(|(_, agreed)| agreed);
            missed += add_points(division, &frame.frontier, limits, shared, frame.weight)?;
        }
        is_kept = division.divide(limit);
        let (error, power) = division.sums();
        Some(Rank { missed: missed + usize::from(!is_kept), error, power })
    };
    let agreed = match wanted {
        Some((first, Agreement { shared, levels })) => {
            let levels = agree(&shared, levels, frames.len(), alone, |levels| {
                among(frames, Some((first, Agreement { shared, levels })))
            });
            Some((first, Agreement { shared, levels }))
        }
        None => {
            among(frames, None);
            None
        }
    };
    let space = agreed.map(|(first, _)| std::sync::Arc::clone(&frames[first].space));
    for (number, frame) in frames.iter_mut().enumerate() {
        let shares = space.as_ref().is_some_and(|space| same_space(space, &frame.space));
        frame.agreed = agreed.map(|(_, agreed)| agreed).filter(|_| shares);
        let chosen = division.chosen(number);
        let point = chosen.and_then(|chosen| frame.frontier.points().get(chosen)).copied();
        take(frame, point, app_limit.is_some(), is_kept, correction);
    }
}

/// The highest level of each shared knob that a camera asks for, with the number of the first camera
/// that shares knobs. `None` where none does.
fn wanted<'a>(frames: &[Frame<'a>]) -> Option<(usize, Agreement<'a>)> {
    let first = frames.iter().position(|frame| frame.store.shared_levels().is_some())?;
    let shared = frames[first].store.shared_levels()?;
    let same = frames.iter().filter(|frame| same_space(&frames[first].space, &frame.space));
    let levels = same
        .fold(KnobLevels::default(), |levels, frame| shared.highest(levels, frame.choice.settings));
    Some((first, Agreement { shared, levels }))
}

/// Makes the `point` that was divided to a camera its choice.
fn take(
    frame: &mut Frame<'_>,
    point: Option<FrontierPoint>,
    has_app_limit: bool,
    is_kept: bool,
    correction: PowerCorrection,
) {
    let (choice, limits) = (&mut frame.choice, &mut frame.limits);
    let is_other = point.is_some_and(|point| point.settings != choice.settings);
    if has_app_limit && (is_other || !is_kept) {
        frame.binding = Some(Limit::AppBudget);
    }
    if let Some(point) = point {
        (choice.settings, choice.cost) = (point.settings, point.cost);
    }
    if let Some(agreed) = &frame.agreed {
        choice.cost.power = choice.cost.power + agreed.charge(choice.settings);
    }
    let part = correction.corrected(choice.cost.power);
    let limit = limits.power.unwrap_or(Watts(f64::INFINITY));
    let is_own_kept = part.0 <= limit.0 * (1.0 + 1e-9);
    let misses_error = limits.error.is_some_and(|limit| is_other && choice.cost.error > limit);
    choice.outcome = match choice.outcome {
        _ if !is_kept || !is_own_kept => Outcome::PowerCannotBeMet,
        Outcome::Met if misses_error => Outcome::LimitedByPower,
        outcome => outcome,
    };
    if has_app_limit {
        limits.power = Some(if limit < part { limit } else { part });
    }
}

/// Adds the points of a camera to `division`: those up to the power of its own choice, the second of
/// `limits`, that keep its own limit, the first, with what shared knobs cost it. The cheapest where
/// none keeps it; returns the number of cameras of which that is so. `None` where all settings ask
/// for more of a shared knob than is agreed on. Powers are the frontier's.
fn add_points(
    division: &mut PowerDivision,
    frontier: &Frontier,
    (own, most): (Option<Watts>, Watts),
    shared: Option<Agreement<'_>>,
    weight: f64,
) -> Option<usize> {
    let charged = |point: &FrontierPoint| {
        let (settings, CostPoint { power, error }) = (point.settings, point.cost);
        match shared {
            Some(agreed) => (!agreed.shared.exceeds(settings, agreed.levels))
                .then(|| CostPoint::new((power + agreed.charge(settings)).0, error)),
            None => Some(point.cost),
        }
    };
    let points = || {
        let all = frontier.points().iter().enumerate();
        let wanted = all.take_while(|(_, point)| point.cost.power <= most);
        wanted.filter_map(|(number, point)| Some((number, charged(point)?)))
    };
    let keeps = |cost: &CostPoint| {
        own.is_none_or(|own| shared.is_none() || cost.power.0 <= own.0 * (1.0 + 1e-9))
    };
    if points().any(|(_, cost)| keeps(&cost)) {
        division.add_points(points().filter(|(_, cost)| keeps(cost)), weight);
        return Some(0);
    }
    let cheapest = points().min_by(|(_, a), (_, b)| a.power.0.total_cmp(&b.power.0))?;
    division.add_points(std::iter::once(cheapest), weight);
    Some(1)
}
