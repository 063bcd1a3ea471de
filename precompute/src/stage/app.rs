//! The app of a scene file.

use std::time::Duration;

use bevy::app::{App, Last, PluginGroup, Startup};
use bevy::ecs::system::{Res, ResMut};
use bevy::ecs::world::World;
use bevy::render::RenderPlugin;
use bevy::render::pipelined_rendering::PipelinedRenderingPlugin;
use bevy::ui::UiPlugin;
use bevy::ui_render::UiRenderPlugin;
use bevy_frugal_gi::FrugalGiPlugins;
use bevy_frugal_gi::pacing::FramePacingPlugin;
use bevy_frugal_gi::power::PowerPlugin;
use bevy_frugal_gi::stage::protocol::LEVEL_VARIABLE;
use bevy_frugal_gi::stage::{Stage, StageError, StageOptions, StagePlugin, StageReady};

use super::world;
use crate::scene::{self, LoadedScene, SpawnedGeometry};

/// Pause between frames while geometry loads.
const YIELD: Duration = Duration::from_millis(5);

/// Stages `scene`, and waits for the first finished frame.
///
/// # Errors
/// When there is no adapter, an option is out of range, the environment map cannot be read, or the
/// renderer does not become ready.
pub fn open(scene: &LoadedScene, options: StageOptions) -> Result<Stage, StageError> {
    open_with(scene, options, |_| ())
}

/// [`open`], in an app to which `extend` adds plugins: for custom materials, and for passes that are
/// compared with ours.
///
/// # Errors
/// As [`open`].
pub fn open_with(
    scene: &LoadedScene,
    options: StageOptions,
    extend: impl FnOnce(&mut App),
) -> Result<Stage, StageError> {
    options.check()?;
    // Bevy panics without one.
    bevy_frugal_gi::stage::adapter().ok_or_else(|| StageError::usage(StageError::NO_ADAPTER))?;
    let mut app = headless();
    extend(&mut app);
    app.finish();
    app.cleanup();
    let camera = world::spawn(app.world_mut(), scene)?;
    loop {
        app.update();
        if let Some(loaded) = &app.world().resource::<SpawnedGeometry>().loaded {
            loaded.clone().map_err(StageError::usage)?;
            return Stage::new(app, camera, options);
        }
        std::thread::sleep(YIELD);
    }
}

/// The program of the hidden command that renders a scene file for the tool.
pub(crate) fn serve() {
    let mut app = headless();
    app.add_plugins(StagePlugin).add_systems(Startup, spawn_level).add_systems(Last, say_ready);
    app.run();
}

/// Spawns the scene file that is the level.
fn spawn_level(world: &mut World) {
    // A path, which need not be text.
    let file = std::env::var_os(LEVEL_VARIABLE).unwrap_or_default();
    let spawned = scene::load(file).map_err(|error| error.to_string()).and_then(|scene| {
        world::spawn(world, &scene).map(|_| ()).map_err(|error| error.to_string())
    });
    world.insert_resource(spawned.map_or_else(StageReady::Failed, |()| StageReady::NotYet));
}

/// Once the scene file's geometry has loaded, or cannot be.
fn say_ready(spawned: Option<Res<SpawnedGeometry>>, mut ready: ResMut<StageReady>) {
    if *ready == StageReady::NotYet
        && let Some(loaded) = spawned.and_then(|spawned| spawned.loaded.clone())
    {
        *ready = loaded.map_or_else(StageReady::Failed, |_| StageReady::Ready);
    }
}

/// An app without window, log, signal handler and user interface, whose pipelines compile when they
/// are needed.
fn headless() -> App {
    let mut app = App::new();
    app.add_plugins(
        scene::headless()
            .set(RenderPlugin { synchronous_pipeline_compilation: true, ..Default::default() })
            .disable::<UiPlugin>()
            .disable::<UiRenderPlugin>()
            // Each update must return with its own frame.
            .disable::<PipelinedRenderingPlugin>(),
    )
    // The stage itself reads the meter around each frame, and sleeps in none.
    .add_plugins(FrugalGiPlugins.build().disable::<PowerPlugin>().disable::<FramePacingPlugin>());
    app
}
