//! One camera's controller: view, frontiers and budget in, settings out. Independent of Bevy's
//! schedule: the app's systems and `frugal evaluate` call the same functions.

use super::{
    Budget, Choice, ControlSettings, ErrorFeedback, ErrorPace, Outcome, PowerCorrection,
    SettingsFilter, choose,
};
use crate::frontier::{CameraView, CostPoint, FrontierStore, SampleCamera};
use crate::knobs::KnobLevels;
use crate::units::Watts;

/// What a controller sees in one frame.
#[derive(Clone, Copy)]
pub struct Inputs<'a> {
    /// The frontiers.
    pub store: &'a dyn FrontierStore,
    /// The camera's view.
    pub view: CameraView,
    /// The limits, in the watts of the app's meter.
    pub budget: Budget,
    /// Duration of the frame, seconds of real time. Negative and NaN count as 0.
    pub delta_seconds: f64,
    /// The settings in effect, in the store's knob space: after others than those applied last the
    /// transition starts from there. `None`: there are none, and the target is applied at once.
    pub current: Option<KnobLevels>,
    /// From the store's watts to those of the app's meter.
    pub correction: PowerCorrection,
    /// From the store's errors to those measured.
    pub errors: ErrorFeedback,
    /// Transition times.
    pub settings: ControlSettings,
    /// Levels of the store's [shared knobs](FrontierStore::shared_levels) that all cameras of the
    /// app agree on. `None`: this camera's own.
    pub agreed: Option<KnobLevels>,
}

impl Inputs<'_> {
    /// Power that the camera pays for the shared knobs of others, in the store's watts.
    fn charge(&self, settings: KnobLevels) -> Watts {
        let shared = self.agreed.zip(self.store.shared_levels());
        shared.map_or(Watts(0.0), |(agreed, shared)| shared.charge(settings, agreed))
    }
}

/// The point of a frontier that a budget selects.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Allocation {
    /// The sample camera of the frontier.
    pub sample: SampleCamera,
    /// The point, in the store's watts; with several cameras, what it pays for the shared knobs of
    /// others included.
    pub choice: Choice,
}

/// What a controller decides in one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Decisions {
    /// The sample camera whose frontier was used.
    pub sample: SampleCamera,
    /// The selected settings.
    pub target: KnobLevels,
    /// The settings to apply, in transition to `target`.
    pub applied: KnobLevels,
    /// Whether the applied settings meet the budget.
    pub outcome: Outcome,
    /// Predicted cost of `target`, in the watts of the app's meter.
    pub predicted: CostPoint,
    /// Predicted cost of `applied`, in the watts of the app's meter.
    pub predicted_applied: CostPoint,
    /// Predicted power of `applied` in the store's watts, without correction.
    pub uncorrected: Watts,
}

/// The state of one camera's controller, for use without an app.
#[derive(Clone, Debug, Default)]
pub struct CameraController {
    /// Moves settings to their target.
    pub filter: SettingsFilter,
    /// Keeps the mean error.
    pub pace: ErrorPace,
}

impl CameraController {
    /// Decides the settings of the next frame. `None` where no frontier is known at the view, or
    /// the budget is [invalid](Budget::validate).
    pub fn step(&mut self, inputs: &Inputs<'_>) -> Option<Decisions> {
        let allocation = allocate(inputs, &mut self.pace)?;
        Some(switch(inputs, &allocation, &mut self.filter, &mut self.pace))
    }
}

/// Selects the point of the frontier at the view. `None` where no frontier is known there, or the
/// budget is [invalid](Budget::validate).
///
/// `pace` is left to [`switch`], unless the error limit has changed.
pub fn allocate(inputs: &Inputs<'_>, pace: &mut ErrorPace) -> Option<Allocation> {
    // Before the correction, which would turn an invalid limit into a valid one.
    inputs.budget.validate().ok()?;
    let power = inputs.budget.power.map(|limit| inputs.correction.uncorrected(limit));
    let budget = Budget { power, ..inputs.budget };
    let (sample, choice) = choose(inputs.store, &inputs.view, &budget, &inputs.errors, pace)?;
    Some(Allocation { sample, choice })
}

/// Moves the applied settings towards those of `allocation`, and counts their predicted error in
/// `pace`.
pub fn switch(
    inputs: &Inputs<'_>,
    allocation: &Allocation,
    filter: &mut SettingsFilter,
    pace: &mut ErrorPace,
) -> Decisions {
    let (space, choice) = (inputs.store.knobs(), &allocation.choice);
    filter.observe_view(&inputs.view, inputs.delta_seconds);
    match inputs.current {
        // Others have written them since: continue from there. Not at the start, where no
        // transition from the app's own settings is needed.
        Some(current) if filter.is_smooth() && current != filter.applied() => {
            filter.resume_from(current);
        }
        Some(_) => {}
        None => filter.cut(),
    }
    let corrected =
        |cost: CostPoint| CostPoint { power: inputs.correction.corrected(cost.power), ..cost };
    let cost_of = |settings: KnobLevels| {
        let found = inputs.store.look_up(&inputs.view)?;
        let CostPoint { power, error } = found.frontier.estimate(space, settings)?;
        Some(CostPoint { power: power + inputs.charge(settings), error })
    };
    let (seconds, dwell) = (inputs.delta_seconds, inputs.settings.dwell_seconds);
    let mut held_cost = None;
    let target = filter.dwell.choose(choice.settings, &inputs.budget, seconds, dwell, |held| {
        held_cost = cost_of(held);
        held_cost.map(corrected)
    });
    let held_cost = held_cost.filter(|_| target != choice.settings);
    let target_cost = held_cost.unwrap_or(choice.cost);
    let times = inputs.settings.times(&inputs.budget);
    filter.limit_changes(inputs.settings.change_limit(&inputs.budget));
    if filter.dwell.has_new_limits {
        filter.forget_changes();
    }
    let applied = filter.step(space, target, seconds, times);
    let cost =
        if applied == target { target_cost } else { cost_of(applied).unwrap_or(target_cost) };
    pace.observe(inputs.store, &inputs.errors, choice, cost, inputs.delta_seconds);
    let (predicted, predicted_applied) = (corrected(target_cost), corrected(cost));
    Decisions {
        sample: allocation.sample,
        target,
        applied,
        outcome: outcome_of(&inputs.budget, choice.outcome, predicted, predicted_applied),
        predicted,
        predicted_applied,
        uncorrected: cost.power,
    }
}

/// The outcome of settings on their way to a target with the outcome `target`.
fn outcome_of(
    budget: &Budget,
    target: Outcome,
    selected: CostPoint,
    applied: CostPoint,
) -> Outcome {
    // The target keeps its limit by construction; the applied settings keep it if they cost no more.
    let exceeds_power =
        budget.power.is_some_and(|limit| applied.power > limit && applied.power > selected.power);
    // An error limit is one on the mean, which the target's error may exceed in a frame.
    let exceeds_error =
        budget.error.is_some_and(|limit| applied.error > limit && applied.error > selected.error);
    match target {
        Outcome::Met if exceeds_power || exceeds_error => Outcome::Settling,
        Outcome::LimitedByPower if exceeds_power => Outcome::Settling,
        target => target,
    }
}

#[cfg(test)]
#[path = "controller_tests.rs"]
mod tests;
