//! Code that the windowed examples share: window size, screenshots for CI, a tour of a scene, maps, and
//! texts.
//!
//! With `FRUGAL_EXAMPLE_FRAMES=N` in the environment an example ends after N frames, counted from
//! the end of shader compilation and knob warm-up; with `FRUGAL_EXAMPLE_SCREENSHOT=image.png` it
//! saves a screenshot of its window before. The exit code is 0 on success. With
//! `FRUGAL_EXAMPLE_SIZE=320x180` the window has that size.

mod map;
mod room;
mod text;
mod tour;

use std::path::{Path, PathBuf};

use bevy::app::PluginGroupBuilder;
use bevy::asset::UnapprovedPathMode;
use bevy::prelude::*;
use bevy::render::view::screenshot::{Screenshot, ScreenshotCaptured, save_to_disk};
use bevy::window::PrimaryWindow;
use bevy_frugal_gi::gi::FrugalGi;
use bevy_frugal_gi::knobs::{KnobSpace, WarmKnobs};

pub use map::{
    BudgetRange, MapWhenWarm, change_power_budget, control, control_if_mapped, read_map,
};
pub use room::spawn_blocks;
pub use text::{add_ui_camera, caption};
pub use tour::{Tour, travel};

/// Path of a file in the workspace, whatever the working directory. `path` is relative to the
/// workspace root; the file need not exist.
pub fn workspace_file(path: &str) -> PathBuf {
    // Clones that share one build share its executables, which know the first clone's folder: what
    // the running Cargo says goes first.
    let package = std::env::var_os("CARGO_MANIFEST_DIR")
        .map_or_else(|| env!("CARGO_MANIFEST_DIR").into(), PathBuf::from);
    let workspace = package.join("..");
    // Keeps `..` out of messages, whether the file exists or not.
    workspace.canonicalize().unwrap_or(workspace).join(path)
}

/// The courtyard's map of `make demo`, relative to the workspace root; before that was run, the one of
/// another machine that the results are made with.
pub fn courtyard_map() -> &'static str {
    let own = "target/demo/courtyard.pareto.ron";
    if workspace_file(own).is_file() { own } else { "docs/data/records/courtyard.pareto.ron" }
}

/// Bevy's plugins, for a scene file whose geometry may be anywhere: its loader asks for that.
pub fn scene_plugins() -> PluginGroupBuilder {
    let unapproved_path_mode = UnapprovedPathMode::Deny;
    DefaultPlugins.set(AssetPlugin { unapproved_path_mode, ..default() })
}

/// Runs an example whose arguments are a scene and a second file, by default the courtyard and
/// `second`, relative to the workspace root. Exit code 2 and the message where it cannot be built.
pub fn run(second: &str, build: impl FnOnce(&Path, &Path) -> Result<App, String>) -> AppExit {
    let mut arguments = std::env::args_os().skip(1).map(PathBuf::from);
    let mut argument = |default: &str| arguments.next().unwrap_or_else(|| workspace_file(default));
    let scene = argument("assets/scenes/courtyard.scene.ron");
    match build(&scene, &argument(second)) {
        Ok(mut app) => app.run(),
        Err(message) => {
            eprintln!("{message}");
            AppExit::from_code(2)
        }
    }
}

/// Sets the title and size (640 × 360 by default) of the window, and runs the CI mode above. Add it
/// after `DefaultPlugins`.
pub struct ExamplePlugin {
    /// Title of the window.
    pub title: &'static str,
}

/// Remaining frames and screenshot of a CI run.
#[derive(Resource)]
struct CiRun {
    frames_left: u32,
    screenshot: Option<PathBuf>,
}

