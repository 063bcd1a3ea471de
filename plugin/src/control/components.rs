//! The controller's components and resources: the source of a camera's frontiers, and the selected
//! settings.

use std::sync::Arc;

use bevy::prelude::*;
use frugal_core::control::{BoundedFrontier, RateTracker, RatedAt};

use super::{Budget, ErrorFeedback, KnobBounds, Limit, Outcome, SettingsFilter};
use crate::frontier::{CostPoint, FrontierMap, FrontierStore, MapFit, Misfit, SampleCamera};
use crate::knobs::{KnobLevels, KnobSpace};
use crate::units::Watts;

/// Puts a camera under the controller, with the frontiers of a map. Adds a [`Budget`] without
/// limits unless the camera has one.
#[derive(Component, Clone, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Component, Default, Clone, Debug, PartialEq)]
#[require(CameraState)]
pub struct PowerController(pub Handle<FrontierMap>);

/// Puts a camera under the controller, with the frontiers of any [`FrontierStore`]. Takes
/// precedence over a [`PowerController`] on the same camera.
#[derive(Component, Clone)]
#[require(CameraState)]
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
    /// A limit of the budget is NaN, negative or beyond its range.
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
    /// As `predicted`, for `applied`; interpolated during a transition.
    pub predicted_applied: Option<CostPoint>,
    /// The limit that keeps the selected settings from being better. `None` where nothing does:
    /// they are the best ones, or `status` is not [`ControlStatus::Active`].
    pub binding: Option<Limit>,
    /// The sample camera whose frontier was used; `None` unless `status` is
    /// [`ControlStatus::Active`].
    pub sample: Option<SampleCamera>,
}

/// The controller's state of one camera.
#[derive(Component, Debug, Default)]
#[require(Budget, ErrorFeedback, KnobBounds, MapFit, RateTracker, Selection, SettingsFilter)]
pub(super) struct CameraState {
    /// Predicted power of the applied settings in the map's watts; `None` while the controller is
    /// off.
    pub(super) predicted: Option<Watts>,
    /// Of the camera's map; `None` for other stores.
    pub(super) rated_at: Option<RatedAt>,
    pub(super) is_active: bool,
    pub(super) bounded: BoundedFrontier,
    /// How long each misfit has lasted, seconds; infinite once it was logged.
    pub(super) misfits: [f64; Misfit::ALL.len()],
}

/// One power limit for all active controlled cameras together, beside the limits of their own
/// [`Budget`]s.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Resource, Default, Clone, Debug, PartialEq)]
pub struct AppBudget {
    /// Limit on the mean power over 30 s, in watts; at least 0, `None` or infinity for no limit.
    /// NaN and negative limits are ignored, with a warning. Higher values: more quality, more
    /// power. Default: `None`.
    ///
    /// The power is divided so that one more watt would lower the error of every camera equally,
    /// weighted by [`CameraPriority`] and share of the pixels.
    pub power: Option<Watts>,
}

/// How much a camera's error counts when an [`AppBudget`] is divided, beside its share of the
/// pixels; 0 to 1e9, NaN counts as 1. Higher values give this camera more of the power; at 0 it
/// gets the cheapest settings unless power is left over. Default: 1.
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Component, Default, Clone, Debug, PartialEq)]
pub struct CameraPriority(pub f64);

impl Default for CameraPriority {
    fn default() -> Self {
        Self(1.0)
    }
}
