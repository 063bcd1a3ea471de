//! Shows and hides panels.

use std::collections::HashSet;

use bevy::camera::CameraOutputMode;
use bevy::camera::visibility::RenderLayers;
use bevy::ecs::system::SystemParam;
use bevy::prelude::*;
use bevy::render::render_resource::BlendState;

use super::panel::{Panel, spawn};
use super::wipe::{WipeCamera, WipeNode};
use super::{HudPart, HudSettings};
use crate::control::Selection;
use crate::knobs::KnobSettings;

/// Order of the HUD's own camera: after those of an app.
const ORDER: isize = 10_000;

/// A camera that has a panel.
pub(super) type HasPanel =
    (With<Camera>, Or<(With<Selection>, With<KnobSettings>)>, Without<WipeCamera>);

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

/// The camera that draws the HUD.
#[derive(SystemParam)]
pub(super) struct UiCamera<'w, 's> {
    settings: Res<'w, HudSettings>,
    own: Query<'w, 's, Entity, (With<HudPart>, With<Camera2d>)>,
}

impl UiCamera<'_, '_> {
    /// The app's, or the HUD's own, or a new one.
    pub(super) fn get(&self, commands: &mut Commands) -> Entity {
        let known = self.settings.camera.or_else(|| self.own.iter().next());
        known.unwrap_or_else(|| spawn_camera(commands))
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

fn spawn_camera(commands: &mut Commands) -> Entity {
    let output_mode = CameraOutputMode::Write {
        blend_state: Some(BlendState::PREMULTIPLIED_ALPHA_BLENDING),
        clear_color: ClearColorConfig::None,
    };
    let camera = Camera {
        order: ORDER,
        clear_color: ClearColorConfig::Custom(Color::NONE),
        output_mode,
        ..default()
    };
    // On no layer, so that it shows none of the app's sprites.
    let layers = RenderLayers::none();
    commands.spawn((Name::new("HUD"), HudPart, Camera2d, camera, Msaa::Off, layers)).id()
}
