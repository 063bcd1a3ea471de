//! The plugin's controller as a policy, without an app.

use frugal_core::control::{
    Budget, CameraController, ControlSettings, ErrorFeedback, Inputs, MEASUREMENT_PERIOD,
    PowerModel, measurement_interval,
};
use frugal_core::frontier::{CostPoint, FrontierStore};
use frugal_core::knobs::KnobLevels;
use frugal_core::units::Watts;

use super::{Choice, Policy, Pose, ResolvedBudget};
use crate::cameras::view_from;

/// Selects settings from frontiers under a budget and applies the temporal filter. Observed power is
/// read once a second, as the plugin reads a meter.
pub struct Controller<'a> {
    store: &'a dyn FrontierStore,
    budget: Budget,
    lens: (f32, f32),
    controller: CameraController,
    settings: ControlSettings,
    last: KnobLevels,
    /// What measurements say of predicted errors.
    errors: ErrorFeedback,
    /// Predicted error of the last frame.
    predicted: Option<f64>,
    /// Duration of the last frame, seconds.
    dt: f64,
    /// What the power meter says of predicted power.
    power: PowerModel,
    /// Joules and seconds since its last reading.
    energy: (f64, f64),
    /// Whether an error meter measures whole frames, without noise, as often as the plugin's.
    pub(super) has_error_meter: bool,
    /// Number of its measurements.
    pub(super) measurements: u32,
    /// Seconds since the last of them.
    since: f64,
}

/// Interval of readings of the power meter, less a rounding error.
const READING_SECONDS: f64 = 1.0 - 1e-9;

impl<'a> Controller<'a> {
    /// `lens`: vertical field of view in radians, and width ÷ height. `settings`: time constants of
    /// the filter.
    pub fn new(
        store: &'a dyn FrontierStore,
        budget: &ResolvedBudget,
        lens: (f32, f32),
        settings: ControlSettings,
    ) -> Self {
        Self {
            store,
            budget: budget.limits(),
            lens,
            controller: CameraController::default(),
            settings,
            last: store.knobs().highest(),
            errors: ErrorFeedback::default(),
            predicted: None,
            dt: 0.0,
            power: PowerModel::default(),
            energy: (0.0, 0.0),
            has_error_meter: false,
            measurements: 0,
            since: 0.0,
        }
    }
}

impl Policy for Controller<'_> {
    fn decide(&mut self, _: usize, dt: f64, pose: &Pose) -> Choice {
        self.dt = dt;
        let inputs = Inputs {
            store: self.store,
            view: view_from(pose, self.lens),
            budget: self.budget,
            delta_seconds: dt,
            // Before its first step the filter goes straight to the target, whatever this is.
            current: Some(self.last),
            correction: self.power.correction(),
            mean_correction: self.power.mean_correction(),
            settings: self.settings,
            errors: self.errors,
        };
        let Some(decisions) = self.controller.step(&inputs) else {
            return Choice::from(self.last);
        };
        self.last = decisions.applied;
        self.power.predict(decisions.uncorrected, dt);
        self.predicted = Some(decisions.predicted_applied.error);
        Choice {
            settings: decisions.applied,
            target: decisions.target,
            predicted: Some(decisions.predicted),
        }
    }

    fn observe(&mut self, cost: CostPoint) {
        let (joules, seconds) = &mut self.energy;
        (*joules, *seconds) = (*joules + cost.power.0 * self.dt, *seconds + self.dt);
        if *seconds >= READING_SECONDS {
            self.power.read(Watts(*joules / *seconds), *seconds);
            self.energy = (0.0, 0.0);
        }
        if !self.has_error_meter {
            return;
        }
        self.since += self.dt;
        let interval = measurement_interval(MEASUREMENT_PERIOD, self.measurements);
        if self.since >= interval.as_secs_f64()
            && let Some(predicted) = self.predicted
        {
            (self.since, self.measurements) = (0.0, self.measurements + 1);
            self.errors.observe(cost.error, predicted);
        }
    }
}
