//! One camera's controller: view, frontiers and budget in, settings out. Independent of Bevy's
//! schedule: the app's system and `frugal evaluate` call the same functions.

use super::choose::choose;
use super::limits::{Limits, resolve};
use super::observed::Observed;
use super::rate::{Curve, MIN_HORIZON, RateTracker};
use super::{
    Budget, Choice, ControlSettings, ErrorFeedback, Outcome, PowerCorrection, SettingsFilter,
};
use crate::frontier::{CameraView, CostPoint, Frontier, FrontierStore, SampleCamera, SampleRef};
use crate::knobs::KnobLevels;
use crate::units::Watts;

/// What a controller sees in one frame.
#[derive(Clone, Copy)]
pub struct Inputs<'a> {
    /// The frontiers.
    pub store: &'a dyn FrontierStore,
    /// The camera's view.
    pub view: CameraView,
    /// The limits of power, peak and error, in the watts of the app's meter; others are ignored.
    pub budget: Budget,
    /// Duration of the frame, seconds of real time. Negative and NaN count as 0.
    pub delta_seconds: f64,
    /// The settings in effect, in the store's knob space. If they are not those applied last, the
    /// transition starts from them. `None`: there are none, and the target applies at once.
    pub current: Option<KnobLevels>,
    /// From the store's watts to those of the app's meter.
    pub correction: PowerCorrection,
    /// The same for a mean over the horizon.
    pub mean_correction: PowerCorrection,
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
    /// Steers the exchange rate.
    pub rates: RateTracker,
}

impl CameraController {
    /// Decides the settings of the next frame. `None` where no frontier is known at the view, or
    /// the budget is [invalid](Budget::validate).
    pub fn step(&mut self, inputs: &Inputs<'_>) -> Option<Decisions> {
        // Before the correction, which would turn an invalid limit into a valid one.
        let limits = resolve(&inputs.budget, &Observed::default()).ok()?;
        let found = inputs.store.look_up(&inputs.view)?;
        self.filter.observe_view(&inputs.view, inputs.delta_seconds);
        let choice = inputs.choose(&limits, found.frontier, &mut self.rates, &mut self.filter)?;
        let (filter, rates) = (&mut self.filter, &mut self.rates);
        Some(inputs.switch(&limits, found, &choice, |_| Watts(0.0), filter, rates))
    }
}

impl Inputs<'_> {
    /// Limits in the watts of the app's meter, in the store's terms.
    pub fn stored(&self, limits: &Limits) -> Limits {
        let target =
            |budget| self.errors.target(budget, self.store.error_target(budget)).unwrap_or(budget);
        let of_mean = limits.horizon >= MIN_HORIZON;
        let correction = if of_mean { self.mean_correction } else { self.correction };
        Limits {
            power: limits.uncorrected(correction).power,
            error: limits.error.map(target),
            ..limits.uncorrected(self.correction)
        }
    }

    /// The choice within `limits` in a view of `frontier`, at the exchange rate that the budget allows.
    /// Other limits begin anew. `None` where the frontier is empty.
    pub fn choose(
        &self,
        limits: &Limits,
        frontier: &Frontier,
        rates: &mut RateTracker,
        filter: &mut SettingsFilter,
    ) -> Option<Choice> {
        let stored = self.stored(limits);
        let watts = |power: Option<Watts>| power.map(|power| power.0);
        if rates.begin(watts(limits.power), limits.error, limits.horizon) {
            filter.end_dwell();
        }
        if let Some(overall) = self.store.overall() {
            rates.expect(overall);
        }
        let (view, hold) = (Curve::of(frontier, 1.0), self.settings.hold_seconds());
        let rate = rates.rate(&view, watts(stored.power), stored.error, hold, self.delta_seconds);
        choose(frontier, &stored, &rate, filter.has_moved() && !rates.is_instant())
    }

    /// Moves the applied settings towards those of `choice` at the frontier `found`, and counts what they
    /// cost in `rates`. `charge`: power that settings pay for the shared knobs of other cameras, in the
    /// store's watts; that of `choice` is included in its cost.
    pub fn switch(
        &self,
        limits: &Limits,
        found: SampleRef<'_>,
        choice: &Choice,
        charge: impl Fn(KnobLevels) -> Watts,
        filter: &mut SettingsFilter,
        rates: &mut RateTracker,
    ) -> Decisions {
        match self.current {
            // Others have written them since: continue from there. Not at the start, where no
            // transition from the app's own settings is needed.
            Some(current) if filter.is_smooth() && current != filter.applied() => {
                filter.resume_from(current);
            }
            Some(_) => {}
            None => filter.cut(),
        }
        let space = self.store.knobs();
        let corrected =
            |cost: CostPoint| CostPoint { power: self.correction.corrected(cost.power), ..cost };
        let cost_of = |settings: KnobLevels, known: Option<CostPoint>| {
            let CostPoint { power, error } = found.frontier.estimate(space, settings)?;
            // Points of this frontier may be better than settings that it lacks: between them these would
            // seem cheaper than they are.
            let known = known.filter(|_| found.frontier.exact(settings).is_none());
            let power = known.map_or_else(|| power + charge(settings), |known| known.power);
            Some(CostPoint { power, error })
        };
        let seconds = self.delta_seconds;
        let held_cost = |held, known| cost_of(held, Some(known));
        let (target, target_cost) = filter.dwell.choose(choice, seconds, &self.settings, held_cost);
        let applied = filter.step(space, target, seconds, self.settings.transition);
        let cost = if applied == target {
            target_cost
        } else {
            cost_of(applied, None).unwrap_or(target_cost)
        };
        rates.spend(cost, self.delta_seconds);
        let (predicted, predicted_applied) = (corrected(target_cost), corrected(cost));
        Decisions {
            sample: found.camera,
            target,
            applied,
            outcome: outcome_of(limits, choice.outcome, predicted, predicted_applied),
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
    let exceeds = |limit: Option<Watts>| {
        limit.is_some_and(|limit| applied.power > limit && applied.power > selected.power)
    };
    let exceeds_power = exceeds(limits.power) || exceeds(limits.peak);
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