impl Plugin for ExamplePlugin {
    fn build(&self, app: &mut App) {
        let size = std::env::var("FRUGAL_EXAMPLE_SIZE").unwrap_or_default();
        let size = size.split_once('x').and_then(|(width, height)| {
            Some((width.parse::<u32>().ok()?, height.parse::<u32>().ok()?))
        });
        let world = app.world_mut();
        for mut window in world.query_filtered::<&mut Window, With<PrimaryWindow>>().iter_mut(world)
        {
            window.title = self.title.to_owned();
            window.resolution = size.unwrap_or((640, 360)).into();
        }
        let Ok(frames) = std::env::var("FRUGAL_EXAMPLE_FRAMES") else { return };
        let Ok(frames_left) = frames.parse() else {
            error!("FRUGAL_EXAMPLE_FRAMES={frames}: give a number of frames");
            app.world_mut().write_message(AppExit::error());
            return;
        };
        let screenshot = std::env::var_os("FRUGAL_EXAMPLE_SCREENSHOT").map(PathBuf::from);
        app.insert_resource(CiRun { frames_left, screenshot })
            .add_systems(PostStartup, wait_for_shaders)
            .add_systems(Last, advance_ci_run);
    }
}

/// Frames are empty until their shaders are compiled: warming an empty knob space waits for that.
fn wait_for_shaders(
    mut commands: Commands,
    cameras: Query<Entity, (With<FrugalGi>, Without<WarmKnobs>)>,
) {
    for camera in &cameras {
        commands.entity(camera).insert(WarmKnobs::new(KnobSpace::default()));
    }
}

/// Counts frames, then saves the screenshot, if requested, and ends the app.
fn advance_ci_run(
    mut commands: Commands,
    mut ci_run: ResMut<CiRun>,
    warming: Query<(), With<WarmKnobs>>,
    mut done: Local<bool>,
    mut exit: MessageWriter<AppExit>,
) {
    if *done || !warming.is_empty() {
        return;
    }
    ci_run.frames_left = ci_run.frames_left.saturating_sub(1);
    if ci_run.frames_left > 0 {
        return;
    }
    *done = true;
    let Some(path) = ci_run.screenshot.take() else {
        exit.write(AppExit::Success);
        return;
    };
    // An older file must not pass for this screenshot.
    let _ = std::fs::remove_file(&path);
    let mut save = save_to_disk(path.clone());
    commands.spawn(Screenshot::primary_window()).observe(
        move |captured: On<ScreenshotCaptured>, mut exit: MessageWriter<AppExit>| {
            save(captured);
            exit.write(if path.is_file() { AppExit::Success } else { AppExit::error() });
        },
    );
}

#[cfg(test)]
mod tests {
    use std::time::{Duration, Instant};

    use bevy::log::LogPlugin;
    use bevy::render::RenderPlugin;
    use bevy::render::settings::WgpuSettings;
    use bevy::window::ExitCondition;
    use bevy::winit::WinitPlugin;
    use frugal::scene::{Geometry, LoadedScene, SceneDescription};

    use super::*;

    #[test]
    fn a_model_outside_the_app_s_assets_is_loaded() {
        let mut description = SceneDescription::new(Geometry::Gltf("cornell.glb".to_owned()));
        description.source = workspace_file("assets/scenes/own.scene.ron");
        let scene = LoadedScene::new(description).expect("a scene");
        // Without a window and a GPU.
        let render_creation = WgpuSettings { backends: None, ..default() }.into();
        let exit_condition = ExitCondition::DontExit;
        let plugins = scene_plugins()
            .set(RenderPlugin { render_creation, ..default() })
            .set(WindowPlugin { primary_window: None, exit_condition, ..default() })
            .disable::<LogPlugin>()
            .disable::<WinitPlugin>();
        let mut app = App::new();
        app.add_plugins(plugins);
        app.finish();
        app.cleanup();
        let camera = app.world_mut().spawn_empty().id();
        frugal::stage::populate(app.world_mut(), &scene, camera).expect("no sky to read");
        let mut meshes = app.world_mut().query::<&Mesh3d>();
        let start = Instant::now();
        while meshes.iter(app.world()).next().is_none() {
            assert!(start.elapsed() < Duration::from_secs(60), "it is not loaded");
            app.update();
            std::thread::sleep(Duration::from_millis(1));
        }
    }
}
