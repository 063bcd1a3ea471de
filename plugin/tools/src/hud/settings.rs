//! The HUD's settings, and the camera that draws it.

use bevy::camera::CameraOutputMode;
use bevy::camera::visibility::RenderLayers;
use bevy::ecs::system::SystemParam;
use bevy::prelude::*;
use bevy::render::render_resource::BlendState;

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
    /// The UI camera that draws them; its image must not be scaled. `None`: a camera of the HUD's
    /// own over the primary window, after all others; while it is there, it also draws UI roots
    /// without a camera. Default: `None`.
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
