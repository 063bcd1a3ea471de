//! The plugin's controller as a policy, without an app.

use bevy_frugal_gi::control::{Budget, CameraController, ControlSettings, Inputs, PowerCorrection};
use bevy_frugal_gi::frontier::{CameraView, FrontierStore};
use bevy_frugal_gi::knobs::KnobLevels;

use super::{Choice, Policy, Pose, ResolvedBudget};

/// Selects settings from frontiers under a budget and applies the temporal filter.
pub(crate) struct Controller<'a> {
    store: &'a dyn FrontierStore,
    budget: Budget,
    lens: (f32, f32),
    controller: CameraController,
    settings: ControlSettings,
    last: KnobLevels,
}

impl<'a> Controller<'a> {
    /// `lens`: vertical field of view in radians, and width ÷ height. `settings`: time constants of
    /// the filter.
    pub(crate) fn new(
        store: &'a dyn FrontierStore,
        budget: &ResolvedBudget,
        lens: (f32, f32),
        settings: ControlSettings,
    ) -> Self {
        Self {
            store,
            budget: Budget::new(budget.power_w, budget.error),
            lens,
            controller: CameraController::default(),
            settings,
            last: store.knobs().highest(),
        }
    }
}

impl Policy for Controller<'_> {
    fn decide(&mut self, _: usize, dt: f64, pose: &Pose) -> Choice {
        let inputs = Inputs {
            store: self.store,
            view: CameraView {
                position: pose.position,
                rotation: pose.rotation,
                vertical_fov: self.lens.0,
                aspect: self.lens.1,
            },
            budget: self.budget,
            delta_seconds: dt,
            // Before its first step the filter goes straight to the target, whatever this is.
            current: Some(self.last),
            // The meter is the map's own.
            correction: PowerCorrection::default(),
            settings: self.settings,
            agreed: None,
        };
        let Some(decisions) = self.controller.step(&inputs) else {
            return Choice::from(self.last);
        };
        self.last = decisions.applied;
        Choice {
            settings: decisions.applied,
            target: decisions.target,
            predicted: Some(decisions.predicted),
        }
    }
}
