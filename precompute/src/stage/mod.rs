//! The stage: a headless Bevy app that renders a scene for one camera, one finished frame at a
//! time.
//!
//! It has no window: the clock is stepped explicitly, pipelines compile before they are needed, and
//! a frame ends when the GPU is done.

mod app;
mod capture;
mod environment;
mod error;
mod evaluator;
mod frame_renderer;
mod metering;
mod options;
mod prefilter;
mod ready;
mod remote;
mod settings;
mod useful;
mod world;

use std::sync::Arc;

use bevy::app::App;
use bevy::asset::Handle;
use bevy::ecs::entity::Entity;
use bevy::image::Image;
use bevy::render::RenderApp;
use bevy::render::render_resource::PollType;
use bevy::render::renderer::RenderDevice;
use bevy::transform::components::Transform;
use bevy_frugal_gi::knobs::KnobRegistry;
use frugal_core::knobs::{KnobLevels, KnobSpace};
use frugal_core::power::MeterInfo;
use frugal_core::units::Watts;
use frugal_trace::metrics::Picture;
use glam::{Quat, Vec3};

use crate::meters::Meter;
use crate::scene::LoadedScene;
use crate::work_meter::WorkLedger;
pub use frugal_trace::metrics::Radiance;

pub use app::{adapter, software_adapter};
pub use error::StageError;
pub use evaluator::StageEvaluator;
pub(crate) use frame_renderer::{FrameRenderer, RenderedFrame};
pub use options::{Component, Output, StageOptions};
pub(crate) use remote::{RemoteError, RemoteStage, serve};
pub use useful::every_knob;
#[cfg(test)]
pub(crate) use useful::knobs;
pub(crate) use useful::useful_knobs;
pub use world::populate;

/// A scene on a headless renderer.
pub struct Stage {
    app: App,
    camera: Entity,
    target: Handle<Image>,
    options: StageOptions,
    space: Arc<KnobSpace>,
    /// The settings of the next frame, for the work meter.
    shown: Option<(Arc<KnobSpace>, KnobLevels)>,
    meter: Meter,
    /// Counts frames for the work meter, if that is the meter.
    ledger: Option<WorkLedger>,
    /// `None` until it is needed: a meter of a device takes seconds to measure it.
    idle: Option<Watts>,
    exposure: f32,
    vertical_fov_degrees: f32,
}

impl Stage {
    /// Stages `scene`, and waits for the first finished frame.
    ///
    /// # Errors
    /// When there is no adapter, an option is out of range, the environment map cannot be read, or
    /// the renderer does not become ready.
    pub fn open(scene: &LoadedScene, options: StageOptions) -> Result<Self, StageError> {
        Self::open_with(scene, options, |_| ())
    }

    /// [`open`](Self::open), in an app to which `extend` adds plugins: for custom materials, and
    /// for passes that are compared with ours.
    ///
    /// # Errors
    /// As [`open`](Self::open).
    pub fn open_with(
        scene: &LoadedScene,
        options: StageOptions,
        extend: impl FnOnce(&mut App),
    ) -> Result<Self, StageError> {
        // Ambient occlusion needs five mip levels of the view, also at half the resolution. Bevy
        // aborts rendering if the view is too small for them.
        if options.size.min_element() == 0 || !(32..=8192).contains(&options.size.max_element()) {
            return Err(StageError::Size(options.size.x, options.size.y));
        }
        if !(options.frames_per_second.is_finite() && options.frames_per_second > 0.0) {
            return Err(StageError::FrameRate(options.frames_per_second));
        }
        let adapter = adapter().ok_or(StageError::NoAdapter)?;
        let (meter, ledger) = metering::open(scene, &options, &adapter)?;
        let mut app = app::build(options.frames_per_second, extend);
        let (camera, target) = world::spawn(&mut app, scene, &options)?;

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
            shown: None,
            idle: None,
            meter,
            ledger,
            exposure: 1.0 / (1.2 * scene.exposure_ev100.exp2()),
            vertical_fov_degrees: scene.camera.vertical_fov,
            options,
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

    /// The meter's name and provenance.
    pub fn meter(&self) -> MeterInfo {
        self.meter.info()
    }

    /// Vertical field of view, degrees.
    pub fn vertical_fov_degrees(&self) -> f32 {
        self.vertical_fov_degrees
    }

    /// The world, for tests that change the scene.
    pub fn world_mut(&mut self) -> &mut bevy::ecs::world::World {
        self.app.world_mut()
    }

    /// The render world, for tests that read GPU resources.
    pub fn render_world(&self) -> &bevy::ecs::world::World {
        self.app.sub_app(RenderApp).world()
    }

    /// Moves the camera.
    pub fn place(&mut self, position: Vec3, rotation: Quat) {
        if let Some(mut transform) = self.app.world_mut().get_mut::<Transform>(self.camera) {
            *transform = Transform { translation: position, rotation, ..Default::default() };
        }
    }

    /// Renders one frame and waits for the GPU.
    pub fn frame(&mut self) {
        self.app.update();
        let device = self.app.sub_app(RenderApp).world().resource::<RenderDevice>();
        // Fails only when the device is lost, which the next frame reports in more detail.
        let _ = device.poll(PollType::wait_indefinitely());
        if let (Some(ledger), Some((space, settings))) = (&self.ledger, &self.shown) {
            ledger.count(space, *settings);
        }
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
        capture::radiance(self.render_world(), &self.target, self.exposure)
    }
}
