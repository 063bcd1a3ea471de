//! Writes what was decided for a camera, and the events that tell of changes, for observers of a camera
//! or of all.

use std::sync::Arc;

use bevy::ecs::prelude::*;
use frugal_core::control::Decisions;

use super::frame::{ControlledItem, same_space};
use super::{ControlStatus, OffReason, Selection};
use crate::knobs::{KnobLevels, KnobSettings, KnobSpace};

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

/// Writes a camera's selection.
pub(super) fn write_selection(
    commands: &mut Commands,
    camera: &mut ControlledItem<'_, '_>,
    new: Selection,
) {
    let (entity, from, to) = (camera.entity, camera.selection.status, new.status);
    if to != from {
        if let ControlStatus::Off(reason) = to
            && reason != OffReason::InvalidBudget
        {
            commands.trigger(MapRejected { camera: entity, reason });
        }
        commands.trigger(BudgetStateChanged { camera: entity, from, to });
    }
    camera.selection.set_if_neq(new);
}

/// Writes a camera's settings; change detection fires only if their meaning differs.
pub(super) fn write_settings(
    commands: &mut Commands,
    camera: ControlledItem<'_, '_>,
    space: &Arc<KnobSpace>,
    decisions: &Decisions,
) {
    let Decisions { target, applied: to, .. } = *decisions;
    let new = || KnobSettings { space: Arc::clone(space), settings: to };
    let Some(mut knobs) = camera.knobs else {
        commands.entity(camera.entity).try_insert(new());
        return;
    };
    if !same_space(&knobs.space, space) {
        *knobs = new();
    } else if knobs.settings != to {
        let from = knobs.settings;
        commands.trigger(SettingsSwitched { camera: camera.entity, from, to, target });
        *knobs = new();
    }
}
