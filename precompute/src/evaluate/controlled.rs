//! The plugin's controller as a policy, without an app.

use bevy_frugal_gi::control::{Budget, ControlSettings, ErrorPace, SettingsFilter, choose};
use bevy_frugal_gi::frontier::{CameraView, FrontierStore};
use bevy_frugal_gi::knobs::KnobLevels;

use super::{Choice, Policy, Pose, ResolvedBudget};

/// Selects settings from frontiers under a budget and applies the temporal filter.
pub(crate) struct Controller<'a> {
    store: &'a dyn FrontierStore,
    budget: Budget,
    lens: (f32, f32),
    pace: ErrorPace,
    filter: SettingsFilter,
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
            pace: ErrorPace::default(),
            filter: SettingsFilter::default(),
            settings,
            last: store.knobs().highest(),
        }
    }
}

impl Policy for Controller<'_> {
    fn decide(&mut self, _: usize, dt: f64, pose: &Pose) -> Choice {
        let view = CameraView {
            position: pose.position,
            rotation: pose.rotation,
            vertical_fov: self.lens.0,
            aspect: self.lens.1,
        };
        let found = choose(self.store, &view, &self.budget, &mut self.pace, dt);
        let Some((_, found)) = found else { return Choice::from(self.last) };
        self.last = self.filter.step(
            self.store.knobs(),
            found.settings,
            dt,
            self.settings.times(&self.budget),
        );
        Choice { settings: self.last, target: found.settings, predicted: Some(found.cost) }
    }
}
