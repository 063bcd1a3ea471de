//! The controller's components and resources: where a camera's frontiers come from, and what was picked from them.

use std::collections::BTreeSet;
use std::sync::Arc;

use bevy::asset::{AsAssetId, AssetId, Handle};
use bevy::ecs::component::Component;
use bevy::ecs::reflect::{ReflectComponent, ReflectResource};
use bevy::ecs::resource::Resource;
use bevy::prelude::ReflectDefault;
use bevy::reflect::Reflect;

use super::{Budget, Outcome, SettingsFilter};
use crate::frontier::{CostPoint, FrontierMap, FrontierStore, SampleCamera};
use crate::knobs::{KnobSpace, RenderSettings};

/// Puts a camera under the controller, with the frontiers of a map. Brings a [`Budget`] without limits unless the camera has one.
#[derive(Component, Clone, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Component, Default, Clone, Debug, PartialEq)]
#[require(Budget, Selection, SettingsFilter)]
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

/// Puts a camera under the controller, with the frontiers of any [`FrontierStore`]. Goes before a [`FrontierMapHandle`] on the same camera.
#[derive(Component, Clone)]
#[require(Budget, Selection, SettingsFilter)]
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

/// What the controller picked for a camera, to be read. Written once per frame, marked as changed only when it is.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Default, Clone, Debug, PartialEq)]
pub struct Selection {
    /// Whether the controller is in charge, and whether it keeps the budget.
    pub status: ControlStatus,
    /// The settings that the budget buys. Means nothing before the first [`ControlStatus::Active`].
    pub target: RenderSettings,
    /// The settings on their way there, as applied in this frame. Means nothing before the first [`ControlStatus::Active`].
    pub applied: RenderSettings,
    /// Power and error of `target` at the sample camera; `None` while the controller is not in charge.
    pub predicted: Option<CostPoint>,
    /// The camera whose frontier was used; `None` while the controller is not in charge.
    pub sample: Option<SampleCamera>,
}

/// How the controller works, for all cameras.
#[derive(Resource, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Resource, Default, Clone, Debug, PartialEq)]
pub struct ControlSettings {
    /// How long settings take to change, in seconds of real time. Higher values are smoother and follow the budget later; 0 is at once, NaN the
    /// default.
    pub transition_seconds: f64,
}

impl ControlSettings {
    /// The default transition: 2 s, as Wang et al. 2016, equation 3.8.
    pub const TRANSITION_SECONDS: f64 = 2.0;
}

impl Default for ControlSettings {
    fn default() -> Self {
        Self { transition_seconds: Self::TRANSITION_SECONDS }
    }
}

/// Names of the knobs that this app can set. A map that sets others is not used. Without this resource every map is.
#[derive(Resource, Clone, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Resource, Default, Clone, Debug, PartialEq)]
pub struct KnownKnobs(pub BTreeSet<String>);

impl KnownKnobs {
    /// The first knob of `space` that this app does not have.
    pub fn first_unknown<'a>(&self, space: &'a KnobSpace) -> Option<&'a str> {
        space.knobs().iter().map(|knob| knob.name.as_str()).find(|name| !self.0.contains(*name))
    }
}
