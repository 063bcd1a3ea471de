//! The controller's components and resources: where a camera's frontiers come from, and what was
//! picked from them.

use std::collections::BTreeSet;
use std::sync::Arc;

use bevy::asset::{AsAssetId, AssetId, Handle};
use bevy::ecs::component::Component;
use bevy::ecs::reflect::{ReflectComponent, ReflectResource};
use bevy::ecs::resource::Resource;
use bevy::prelude::ReflectDefault;
use bevy::reflect::Reflect;

use super::{Budget, ErrorPace, Outcome, SettingsFilter, TransitionTimes};
use crate::frontier::{CostPoint, FrontierMap, FrontierStore, SampleCamera};
use crate::knobs::{KnobSpace, RenderSettings};

/// Puts a camera under the controller, with the frontiers of a map. Brings a [`Budget`] without
/// limits unless the camera has one.
#[derive(Component, Clone, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Component, Default, Clone, Debug, PartialEq)]
#[require(Budget, ErrorPace, Selection, SettingsFilter)]
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

/// Puts a camera under the controller, with the frontiers of any [`FrontierStore`]. Goes before a
/// [`FrontierMapHandle`] on the same camera.
#[derive(Component, Clone)]
#[require(Budget, ErrorPace, Selection, SettingsFilter)]
pub struct FrontierSource {
    store: Arc<dyn FrontierStore>,
    space: Arc<KnobSpace>,
}

impl FrontierSource {
    /// Frontiers of `store`, whose knobs must stay the same.
    pub fn new(store: impl FrontierStore + 'static) -> Self {
        let space = Arc::new(store.knobs().clone());
        Self { store: Arc::new(store), space }
    }

    /// The store.
    pub fn store(&self) -> &dyn FrontierStore {
        &*self.store
    }

    /// The store's knobs.
    pub fn space(&self) -> &Arc<KnobSpace> {
        &self.space
    }
}

/// Why the controller leaves a camera's settings as they are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Reflect)]
pub enum OffReason {
    /// The map's file is missing, broken, or of another version.
    MapNotLoaded,
    /// The map was put together in the app and contradicts itself.
    MapInvalid,
    /// The map sets knobs that this app does not have.
    UnknownKnobs,
    /// A limit of the budget is NaN or negative.
    InvalidBudget,
    /// No sample camera of the map knows anything.
    NothingKnown,
}

/// What the controller does with a camera.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
pub enum ControlStatus {
    /// The map is still being loaded. Settings stay as they are.
    #[default]
    Waiting,
    /// In charge, and whether the budget is kept.
    Active(Outcome),
    /// Not in charge. Settings stay as they are; the reason was logged once.
    Off(OffReason),
}

/// What the controller picked for a camera, to be read. Written once per frame, marked as changed
/// only when it is.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Default, Clone, Debug, PartialEq)]
pub struct Selection {
    /// Whether the controller is in charge, and whether it keeps the budget.
    pub status: ControlStatus,
    /// The settings that the budget buys. Means nothing before the first [`ControlStatus::Active`].
    pub target: RenderSettings,
    /// The settings on their way there, as applied in this frame. Means nothing before the first
    /// [`ControlStatus::Active`].
    pub applied: RenderSettings,
    /// Power and error of `target` at the sample camera; `None` while the controller is not in
    /// charge.
    pub predicted: Option<CostPoint>,
    /// The camera whose frontier was used; `None` while the controller is not in charge.
    pub sample: Option<SampleCamera>,
}

/// How the controller works, for all cameras.
///
/// A power limit that broke is mended quickly, and what it has to spare is spent slowly:
/// [`times`](Self::times) says which way is which. Both fields are in seconds of real time, 0 to
/// infinity. 0 and negative values mean at once, infinity never; NaN means the default.
#[derive(Resource, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Resource, Default, Clone, Debug, PartialEq)]
pub struct ControlSettings {
    /// How long settings take to change where no power limit hurries them. Higher values change
    /// quality more gently and follow the view later, which costs power under an error limit.
    /// Default: 1 s.
    pub transition_seconds: f64,
    /// How long settings take to fall to cheaper ones under a power limit. Lower values end an
    /// excess over the limit sooner and change quality more visibly. Default: 0.5 s.
    pub fall_seconds: f64,
}

impl ControlSettings {
    /// The default of [`transition_seconds`](Self::transition_seconds). Wang et al. 2016, equation
    /// 3.8, take 2 s. On a tour of a court, with every frame's best settings as targets and a mean
    /// error of 0.018, targets reached at once took 9.1 W, within 1 s both ways 9.0 W, within 2 s
    /// down and 0.5 s up 10.4 W.
    pub const TRANSITION_SECONDS: f64 = 1.0;
    /// The default of [`fall_seconds`](Self::fall_seconds). Each level on the way still stays for
    /// several frames.
    pub const FALL_SECONDS: f64 = 0.5;

    /// How long settings take under `budget`. Never NaN. An infinite limit is none; of two limits,
    /// power decides, as it does where they conflict. An error limit alone is one of the mean:
    /// neither way is more urgent.
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
        Self { transition_seconds: Self::TRANSITION_SECONDS, fall_seconds: Self::FALL_SECONDS }
    }
}

/// Names of the knobs that this app can set. A map that sets others is not used. Without this
/// resource every map is.
#[derive(Resource, Clone, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Resource, Default, Clone, Debug, PartialEq)]
pub struct KnownKnobs(pub BTreeSet<String>);

impl KnownKnobs {
    /// The first knob of `space` that this app does not have.
    pub fn first_unknown<'a>(&self, space: &'a KnobSpace) -> Option<&'a str> {
        space.knobs().iter().map(|knob| knob.name.as_str()).find(|name| !self.0.contains(*name))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::Watts;

    #[test]
    fn what_mends_a_power_limit_is_quick() {
        let settings = ControlSettings { transition_seconds: 3.0, fall_seconds: 0.25 };
        let power = TransitionTimes { rise_seconds: 3.0, fall_seconds: 0.25 };
        let error = TransitionTimes::both(3.0);
        assert_eq!(settings.times(&Budget::power(Watts(5.0))), power);
        assert_eq!(settings.times(&Budget::power(Watts(0.0))), power);
        assert_eq!(settings.times(&Budget::both(Watts(5.0), 0.1)), power);
        assert_eq!(settings.times(&Budget::error(0.1)), error);
        assert_eq!(
            settings.times(&Budget::both(Watts(f64::INFINITY), 0.1)),
            error,
            "no limit on power"
        );
        assert_eq!(settings.times(&Budget::default()), TransitionTimes::both(3.0));
        assert_eq!(
            settings.times(&Budget::both(Watts(f64::INFINITY), f64::INFINITY)),
            TransitionTimes::both(3.0)
        );
        assert_eq!(
            ControlSettings::default().times(&Budget::default()),
            TransitionTimes::default()
        );
    }

    #[test]
    fn nan_is_the_default_of_its_own_field() {
        let nan = ControlSettings { transition_seconds: f64::NAN, fall_seconds: f64::NAN };
        for budget in [Budget::default(), Budget::power(Watts(5.0)), Budget::error(0.1)] {
            assert_eq!(nan.times(&budget), ControlSettings::default().times(&budget));
        }
        let at_once = ControlSettings { transition_seconds: -1.0, fall_seconds: f64::NAN };
        let expected =
            TransitionTimes { rise_seconds: -1.0, fall_seconds: ControlSettings::FALL_SECONDS };
        assert_eq!(at_once.times(&Budget::power(Watts(5.0))), expected);
    }
}
