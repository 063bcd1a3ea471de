//! The stage in an app's own program.

use std::sync::Mutex;

use bevy::app::{App, AppExit, Plugin, PluginGroup, PluginGroupBuilder, PluginsState, PostUpdate};
use bevy::camera::visibility::VisibilitySystems;
use bevy::ecs::schedule::IntoScheduleConfigs;
use bevy::render::pipelined_rendering::{PipelinedRenderingPlugin, RenderExtractApp};
use bevy::tasks::tick_global_task_pools_on_main_thread;
use bevy::transform::TransformSystems;
use bevy::winit::WinitPlugin;

use super::level::{self, StageLevel};
use super::protocol::{LEVEL_VARIABLE, Requests, STAGE_VARIABLE, connect, serve};
use super::step_time;
use crate::power;
use crate::schedule::KnobSystems;

/// Frames per second while a level is being made.
const LOADING_RATE: f64 = 30.0;

/// Makes an app the renderer of the tool `frugal`, when that starts it; otherwise it only inserts a
/// [`StageLevel`] of `None`. Add it after `DefaultPlugins`, or by [`on_stage`].
///
/// On the stage there is no window on the screen, though there is the entity `Window`; the clock is
/// stepped while the level is made, and then `Time<Virtual>` is paused: what moves in the app stands
/// still while it is measured. The app has no budget and no meter of its own, and the tool sets the
/// knobs. Cameras other than the measured one that render to a window are off.
#[derive(Clone, Copy, Debug, Default)]
pub struct StagePlugin;

/// An app's plugins with [`StagePlugin`]: `on_stage(DefaultPlugins)`. On the stage it leaves out the
/// system's windows, so that the machine needs no display.
pub fn on_stage(plugins: impl PluginGroup) -> PluginGroupBuilder {
    let mut plugins = plugins.build();
    if std::env::var_os(STAGE_VARIABLE).is_some() {
        if plugins.contains::<WinitPlugin>() {
            plugins = plugins.disable::<WinitPlugin>();
        }
        if plugins.contains::<PipelinedRenderingPlugin>() {
            plugins = plugins.disable::<PipelinedRenderingPlugin>();
        }
    }
    plugins.add(StagePlugin)
}

impl Plugin for StagePlugin {
    fn build(&self, app: &mut App) {
        let Ok(address) = std::env::var(STAGE_VARIABLE) else {
            app.init_resource::<StageLevel>();
            return;
        };
        app.insert_resource(StageLevel(std::env::var(LEVEL_VARIABLE).ok()));
        step_time(app.world_mut(), LOADING_RATE);
        app.add_systems(
            PostUpdate,
            (
                level::keep.before(KnobSystems::Apply).before(TransformSystems::Propagate),
                level::keep_pace.after(KnobSystems::Apply),
                level::keep_place
                    .after(TransformSystems::Propagate)
                    .before(VisibilitySystems::UpdateFrusta),
            ),
        );
        // Taken once, by the runner.
        let requests = Mutex::new(Some(greet(&address)));
        app.set_runner(move |app| {
            let requests = requests.lock().ok().and_then(|mut requests| requests.take());
            requests.map_or(AppExit::error(), |requests| run(app, requests))
        });
    }

    fn finish(&self, app: &mut App) {
        if std::env::var_os(STAGE_VARIABLE).is_some() {
            // Before the renderer moves to a thread of its own: each update returns with its frame.
            app.remove_sub_app(RenderExtractApp);
            power::switch_off(app.world_mut());
        }
    }
}

/// Connects to the tool; without it, this process has no purpose.
fn greet(address: &str) -> Requests {
    connect(address).and_then(Requests::new).unwrap_or_else(|error| {
        eprintln!("{STAGE_VARIABLE}={address}: frugal does not answer there any more: {error}");
        std::process::exit(1);
    })
}

/// Builds the app, and serves the tool.
fn run(mut app: App, requests: Requests) -> AppExit {
    while app.plugins_state() == PluginsState::Adding {
        tick_global_task_pools_on_main_thread();
    }
    app.finish();
    app.cleanup();
    match serve(app, requests) {
        Ok(()) => AppExit::Success,
        Err(error) => {
            eprintln!("frugal does not answer any more: {error}");
            AppExit::error()
        }
    }
}
