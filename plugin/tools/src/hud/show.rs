//! Shows and hides panels.

use std::collections::HashSet;

use bevy::prelude::*;

use super::panel::{Panel, spawn};
use super::wipe::{WipeCamera, WipeNode};
use super::{HasPanel, HudPart, HudSettings, UiCamera};

/// Changes visibility where the key is pressed.
pub(super) fn toggle(keys: Res<ButtonInput<KeyCode>>, mut settings: ResMut<HudSettings>) {
    if settings.key.is_some_and(|key| keys.just_pressed(key)) {
        settings.visible = !settings.visible;
    }
}

/// Panels, and the camera that draws them. Not the wipe, whose history would be lost.
type HudOwn = (With<HudPart>, Without<WipeCamera>, Without<WipeNode>);

/// Removes all of them. Where the HUD is visible, it is spawned again with the changed settings.
pub(super) fn remove_panels(mut commands: Commands, parts: Query<Entity, HudOwn>) {
    for part in &parts {
        commands.entity(part).despawn();
    }
}

/// Gives every camera its panel, and removes the panels of cameras that are gone.
pub(super) fn spawn_panels(
    mut commands: Commands,
    ui_camera: UiCamera,
    mut images: Option<ResMut<Assets<Image>>>,
    cameras: Query<(Entity, &Camera), HasPanel>,
    panels: Query<(Entity, &Panel)>,
) {
    let mut shown = HashSet::new();
    for (entity, panel) in &panels {
        let is_there = cameras.get(panel.camera).is_ok_and(|(_, camera)| camera.is_active);
        if is_there {
            shown.insert(panel.camera);
        } else {
            commands.entity(entity).despawn();
        }
    }
    let mut drawn_by = None;
    let is_new = |(entity, camera): &(Entity, &Camera)| camera.is_active && !shown.contains(entity);
    for (camera, _) in cameras.iter().filter(is_new) {
        let drawn_by = *drawn_by.get_or_insert_with(|| ui_camera.get(&mut commands));
        spawn(&mut commands, images.as_deref_mut(), camera, drawn_by);
    }
}
