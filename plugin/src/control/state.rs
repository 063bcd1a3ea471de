//! What the controller keeps of a camera from frame to frame, beside the components that an app sees.

use bevy::ecs::component::Component;
use frugal_core::control::{BoundedFrontier, RatedAt};

use super::power_feedback::Predicted;
use super::{Budget, ErrorFeedback, ErrorPace, KnobBounds, Selection, SettingsFilter};
use crate::frontier::{MapFit, Misfit};
use crate::units::Watts;

/// The controller's state of one camera.
#[derive(Component, Debug, Default)]
#[require(Budget, ErrorFeedback, ErrorPace, KnobBounds, MapFit, Selection, SettingsFilter)]
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

impl CameraState {
    /// What an active camera's map predicts.
    pub(super) fn predicted(&self, fit: &MapFit) -> Option<Predicted> {
        let Self { predicted: power, rated_at, is_active, .. } = *self;
        is_active.then_some(Predicted { power, meter: fit.meter, rated_at })
    }
}
