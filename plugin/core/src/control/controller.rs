//! One camera's controller: view, frontiers and budget in, settings out. Independent of Bevy's
//! schedule: the app's system and `frugal evaluate` call the same functions.

use super::limits::Limits;
use super::pace::choose;
use super::{
    Budget, Choice, ControlSettings, ErrorFeedback, ErrorPace, Outcome, PowerCorrection,
    SettingsFilter,
};
use crate::frontier::{CameraView, CostPoint, Frontier, FrontierStore, SampleCamera};
use crate::knobs::{KnobLevels, KnobSpace};
use crate::units::Watts;

/// What a controller sees in one frame.
#[derive(Clone, Copy)]
pub struct Inputs<'a> {
    /// The frontiers.
    pub store: &'a dyn FrontierStore,
    /// The camera's view.
    pub view: CameraView,
    /// The limits, in the watts of the app's meter; those of power and error count.
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
        // Before the correction, which would turn an invalid limit into a valid one.
        let limits = inputs.budget.limits().ok()?;
        let found = inputs.store.look_up(&inputs.view)?;
        let stored = limits.uncorrected(inputs.correction);
        let (store, errors) = (inputs.store, &inputs.errors);
        let choice = choose(store, found.frontier, &stored, errors, &mut self.pace)?;
        let switch = Switch {
            store,
            frontier: found.frontier,
            space: store.knobs(),
            sample: found.camera,
            view: inputs.view,
            limits,
            delta_seconds: inputs.delta_seconds,
            current: inputs.current,
            correction: inputs.correction,
            errors,
            settings: &inputs.settings,
        };
        Some(switch.step(&choice, |_| Watts(0.0), &mut self.filter, &mut self.pace))
    }
}

/// A frame's step from the settings in effect towards a choice.
pub struct Switch<'a> {
    /// As in [`Inputs`].
    pub store: &'a dyn FrontierStore,
    /// The frontier of this frame.
    pub frontier: &'a Frontier,
    /// The store's knobs.
    pub space: &'a KnobSpace,
    /// The sample camera of the frontier.
    pub sample: SampleCamera,
    /// As in [`Inputs`].
    pub view: CameraView,
    /// In the watts of the app's meter.
    pub limits: Limits,
    /// As in [`Inputs`].
    pub delta_seconds: f64,
    /// As in [`Inputs`].
    pub current: Option<KnobLevels>,
    /// As in [`Inputs`].
    pub correction: PowerCorrection,
    /// As in [`Inputs`].
    pub errors: &'a ErrorFeedback,
    /// As in [`Inputs`].
    pub settings: &'a ControlSettings,
}

impl Switch<'_> {
    /// Moves the applied settings towards those of `choice`, and counts their predicted error in
    /// `pace`. `charge`: power that settings pay for the shared knobs of other cameras, in the
    /// store's watts; that of `choice` is included in its cost.
    pub fn step(
        &self,
        choice: &Choice,
        charge: impl Fn(KnobLevels) -> Watts,
        filter: &mut SettingsFilter,
        pace: &mut ErrorPace,
    ) -> Decisions {
        filter.observe_view(&self.view, self.delta_seconds);
        match self.current {
            // Others have written them since: continue from there. Not at the start, where no
            // transition from the app's own settings is needed.
            Some(current) if filter.is_smooth() && current != filter.applied() => {
                filter.resume_from(current);
            }
            Some(_) => {}
            None => filter.cut(),
        }
        let corrected =
            |cost: CostPoint| CostPoint { power: self.correction.corrected(cost.power), ..cost };
        let cost_of = |settings: KnobLevels| {
            let CostPoint { power, error } = self.frontier.estimate(self.space, settings)?;
            Some(CostPoint { power: power + charge(settings), error })
        };
        let (seconds, dwell) = (self.delta_seconds, self.settings.dwell.as_secs_f64());
        let mut held_cost = None;
        let target = filter.dwell.choose(choice.settings, &self.limits, seconds, dwell, |held| {
            held_cost = cost_of(held);
            held_cost.map(corrected)
        });
        let held_cost = held_cost.filter(|_| target != choice.settings);
        let target_cost = held_cost.unwrap_or(choice.cost);
        let times = self.settings.times(&Budget::new(self.limits.power, self.limits.error));
        filter.limit_changes(self.settings.change_limit(&self.limits));
        if filter.dwell.has_new_limits {
            filter.forget_changes();
        }
        let applied = filter.step(self.space, target, seconds, times);
        let cost =
            if applied == target { target_cost } else { cost_of(applied).unwrap_or(target_cost) };
        pace.observe(self.store, self.errors, choice, cost, self.delta_seconds);
        let (predicted, predicted_applied) = (corrected(target_cost), corrected(cost));
        Decisions {
            sample: self.sample,
            target,
            applied,
            outcome: outcome_of(&self.limits, choice.outcome, predicted, predicted_applied),
            predicted,
            predicted_applied,
            uncorrected: cost.power,
        }
    }
}

/// The outcome of settings on their way to a target with the outcome `target`.
fn outcome_of(
    limits: &Limits,
    target: Outcome,
    selected: CostPoint,
    applied: CostPoint,
) -> Outcome {
    // The target keeps its limit by construction; the applied settings keep it if they cost no more.
    let exceeds_power =
        limits.power.is_some_and(|limit| applied.power > limit && applied.power > selected.power);
    // An error limit is one on the mean, which the target's error may exceed in a frame.
    let exceeds_error =
        limits.error.is_some_and(|limit| applied.error > limit && applied.error > selected.error);
    match target {
        Outcome::Met if exceeds_power || exceeds_error => Outcome::Settling,
        Outcome::LimitedByPower if exceeds_power => Outcome::Settling,
        target => target,
    }
}

#[cfg(test)]
#[path = "controller_tests.rs"]
mod tests;
