//! The Bevy app of a stage, and the adapter that it will render on: Bevy panics without one.

use std::sync::OnceLock;
use std::time::Duration;

use bevy::DefaultPlugins;
use bevy::app::{App, PluginGroup, TerminalCtrlCHandlerPlugin};
use bevy::log::LogPlugin;
use bevy::render::RenderPlugin;
use bevy::render::pipelined_rendering::PipelinedRenderingPlugin;
use bevy::time::TimeUpdateStrategy;
use bevy::ui::UiPlugin;
use bevy::ui_render::UiRenderPlugin;
use bevy::window::{ExitCondition, WindowPlugin};
use bevy::winit::WinitPlugin;
use bevy_frugal_gi::FrugalGiPlugins;
use bevy_frugal_gi::gi::GiRefresh;
use bevy_frugal_gi::knobs::{KnobPlugin, KnobRegistry};
use bevy_frugal_gi::pacing::FramePacingPlugin;
use bevy_frugal_gi::power::{Adapter, AdapterKind, PowerPlugin};
use frugal_core::knobs::{KnobSpace, KnobSpaceError};

/// An app without window, log, signal handler and user interface, whose clock steps by one frame
/// per update. `extend` adds plugins before it is finished.
pub(super) fn build(frames_per_second: f64, extend: impl FnOnce(&mut App)) -> App {
    let mut app = App::new();
    app.add_plugins(
        DefaultPlugins
            .set(WindowPlugin {
                primary_window: None,
                exit_condition: ExitCondition::DontExit,
                ..Default::default()
            })
            .set(RenderPlugin { synchronous_pipeline_compilation: true, ..Default::default() })
            .disable::<WinitPlugin>()
            .disable::<LogPlugin>()
            .disable::<TerminalCtrlCHandlerPlugin>()
            .disable::<UiPlugin>()
            .disable::<UiRenderPlugin>()
            // Each update must return with its own frame.
            .disable::<PipelinedRenderingPlugin>(),
    )
    // The stage itself reads the meter around each frame, and sleeps in none.
    .add_plugins(FrugalGiPlugins.build().disable::<PowerPlugin>().disable::<FramePacingPlugin>())
    // A stage's camera is often still where an app's moves: frames must not be cheaper for it.
    .insert_resource(GiRefresh::AsIfCamerasMoved)
    .insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_secs_f64(
        1.0 / frames_per_second,
    )));
    extend(&mut app);
    app.finish();
    app.cleanup();
    app
}

/// The knobs of a stage without opening one: all, or without the opt-in ones.
pub(super) fn knobs(with_opt_in: bool) -> Result<KnobSpace, KnobSpaceError> {
    let mut app = App::new();
    app.add_plugins(KnobPlugin);
    app.world().resource::<KnobRegistry>().space_with(|_| with_opt_in)
}

/// The adapter, and the instance that found it. The instance is kept so that the driver stays
/// loaded between stages: on NVIDIA's, processes that opened one stage after another found no
/// adapter any more after three to thirty of them.
static FOUND: OnceLock<(wgpu::Instance, Adapter)> = OnceLock::new();

/// The adapter that the renderer will choose; `None` if there is none.
pub fn adapter() -> Option<Adapter> {
    if let Some((_, adapter)) = FOUND.get() {
        return Some(adapter.clone());
    }
    let (instance, adapter) = find()?;
    Some(FOUND.get_or_init(|| (instance, adapter)).1.clone())
}

fn find() -> Option<(wgpu::Instance, Adapter)> {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.backends =
        wgpu::Backends::from_env().unwrap_or(wgpu::Backends::PRIMARY | wgpu::Backends::SECONDARY);
    let instance = wgpu::Instance::new(descriptor);
    let options = wgpu::RequestAdapterOptions {
        power_preference: wgpu::PowerPreference::from_env()
            .unwrap_or(wgpu::PowerPreference::HighPerformance),
        ..Default::default()
    };
    let adapter = bevy::tasks::block_on(instance.request_adapter(&options)).ok()?;
    let adapter = Adapter::from(&adapter.get_info());
    Some((instance, adapter))
}

/// Whether the renderer runs on the CPU.
pub fn software_adapter() -> bool {
    adapter().is_some_and(|adapter| adapter.kind == AdapterKind::Software)
}
