//! The controller's components and resources: the source of a camera's frontiers, and the selected
//! settings.

use std::sync::Arc;

use bevy::asset::{AsAssetId, AssetId, Handle};
use bevy::ecs::component::Component;
use bevy::ecs::reflect::{ReflectComponent, ReflectResource};
use bevy::ecs::resource::Resource;
use bevy::prelude::ReflectDefault;
use bevy::reflect::Reflect;

use super::limits::Limits;
use super::state::CameraState;
use super::{
    Budget, ErrorFeedback, ErrorPace, KnobBounds, Limit, Outcome, SettingsFilter, TransitionTimes,
};
use crate::frontier::{CostPoint, FrontierMap, FrontierStore, MapFit, SampleCamera};
use crate::knobs::{KnobLevels, KnobSpace};

/// Puts a camera under the controller, with the frontiers of a map. Adds a [`Budget`] without
/// limits unless the camera has one.
#[derive(Component, Clone, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Component, Default, Clone, Debug, PartialEq)]
#[require(
    Budget,
    CameraState,
    ErrorFeedback,
    ErrorPace,
    KnobBounds,
    MapFit,
    Selection,
    SettingsFilter
)]
pub struct FrontierMapHandle(pub Handle<FrontierMap>);

impl From<Handle<FrontierMap>> for FrontierMapHandle {
    fn from(handle: Handle<FrontierMap>) -> Self {
        Self(handle)
    }
}

impl AsAssetId for FrontierMapHandle {
    type Asset = FrontierMap;

    fn as_asset_id(&self) -> AssetId<FrontierMap> {
        self.0.id()
    }
}

/// Puts a camera under the controller, with the frontiers of any [`FrontierStore`]. Takes
/// precedence over a [`FrontierMapHandle`] on the same camera.
#[derive(Component, Clone)]
#[require(
    Budget,
    CameraState,
    ErrorFeedback,
    ErrorPace,
    KnobBounds,
    MapFit,
    Selection,
    SettingsFilter
)]
pub struct FrontierSource {
    store: Arc<dyn FrontierStore>,
    space: Arc<KnobSpace>,
}

impl FrontierSource {
    /// Uses the frontiers of `store`, whose knobs must not change.
    pub fn new(store: impl FrontierStore + 'static) -> Self {
        let space = Arc::new(store.knobs().clone());
        Self { store: Arc::new(store), space }
    }

    /// The store.
    pub fn store(&self) -> &dyn FrontierStore {
        &*self.store
    }

    /// The store's knobs, as they were when this source was made.
    pub fn space(&self) -> &Arc<KnobSpace> {
        &self.space
    }
}

/// Why the controller is off and leaves a camera's settings unchanged.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Reflect)]
#[non_exhaustive]
pub enum OffReason {
    /// The map's file is missing, invalid, or of another version.
    MapNotLoaded,
    /// The map was built in the app and fails [validation](FrontierMap::validate).
    MapInvalid,
    /// The map sets knobs that this app has not registered.
    UnknownKnobs,
    /// A limit of the budget is NaN or negative.
    InvalidBudget,
    /// No sample camera of the map has a frontier.
    NothingKnown,
}

/// State of the controller for one camera.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
#[non_exhaustive]
pub enum ControlStatus {
    /// The map is still loading. Settings stay unchanged.
    #[default]
    Waiting,
    /// The controller sets this camera's knobs; the outcome says whether the applied settings meet
    /// the budget.
    Active(Outcome),
    /// The controller is off. Settings stay unchanged; the reason was logged once.
    Off(OffReason),
}

/// The controller's selection for a camera, read-only for the app. Updated once per frame; change
/// detection fires only when a value differs.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Default, Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Selection {
    /// Whether the controller is active, and whether the budget is met.
    pub status: ControlStatus,
    /// The selected settings. Undefined before the first [`ControlStatus::Active`].
    pub target: KnobLevels,
    /// The settings applied in this frame, in transition to `target`. Undefined before the first
    /// [`ControlStatus::Active`].
    pub applied: KnobLevels,
    /// Power (watts) and error (1 − SSIM) of `target` at the sample camera; `None` unless `status`
    /// is [`ControlStatus::Active`]. Watts are corrected by the app's meter where
    /// [`PowerFeedback`](super::PowerFeedback) runs.
    pub predicted: Option<CostPoint>,
    /// As `predicted`, of `applied`. In a transition to settings that are dearer or cheaper it is
    /// interpolated.
    pub predicted_applied: Option<CostPoint>,
    /// The limit that keeps the selected settings from being better. `None` where nothing does:
    /// they are the best ones, or `status` is not [`ControlStatus::Active`].
    pub binding: Option<Limit>,
    /// The sample camera whose frontier was used; `None` unless `status` is
    /// [`ControlStatus::Active`].
    pub sample: Option<SampleCamera>,
}

