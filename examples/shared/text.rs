//! Text over the image.

use bevy::camera::CameraOutputMode;
use bevy::prelude::*;
use bevy::render::render_resource::BlendState;

/// A camera for the app's user interface, which no other camera's resolution scale affects.
pub fn ui_camera() -> impl Bundle {
    let output_mode = CameraOutputMode::Write {
        blend_state: Some(BlendState::PREMULTIPLIED_ALPHA_BLENDING),
        clear_color: ClearColorConfig::None,
    };
    let clear_color = ClearColorConfig::Custom(Color::NONE);
    let camera = Camera { order: 10, clear_color, output_mode, ..default() };
    (Camera2d, camera, Msaa::Off, IsDefaultUiCamera)
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
