//! What the windowed examples share: the size of their window, a way for CI to look at them, and a
//! tour of a scene.
//!
//! With `FRUGAL_EXAMPLE_FRAMES=N` in the environment an example ends after N frames, counted from
//! when its shaders are there and its knobs warm; with `FRUGAL_EXAMPLE_SCREENSHOT=picture.png` it
//! takes a picture of its window before. It exits with 0 when all of that went well.

mod tour;

use std::path::{Path, PathBuf};

use bevy::prelude::*;
use bevy::render::view::screenshot::{Screenshot, ScreenshotCaptured, save_to_disk};
use bevy::window::PrimaryWindow;
use bevy_frugal_gi::gi::FrugalGi;
use bevy_frugal_gi::knobs::{KnobSpace, WarmKnobs};

pub use tour::{Tour, travel};

/// A file of the workspace, wherever the example is started.
pub fn workspace_file(path: &str) -> PathBuf {
    let workspace = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    // So that messages show no `..`, whether the file exists or not.
    workspace.canonicalize().unwrap_or(workspace).join(path)
}

/// Add it after `DefaultPlugins`.
pub struct ExamplePlugin {
    /// Title of the window.
    pub title: &'static str,
}

/// What CI asks for.
#[derive(Resource)]
struct Rehearsal {
    frames_left: u32,
    screenshot: Option<PathBuf>,
}

impl Plugin for ExamplePlugin {
    fn build(&self, app: &mut App) {
        let world = app.world_mut();
        for mut window in world.query_filtered::<&mut Window, With<PrimaryWindow>>().iter_mut(world)
        {
            window.title = self.title.to_owned();
            window.resolution = (640, 360).into();
        }
        let Ok(frames) = std::env::var("FRUGAL_EXAMPLE_FRAMES") else { return };
        let Ok(frames_left) = frames.parse() else {
            error!("FRUGAL_EXAMPLE_FRAMES={frames}: give a number of frames");
            app.world_mut().write_message(AppExit::error());
            return;
        };
        let screenshot = std::env::var_os("FRUGAL_EXAMPLE_SCREENSHOT").map(PathBuf::from);
        app.insert_resource(Rehearsal { frames_left, screenshot })
            .add_systems(PostStartup, wait_for_shaders)
            .add_systems(Last, rehearse);
    }
}

/// Frames without their shaders are empty: warming no knob at all waits for them.
fn wait_for_shaders(
    mut commands: Commands,
    cameras: Query<Entity, (With<FrugalGi>, Without<WarmKnobs>)>,
) {
    for camera in &cameras {
        commands.entity(camera).insert(WarmKnobs::new(KnobSpace::default()));
    }
}

/// Counts frames, then takes the picture, if one is wanted, and ends the app.
fn rehearse(
    mut commands: Commands,
    mut rehearsal: ResMut<Rehearsal>,
    warming: Query<(), With<WarmKnobs>>,
    mut done: Local<bool>,
    mut exit: MessageWriter<AppExit>,
) {
    if *done || !warming.is_empty() {
        return;
    }
    rehearsal.frames_left = rehearsal.frames_left.saturating_sub(1);
    if rehearsal.frames_left > 0 {
        return;
    }
    *done = true;
    let Some(path) = rehearsal.screenshot.take() else {
        exit.write(AppExit::Success);
        return;
    };
    // An older picture must not pass for this one.
    let _ = std::fs::remove_file(&path);
    let mut save = save_to_disk(path.clone());
    commands.spawn(Screenshot::primary_window()).observe(
        move |captured: On<ScreenshotCaptured>, mut exit: MessageWriter<AppExit>| {
            save(captured);
            exit.write(if path.is_file() { AppExit::Success } else { AppExit::error() });
        },
    );
}
