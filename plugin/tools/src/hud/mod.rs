//! A panel over the image for every controlled camera, for development: the frontier at its view,
//! budget, predicted and metered power, error, settings, and the latest switches.
//!
//! Only reads decisions, meters and messages. Plain functions of `Facts` make a camera's text
//! (`text.rs`), those of a `Plot` its pixels (`plot.rs`), anew where the frontier, the points or
//! the limits change. A hidden HUD has no entities, and one system reads one key.

mod log;
mod panel;
mod plot;
mod text;
mod wipe;

use std::collections::HashSet;

use bevy::camera::CameraOutputMode;
use bevy::camera::visibility::{RenderLayers, VisibilitySystems};
use bevy::ecs::system::SystemParam;
use bevy::prelude::*;
use bevy::render::render_resource::BlendState;
use bevy_frugal_gi::camera_copy::share_atmosphere;

use panel::{HasPanel, Panel};
pub use wipe::HudWipe;
use wipe::{WipeCamera, WipeNode};

/// The HUD: panels that show what the controller does. Needs an app with Bevy's UI.
///
/// There is a panel for each camera with a [`Selection`](bevy_frugal_gi::control::Selection) or
/// [`KnobSettings`](bevy_frugal_gi::knobs::KnobSettings), at the upper left corner of its viewport. See [`HudSettings`]. [`HudWipe`] shows the best settings beside the
/// current ones.
#[derive(Clone, Copy, Debug, Default)]
pub struct HudPlugin;

impl Plugin for HudPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<HudSettings>()
            .init_resource::<HudWipe>()
            .init_resource::<log::SwitchLog>()
            .add_observer(log::record)
            .add_observer(wipe::remove_node)
            .register_type::<HudSettings>()
            .register_type::<HudWipe>()
            .register_type::<HudPart>()
            // The decisions shown are those of the frame before, whose settings this frame shows.
            .add_systems(
                Update,
                (
                    toggle.run_if(resource_exists::<ButtonInput<KeyCode>>),
                    remove_panels.run_if(resource_changed::<HudSettings>),
                    (spawn_panels, panel::write).chain().run_if(is_visible),
                    wipe::toggle.run_if(resource_exists::<ButtonInput<KeyCode>>),
                    wipe::spawn.run_if(wipe::is_wanted),
                    retarget.run_if(any_with_component::<HudPart>),
                )
                    .chain(),
            )
            // A view's frustum follows from its transform.
            .add_systems(
                PostUpdate,
                wipe::follow
                    .after(TransformSystems::Propagate)
                    .before(VisibilitySystems::UpdateFrusta)
                    .run_if(wipe::is_wanted),
            );
    }

    fn finish(&self, app: &mut App) {
        share_atmosphere(app);
    }
}

fn is_visible(settings: Res<HudSettings>) -> bool {
    settings.visible
}

/// Changes visibility where the key is pressed.
fn toggle(keys: Res<ButtonInput<KeyCode>>, mut settings: ResMut<HudSettings>) {
    if settings.key.is_some_and(|key| keys.just_pressed(key)) {
        settings.visible = !settings.visible;
    }
}

/// Panels, and the camera that draws them. Not the wipe, whose history would be lost.
type HudOwn = (With<HudPart>, Without<WipeCamera>, Without<WipeNode>);

/// Removes all of them. Where the HUD is visible, it is spawned again with the changed settings.
fn remove_panels(mut commands: Commands, parts: Query<Entity, HudOwn>) {
    for part in &parts {
        commands.entity(part).despawn();
    }
}

/// Gives every camera its panel, and removes the panels of cameras that are gone.
fn spawn_panels(
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
        panel::spawn(&mut commands, images.as_deref_mut(), camera, drawn_by);
    }
}

/// Order of the HUD's own camera: after those of an app.
const ORDER: isize = 10_000;

/// Settings of the HUD, which the app may change at any time.
#[derive(Resource, Clone, Debug, PartialEq, Reflect)]
#[reflect(Resource, Default, Clone, Debug, PartialEq)]
pub struct HudSettings {
    /// Whether the panels are there. Hidden, they cost nothing. Default: true.
    pub visible: bool,
    /// The key that shows and hides them; `None` for none. Default: F3.
    pub key: Option<KeyCode>,
    /// The UI camera that draws them; its image must not be scaled. `None`, or while it is not
    /// there: a camera of the HUD's own over the primary window, after all others, which then also
    /// draws UI roots without a camera. Default: `None`.
    pub camera: Option<Entity>,
}

impl Default for HudSettings {
    fn default() -> Self {
        Self { visible: true, key: Some(KeyCode::F3), camera: None }
    }
}

/// Marks what the HUD spawns: the roots of its panels, and its camera. Put `Without<HudPart>` on
/// queries that mean the app's own cameras and nodes.
#[derive(Component, Clone, Copy, Debug, Default, Reflect)]
#[reflect(Component, Default, Clone, Debug)]
pub struct HudPart;

/// The camera that draws the HUD.
#[derive(SystemParam)]
struct UiCamera<'w, 's> {
    settings: Res<'w, HudSettings>,
    own: Query<'w, 's, Entity, (With<HudPart>, With<Camera2d>)>,
    all: Query<'w, 's, (), With<Camera>>,
}

impl UiCamera<'_, '_> {
    /// The app's, if it is there, or the HUD's own, or a new one.
    fn get(&self, commands: &mut Commands) -> Entity {
        let named = self.settings.camera.filter(|camera| self.all.contains(*camera));
        let known = named.or_else(|| self.own.iter().next());
        known.unwrap_or_else(|| spawn_camera(commands))
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

/// Draws panels and wipes by the present camera: the HUD replaces its own where its settings
/// change, and an app may despawn it. Removes one of its own that draws nothing any more.
fn retarget(
    mut commands: Commands,
    ui_camera: UiCamera,
    mut nodes: Query<&mut UiTargetCamera, With<HudPart>>,
) {
    let mut drawn_by = None;
    for mut target in &mut nodes {
        let wanted = *drawn_by.get_or_insert_with(|| ui_camera.get(&mut commands));
        if target.0 != wanted {
            target.0 = wanted;
        }
    }
    let is_idle = |camera: Entity| drawn_by.map_or(!ui_camera.settings.visible, |by| by != camera);
    for camera in ui_camera.own.iter().filter(|camera| is_idle(*camera)) {
        commands.entity(camera).despawn();
    }
}

#[cfg(test)]
mod tests;
