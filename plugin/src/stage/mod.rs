//! The stage: an app as the renderer of the tool `frugal`, one finished frame at a time.
//!
//! | folder or file | job |
//! |---|---|
//! | `plugin` | [`StagePlugin`], which a game adds; does nothing unless `frugal` starts the game |
//! | `level` | whether the app's level is there |
//! | `camera` | the camera that is measured: which one, and how it is taken over |
//! | `options`, `settings` | size, rate and light of images; levels of knobs |
//! | `ready` | waits until nothing is compiled, loaded or built in the background |
//! | `capture` | images from the GPU |
//! | `metering`, `meters` | power of frames |
//! | `extract` | the world as a path tracer needs it |
//! | `evaluator` | power and error of settings over a clip |
//! | `protocol` | the messages between the tool and an app |
//!
//! There is no window: the clock is stepped, and a frame ends when the GPU is done. Leave the
//! feature `stage` out of apps that ship.

mod camera;
mod capture;
mod evaluator;
pub mod extract;
mod level;
mod metering;
mod meters;
mod options;
mod plugin;
pub mod protocol;
mod ready;
mod settings;

use std::sync::{Arc, OnceLock};
use std::time::Duration;

use bevy::app::App;
use bevy::asset::Handle;
use bevy::camera::{Exposure, Projection};
use bevy::ecs::entity::Entity;
use bevy::ecs::world::World;
use bevy::image::Image;
use bevy::math::{Quat, Vec3};
use bevy::render::RenderApp;
use bevy::render::render_resource::{PipelineCache, PollType};
use bevy::render::renderer::{RenderAdapterInfo, RenderDevice};
use bevy::time::TimeUpdateStrategy;
use bevy::transform::components::Transform;
use frugal_trace::metrics::{Picture, Radiance, Reference};
use frugal_trace::scene::CameraPose;

use self::level::Held;
use crate::gi::GiRefresh;
use crate::knobs::{KnobLevels, KnobRegistry, KnobSpace};
use crate::power::{Adapter, AdapterKind, MeterInfo};
use crate::units::Watts;
pub use evaluator::Measurement;
pub use level::{StageCamera, StageLevel, StageReady};
pub use meters::{Meter, SelfTest};
pub use options::{Component, NO_METER, Output, StageError, StageOptions};
pub use plugin::{StagePlugin, on_stage};
pub use settings::default_settings;

/// Frames before a run's first.
const FRAMES_BEFORE_RUN: u32 = 4;

/// An app whose camera renders an image, frame by frame.
pub struct Stage {
    app: App,
    camera: Entity,
    target: Handle<Image>,
    options: StageOptions,
    space: Arc<KnobSpace>,
    meter: Option<Meter>,
    /// Of the last clip that was measured.
    reference: Option<(Vec<CameraPose>, Reference)>,
    /// Whether a frame since it was last asked lacked a pipeline.
    is_incomplete: bool,
    /// Whether the app has asked to end.
    has_ended: bool,
}

impl Stage {
    /// Makes a stage of `app`, whose plugins are finished: its `camera` renders from now on into an
    /// image, at the best levels of all knobs. Waits for the first finished frame.
    ///
    /// # Errors
    /// When there is no adapter, an option is out of range, or the renderer does not become ready.
    pub fn new(mut app: App, camera: Entity, options: StageOptions) -> Result<Self, StageError> {
        options.check()?;
        let adapter =
            adapter_of(app.world()).ok_or_else(|| StageError::usage(StageError::NO_ADAPTER))?;
        let meter = metering::open(&options, &adapter)?;
        let target = camera::take(app.world_mut(), camera, &options);
        step_time(app.world_mut(), options.frames_per_second);
        // A stage's camera is often still where an app's moves: frames must not be cheaper for it.
        app.insert_resource(GiRefresh::AsIfCamerasMoved);
        let registry = app.world().resource::<KnobRegistry>().clone();
        let all = registry.space()?;
        let space = match &options.knobs {
            Some(names) => settings::named(&registry, names.iter().map(String::as_str))?,
            None => all.clone(),
        };
        let mut stage = Self {
            app,
            camera,
            target,
            space: Arc::new(space),
            meter,
            reference: None,
            options,
            is_incomplete: false,
            has_ended: false,
        };
        // Knobs that are not on offer stay at their best, and all figures refer to that.
        let best = all.highest();
        stage.insert_settings(Arc::new(all), best)?;
        stage.get_ready()?;
        Ok(stage)
    }

    /// The knobs on offer.
    pub fn space(&self) -> &Arc<KnobSpace> {
        &self.space
    }

    /// The options it was opened with.
    pub fn options(&self) -> &StageOptions {
        &self.options
    }

    /// The meter's name and provenance, if there is one.
    pub fn meter(&self) -> Option<MeterInfo> {
        self.meter.as_ref().map(|meter| meter.info.clone())
    }

    /// Vertical field of view, degrees; 0 of a camera without perspective.
    pub fn vertical_fov_degrees(&self) -> f32 {
        match self.app.world().get::<Projection>(self.camera) {
            Some(Projection::Perspective(lens)) => lens.fov.to_degrees(),
            _ => 0.0,
        }
    }

