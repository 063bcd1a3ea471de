//! Events of the controller, for observers of a camera or of all.

use bevy::ecs::entity::Entity;
use bevy::ecs::event::EntityEvent;

use super::{ControlStatus, OffReason};
use crate::knobs::KnobLevels;

/// The controller has written other settings to a camera. Not sent for a camera's first settings.
#[derive(EntityEvent, Clone, Copy, Debug, PartialEq)]
pub struct SettingsSwitched {
    /// The camera.
    #[event_target]
    pub camera: Entity,
    /// The settings before.
    pub from: KnobLevels,
    /// The settings from the next frame on, in the same knob space.
    pub to: KnobLevels,
    /// The settings at the end of the transition.
    pub target: KnobLevels,
}

/// The [status](ControlStatus) of a camera has changed: for example, its budget is no longer met,
/// or the controller is off.
#[derive(EntityEvent, Clone, Copy, Debug, PartialEq)]
pub struct BudgetStateChanged {
    /// The camera.
    #[event_target]
    pub camera: Entity,
    /// The status before.
    pub from: ControlStatus,
    /// The status now.
    pub to: ControlStatus,
}

/// A camera's map cannot be used: [`OffReason`] says why, and the log how to mend it. Sent once,
/// until the camera's status changes.
#[derive(EntityEvent, Clone, Copy, Debug, PartialEq)]
pub struct MapRejected {
    /// The camera.
    #[event_target]
    pub camera: Entity,
    /// Why.
    pub reason: OffReason,
}
