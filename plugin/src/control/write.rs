//! Writes what was decided for a camera, and tells of changes.

use std::sync::Arc;

use bevy::ecs::prelude::*;
use frugal_core::control::Decisions;

use super::frame::{ControlledItem, same_space};
use super::{
    BudgetStateChanged, ControlStatus, MapRejected, OffReason, Selection, SettingsSwitched,
};
use crate::knobs::{KnobSettings, KnobSpace};

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
    } else if !Arc::ptr_eq(&knobs.space, space) {
        knobs.bypass_change_detection().space = Arc::clone(space);
    }
}