    /// The world, for tests that change the scene.
    pub fn world_mut(&mut self) -> &mut World {
        self.app.world_mut()
    }

    /// The render world, for tests that read GPU resources.
    pub fn render_world(&self) -> &World {
        self.app.sub_app(RenderApp).world()
    }

    /// Moves the camera.
    pub fn place(&mut self, position: Vec3, rotation: Quat) {
        let place = Transform { translation: position, rotation, ..Default::default() };
        let world = self.app.world_mut();
        if let Some(mut held) = world.get_resource_mut::<Held>() {
            held.place = place;
        }
        if let Some(mut transform) = world.get_mut::<Transform>(self.camera) {
            *transform = place;
        }
    }

    /// Renders one frame and waits for the GPU.
    pub fn frame(&mut self) {
        self.app.update();
        self.has_ended |= self.app.should_exit().is_some();
        let device = self.render_world().resource::<RenderDevice>();
        // Fails only when the device is lost, which the next frame reports in more detail.
        let _ = device.poll(PollType::wait_indefinitely());
        self.is_incomplete |= self.is_compiling();
    }

    /// Whether the last frame lacked a pipeline, which compiles in the background.
    fn is_compiling(&self) -> bool {
        self.render_world().resource::<PipelineCache>().waiting_pipelines().next().is_some()
    }

    /// Starts a run at a pose: a cut, and frames enough that the run's first costs no more than the
    /// others. That follows.
    ///
    /// # Errors
    /// When the renderer does not become ready.
    pub fn begin_run(&mut self, pose: &CameraPose, settings: KnobLevels) -> Result<(), StageError> {
        self.place(pose.position, pose.rotation);
        self.complete(settings, |stage| {
            (0..FRAMES_BEFORE_RUN).for_each(|_| stage.frame());
            Ok(())
        })
    }

    /// Renders and meters the next frame of a run, including the cost of a switch of settings, which
    /// an app pays too. Power is `None` without a meter.
    ///
    /// # Errors
    /// When the meter or the image cannot be read.
    pub fn render_frame(
        &mut self,
        pose: &CameraPose,
        settings: KnobLevels,
    ) -> Result<(Picture, Option<Watts>), StageError> {
        self.place(pose.position, pose.rotation);
        self.switch(settings);
        let power = self.metered(|_| None, 1)?;
        Ok((self.picture()?, power))
    }

    /// The last frame's display-referred image.
    ///
    /// # Errors
    /// When it cannot be read back.
    pub fn picture(&self) -> Result<Picture, StageError> {
        capture::picture(self.render_world(), &self.target)
    }

    /// The last frame's radiance, in nits.
    ///
    /// # Errors
    /// When it cannot be read back, or the stage's output is not radiance.
    pub fn radiance(&self) -> Result<Radiance, StageError> {
        let exposure = self.app.world().get::<Exposure>(self.camera).copied().unwrap_or_default();
        let exposure = 1.0 / (1.2 * exposure.ev100.exp2());
        capture::radiance(self.render_world(), &self.target, exposure)
    }
}

/// Steps the clock by one frame per update.
fn step_time(world: &mut World, frames_per_second: f64) {
    let frame = Duration::from_secs_f64(frames_per_second.recip());
    world.insert_resource(TimeUpdateStrategy::ManualDuration(frame));
}

/// The adapter, and the instance that found it. The instance is kept so that the driver stays
/// loaded between stages: on NVIDIA's, processes that opened one stage after another found no
/// adapter any more after three to thirty of them.
static FOUND: OnceLock<(wgpu::Instance, Adapter)> = OnceLock::new();

/// The adapter that renders an app, which may have chosen another than [`adapter`].
fn adapter_of(world: &World) -> Option<Adapter> {
    // In any case: what it finds keeps the driver loaded.
    let first = adapter();
    let info = world.get_resource::<RenderAdapterInfo>();
    info.map(|info| Adapter::from(&*info.0)).or(first)
}

/// The adapter that the renderer will choose; `None` if there is none: Bevy then panics.
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

#[cfg(test)]
mod tests {
    use bevy::render::renderer::WgpuWrapper;

    use super::*;

    #[test]
    fn the_meter_is_that_of_the_adapter_that_renders() {
        let mut world = World::new();
        world.insert_resource(RenderAdapterInfo(WgpuWrapper::new(wgpu::AdapterInfo {
            name: "the app's own".to_owned(),
            vendor: 1,
            device: 2,
            device_type: wgpu::DeviceType::IntegratedGpu,
            device_pci_bus_id: String::new(),
            driver: String::new(),
            driver_info: String::new(),
            backend: wgpu::Backend::Vulkan,
            subgroup_min_size: 4,
            subgroup_max_size: 128,
            transient_saves_memory: false,
        })));
        let adapter = adapter_of(&world).expect("an adapter");
        assert_eq!((adapter.name.as_str(), adapter.is_integrated), ("the app's own", true));
    }
}
