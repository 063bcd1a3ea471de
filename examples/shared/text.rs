//! Text over the image.

use bevy::camera::CameraOutputMode;
use bevy::prelude::*;
use bevy::render::render_resource::BlendState;
use bevy_frugal_gi_tools::HudSettings;

/// Adds a camera for the app's user interface and the HUD, which no other camera's resolution scale
/// affects.
pub fn add_ui_camera(app: &mut App) {
    let output_mode = CameraOutputMode::Write {
        blend_state: Some(BlendState::PREMULTIPLIED_ALPHA_BLENDING),
        clear_color: ClearColorConfig::None,
    };
    let clear_color = ClearColorConfig::Custom(Color::NONE);
    let camera = Camera { order: 10, clear_color, output_mode, ..default() };
    let camera = app.world_mut().spawn((Camera2d, camera, Msaa::Off, IsDefaultUiCamera)).id();
    app.insert_resource(HudSettings { camera: Some(camera), ..default() });
}

/// A text in the lower left corner, on a dark ground; write its `Text` to change it.
pub fn caption(text: impl Into<String>) -> impl Bundle {
    let node = Node {
        position_type: PositionType::Absolute,
        bottom: px(0),
        max_width: percent(100),
        padding: UiRect::axes(px(8), px(4)),
        ..default()
    };
    (
        Text::new(text),
        TextFont { font_size: FontSize::Px(11.0), ..default() },
        node,
        BackgroundColor(Color::srgba(0.0, 0.0, 0.0, 0.65)),
    )
}