/// Transition times of the controller, for all cameras.
///
/// Settings fall quickly when the power limit is exceeded and rise slowly when power is left over;
/// All fields are in seconds of real time, 0 to infinity. 0 and
/// negative values switch at once, infinity never switches, NaN means the default of a duration.
#[derive(Resource, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Resource, Default, Clone, Debug, PartialEq)]
pub struct ControlSettings {
    /// Duration of every transition except a fall under a power limit. Higher values change quality
    /// more gradually and follow the view later, which costs power under an error limit; lower
    /// values follow sooner and change quality more visibly. Default: 1 s.
    pub transition_seconds: f64,
    /// Duration of a fall to cheaper settings under a power limit. Lower values end an excess over
    /// the limit sooner and change quality more visibly; higher values change it more gradually and
    /// exceed the limit for longer. Default: 0.5 s.
    pub fall_seconds: f64,
    /// Under a power limit, the least time from one change of the target to the next, as long as the
    /// earlier one keeps the limits. Higher values change quality less often and use less of the
    /// budget; lower values follow every border between two addresses of the map. A broken limit,
    /// another budget and a cut do not wait. NaN does not wait, either. Default: 0.5 s.
    pub dwell_seconds: f64,
    /// Under a power limit, how often a knob's level changes on average, in changes per second;
    /// those of one transition are always allowed. Lower values change quality less often and use
    /// less of the budget; infinity and NaN are no limit. Default: 0.85.
    pub changes_per_second: f64,
}

impl ControlSettings {
    /// Default of [`transition_seconds`](Self::transition_seconds), in seconds. Wang et al. 2016,
    /// equation 3.8, use 2 s. Measured on a camera path through a courtyard, with each frame's best
    /// settings as targets and a mean error of 0.018: immediate switches took 9.1 W, 1 s in both
    /// directions 9.0 W, 2 s down and 0.5 s up 10.4 W.
    pub const TRANSITION_SECONDS: f64 = 1.0;
    /// Default of [`fall_seconds`](Self::fall_seconds), in seconds. Each intermediate level still
    /// lasts several frames.
    pub const FALL_SECONDS: f64 = 0.5;

    /// Default of [`dwell_seconds`](Self::dwell_seconds), in seconds.
    pub const DWELL_SECONDS: f64 = 0.5;
    /// Default of [`changes_per_second`](Self::changes_per_second).
    pub const CHANGES_PER_SECOND: f64 = 0.85;

    /// [`changes_per_second`](Self::changes_per_second) under `limits`; `None` without a power limit:
    /// what waits under an error limit is paid at the next view.
    pub(super) fn change_limit(&self, limits: &Limits) -> Option<f64> {
        limits.finite_power().map(|_| self.changes_per_second)
    }

    /// Transition times under `budget`, in seconds; never NaN. An infinite limit counts as none.
    /// With two limits the power limit decides, as it does where they conflict. An error limit
    /// alone applies to the mean, so neither direction is more urgent.
    pub fn times(&self, budget: &Budget) -> TransitionTimes {
        let or = |seconds: f64, default| if seconds.is_nan() { default } else { seconds };
        let slow = or(self.transition_seconds, Self::TRANSITION_SECONDS);
        let quick = or(self.fall_seconds, Self::FALL_SECONDS);
        if budget.power.is_some_and(|limit| limit.0 < f64::INFINITY) {
            TransitionTimes { rise_seconds: slow, fall_seconds: quick }
        } else {
            TransitionTimes::both(slow)
        }
    }
}

impl Default for ControlSettings {
    fn default() -> Self {
        Self {
            transition_seconds: Self::TRANSITION_SECONDS,
            fall_seconds: Self::FALL_SECONDS,
            dwell_seconds: Self::DWELL_SECONDS,
            changes_per_second: Self::CHANGES_PER_SECOND,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::Watts;

    fn times(settings: &ControlSettings, budget: Budget) -> TransitionTimes {
        settings.times(&budget)
    }

    #[test]
    fn falls_under_a_power_limit_are_fast() {
        let settings =
            ControlSettings { transition_seconds: 3.0, fall_seconds: 0.25, ..Default::default() };
        let power = TransitionTimes { rise_seconds: 3.0, fall_seconds: 0.25 };
        let error = TransitionTimes::both(3.0);
        assert_eq!(times(&settings, Budget::power(Watts(5.0))), power);
        assert_eq!(times(&settings, Budget::power(Watts(0.0))), power);
        assert_eq!(times(&settings, Budget::both(Watts(5.0), 0.1)), power);
        assert_eq!(times(&settings, Budget::error(0.1)), error);
        assert_eq!(
            times(&settings, Budget::both(Watts(f64::INFINITY), 0.1)),
            error,
            "no limit on power"
        );
        assert_eq!(times(&settings, Budget::default()), TransitionTimes::both(3.0));
        assert_eq!(
            times(&settings, Budget::both(Watts(f64::INFINITY), f64::INFINITY)),
            TransitionTimes::both(3.0)
        );
        assert_eq!(
            times(&ControlSettings::default(), Budget::default()),
            TransitionTimes::default()
        );
    }

    #[test]
    fn nan_is_the_default_of_its_own_field() {
        let nan = ControlSettings {
            transition_seconds: f64::NAN,
            fall_seconds: f64::NAN,
            ..Default::default()
        };
        for budget in [Budget::default(), Budget::power(Watts(5.0)), Budget::error(0.1)] {
            assert_eq!(times(&nan, budget), times(&ControlSettings::default(), budget));
        }
        let at_once = ControlSettings {
            transition_seconds: -1.0,
            fall_seconds: f64::NAN,
            ..Default::default()
        };
        let expected =
            TransitionTimes { rise_seconds: -1.0, fall_seconds: ControlSettings::FALL_SECONDS };
        assert_eq!(times(&at_once, Budget::power(Watts(5.0))), expected);
    }
}
