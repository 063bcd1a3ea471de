//! Writes what was decided for a camera, and tells of changes.

use std::sync::Arc;

use bevy::ecs::prelude::*;
use bevy::ecs::system::SystemParam;
use frugal_core::control::Decisions;

use super::frame::{ControlledItem, same_space};
use super::{
    BudgetStateChanged, ControlStatus, MapRejected, OffReason, Selection, SettingsSwitched,
};
use crate::knobs::{KnobSettings, KnobSpace};

/// What is told of changes.
#[derive(SystemParam)]
pub(super) struct Told<'w> {
    switched: MessageWriter<'w, SettingsSwitched>,
    changed: MessageWriter<'w, BudgetStateChanged>,
    rejected: MessageWriter<'w, MapRejected>,
}

impl Told<'_> {
    /// Writes a camera's selection.
    pub(super) fn select(&mut self, camera: &mut ControlledItem<'_, '_>, new: Selection) {
        let (entity, from, to) = (camera.entity, camera.selection.status, new.status);
        if to != from {
            if let ControlStatus::Off(reason) = to
                && reason != OffReason::InvalidBudget
            {
                self.rejected.write(MapRejected { camera: entity, reason });
            }
            self.changed.write(BudgetStateChanged { camera: entity, from, to });
        }
        camera.selection.set_if_neq(new);
    }

    /// Writes a camera's settings; change detection fires only if their meaning differs.
    pub(super) fn apply(
        &mut self,
        camera: ControlledItem<'_, '_>,
        space: &Arc<KnobSpace>,
        decisions: &Decisions,
        commands: &mut Commands,
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
            self.switched.write(SettingsSwitched { camera: camera.entity, from, to, target });
            *knobs = new();
        } else if !Arc::ptr_eq(&knobs.space, space) {
            knobs.bypass_change_detection().space = Arc::clone(space);
        }
    }
}
