//! The system that divides power among cameras.

use std::sync::Arc;

use bevy::asset::Assets;
use bevy::camera::Camera;
use bevy::ecs::prelude::*;
use bevy::log::warn_once;

use super::agree::{Rank, agree};
use super::maps::{frontier_in_play, store_of};
use super::systems::{CameraState, Source, Step, same_space};
use super::{
    AppBudget, Budget, CameraPriority, Limit, Outcome, PowerCorrection, PowerDivision,
    PowerFeedback,
};
use crate::frontier::{CostPoint, Frontier, FrontierMap, FrontierPoint, SharedLevels};
use crate::knobs::{KnobLevels, KnobSpace};
use crate::units::Watts;

/// Divides the app's budget among the cameras, each within its own, and agrees on the levels of the
/// knobs that they share.
pub(super) fn divide_app_budget(
    app_budget: Res<AppBudget>,
    feedback: Res<PowerFeedback>,
    maps: Res<Assets<FrontierMap>>,
    mut division: Local<PowerDivision>,
    cameras: Query<(Entity, Source<'static>, Option<&Camera>, Option<&CameraPriority>)>,
    mut states: Query<&mut CameraState>,
) {
    let mut app_limit = app_budget.power.filter(|limit| limit.0 != f64::INFINITY);
    if let Some(limit) = app_limit
        && Budget::power(limit).validate().is_err()
    {
        warn_once!("AppBudget of {} W is ignored: give a number of watts of 0 or more", limit.0);
        app_limit = None;
    }
    let correction = feedback.per_camera();
    let (mut count, mut idle, mut alone) = (0, Watts(0.0), 0.0);
    let mut agreement: Option<(SharedLevels<'_>, Arc<KnobSpace>, KnobLevels)> = None;
    for (entity, source, camera, priority) in &cameras {
        let Ok(state) = states.get(entity) else { continue };
        let Step::Allocated { space, allocation, .. } = &state.step else { continue };
        let Some(store) = store_of(source, &maps) else { continue };
        count += 1;
        idle = store.conditions().map_or(idle, |conditions| conditions.idle);
        alone += weight_of(camera, priority) * allocation.choice.cost.error;
        let settings = allocation.choice.settings;
        match &mut agreement {
            Some((shared, known, wanted)) if same_space(known, space) => {
                *wanted = shared.highest(*wanted, settings);
            }
            Some(_) => {}
            none => {
                *none = store
                    .shared_levels()
                    .map(|shared| (shared, Arc::clone(space), shared.highest(settings, settings)));
            }
        }
    }
    let agreement = agreement.filter(|_| count > 1);
    if count == 0 || (app_limit.is_none() && agreement.is_none()) {
        return;
    }
    // Every frontier includes the device's idle power; a meter's offset takes that into account.
    let is_metered = feedback.correction != PowerCorrection::default();
    let counted_again = if is_metered { 0.0 } else { count as f64 - 1.0 };
    let limit = app_limit.map_or(Watts(f64::INFINITY), |limit| {
        feedback.correction.uncorrected(limit) + idle * counted_again
    });
    let mut is_kept = true;
    let division = &mut *division;
    let mut divide = |agreed: Option<KnobLevels>| {
        division.clear();
        let mut missed = 0;
        for (entity, source, camera, priority) in &cameras {
            let Ok(state) = states.get(entity) else { continue };
            let Step::Allocated { view, space, allocation, budget, .. } = &state.step else {
                continue;
            };
            let Some(store) = store_of(source, &maps) else { continue };
            let Some(found) = frontier_in_play(store, view, feedback.has_left_map) else {
                continue;
            };
            let shared = agreement
                .as_ref()
                .zip(agreed)
                .filter(|((_, known, _), _)| same_space(known, space))
                .map(|((shared, ..), agreed)| (shared, agreed));
            let limits = (
                budget.power.map(|limit| correction.uncorrected(limit)),
                allocation.choice.cost.power,
            );
            missed += add_points(division, found, limits, shared, weight_of(camera, priority))?;
        }
        is_kept = division.divide(limit);
        let (error, power) = division.sums();
        Some(Rank { missed: missed + usize::from(!is_kept), error, power })
    };
    let agreed = match &agreement {
        Some((shared, _, wanted)) => {
            Some(agree(shared, *wanted, count, alone, |levels| divide(Some(levels))))
        }
        None => {
            divide(None);
            None
        }
    };
    let mut number = 0;
    for (entity, source, ..) in &cameras {
        let Ok(mut state) = states.get_mut(entity) else { continue };
        let state = state.bypass_change_detection();
        let Step::Allocated { view, space, allocation, budget, binding, agreed: own } =
            &mut state.step
        else {
            continue;
        };
        let Some(store) = store_of(source, &maps) else { continue };
        let Some(found) = frontier_in_play(store, view, feedback.has_left_map) else { continue };
        let chosen = division.chosen(number);
        number += 1;
        let point = chosen.and_then(|chosen| found.points().get(chosen));
        let shared = agreement.as_ref().filter(|(_, known, _)| same_space(known, space));
        *own = agreed.filter(|_| shared.is_some());
        let choice = &mut allocation.choice;
        let is_other = point.is_some_and(|point| point.settings != choice.settings);
        if app_limit.is_some() && (is_other || !is_kept) {
            *binding = Some(Limit::AppBudget);
        }
        if let Some(point) = point {
            (choice.settings, choice.cost) = (point.settings, point.cost);
        }
        if let Some(((shared, ..), agreed)) = shared.zip(*own) {
            choice.cost.power = choice.cost.power + shared.charge(choice.settings, agreed);
        }
        let part = correction.corrected(choice.cost.power);
        let limit = budget.power.unwrap_or(Watts(f64::INFINITY));
        let is_own_kept = part.0 <= limit.0 * (1.0 + 1e-9);
        choice.outcome = match choice.outcome {
            _ if !is_kept || !is_own_kept => Outcome::PowerCannotBeMet,
            Outcome::Met
                if budget.error.is_some_and(|limit| is_other && choice.cost.error > limit) =>
            {
                Outcome::LimitedByPower
            }
            outcome => outcome,
        };
        if app_limit.is_some() {
            budget.power = Some(if limit < part { limit } else { part });
        }
    }
}

/// How much a camera's error counts: its priority times its pixels.
fn weight_of(camera: Option<&Camera>, priority: Option<&CameraPriority>) -> f64 {
    let size = camera.and_then(Camera::physical_viewport_size);
    let pixels = size.map_or(1.0, |size| f64::from(size.x) * f64::from(size.y));
    let priority = priority.map_or(1.0, |priority| priority.0);
    if priority.is_nan() { pixels } else { priority * pixels }
}

/// Adds the points of a camera to `division`: those up to the power of its own choice, the second of
/// `limits`, that keep its own limit, the first, with what shared knobs cost it. The cheapest where
/// none keeps it; returns the number of cameras of which that is so. `None` where all settings ask
/// for more of a shared knob than is agreed on. Powers are the frontier's.
fn add_points(
    division: &mut PowerDivision,
    frontier: &Frontier,
    (own, most): (Option<Watts>, Watts),
    shared: Option<(&SharedLevels<'_>, KnobLevels)>,
    weight: f64,
) -> Option<usize> {
    let charged = |point: &FrontierPoint| {
        let (settings, CostPoint { power, error }) = (point.settings, point.cost);
        match shared {
            Some((shared, agreed)) => (!shared.exceeds(settings, agreed))
                .then(|| CostPoint::new((power + shared.charge(settings, agreed)).0, error)),
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
