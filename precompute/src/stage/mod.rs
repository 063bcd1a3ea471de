//! The stage: a headless Bevy app that renders a scene for one camera, one finished frame at a
//! time.
//!
//! It has no window: the clock is stepped explicitly, pipelines compile before they are needed, and
//! a frame ends when the GPU is done.

mod adapter;
mod app;
mod capture;
mod environment;
mod evaluator;
mod frame_renderer;
mod metering;
mod prefilter;
mod remote;
mod useful;
mod world;

use std::sync::Arc;
use std::time::Duration;

use bevy::app::App;
use bevy::asset::Handle;
use bevy::ecs::entity::Entity;
use bevy::image::Image;
use bevy::render::RenderApp;
use bevy::render::render_resource::{
    CachedPipelineState, PipelineCache, PipelineDescriptor, PollType,
};
use bevy::render::renderer::RenderDevice;
use bevy::shader::ShaderCacheError;
use bevy::transform::components::Transform;
use bevy_frugal_gi::gi::{CameraCut, GiCounts, GiOccluders};
use bevy_frugal_gi::knobs::{KnobLevels, KnobRegistry, KnobSettings, KnobSpace};
use bevy_frugal_gi::power::{Adapter, MeterInfo, PowerMeter};
use bevy_frugal_gi::units::Watts;
use glam::{Quat, UVec2, Vec3};

use crate::cost::{FrameLayout, WorkLedger, WorkMeter, is_work_meter};
use crate::metrics::Picture;
use crate::scene::{Bounds, RayScene, SceneDescription, SceneError};

pub use crate::metrics::Radiance;
pub use adapter::{adapter, software_adapter};
pub use evaluator::StageEvaluator;
pub(crate) use frame_renderer::StageFrameRenderer;
pub(crate) use remote::{RemoteError, RemoteStage, StageRequest, serve};
pub use useful::every_knob;
pub(crate) use useful::{knobs, useful_knobs};
pub use world::populate;

/// Format of the output.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Output {
    /// Display-referred: 8-bit sRGB, tone-mapped.
    #[default]
    Display,
    /// Linear radiance in nits, before exposure; without antialiasing and post-processing, which
    /// belong to a display.
    Radiance,
}

/// Component of the light in an image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Component {
    /// All light.
    #[default]
    Full,
    /// The renderer's light without global illumination; in a path-traced image, light that at most
    /// one surface scattered.
    Direct,
    /// Indirect light of punctual lights, with Lambertian surfaces; in a path-traced image, light
    /// that two or more surfaces scattered.
    Indirect,
    /// The light that global illumination adds: indirect light, and light of emissive surfaces and
    /// of the sky on other surfaces.
    Global,
}

/// Greatest number of frames to wait for temporal accumulation.
const MOST_ACCUMULATION_FRAMES: u32 = 70;

/// Options of a stage.
#[derive(Clone, Debug, PartialEq)]
pub struct StageOptions {
    /// Width and height, pixels.
    pub size: UVec2,
    /// Target frame rate, which turns energy per frame into power.
    pub frames_per_second: f64,
    /// Format of the output.
    pub output: Output,
    /// Component of the light.
    pub component: Component,
    /// Names of the knobs on offer; `None`: all that need not be named. The others stay at their
    /// best.
    pub knobs: Option<Vec<String>>,
    /// The meter's name; `None`: the one that suits the adapter.
    pub meter: Option<String>,
}

impl Default for StageOptions {
    fn default() -> Self {
        Self {
            size: UVec2::new(320, 180),
            frames_per_second: 30.0,
            output: Output::Display,
            component: Component::Full,
            knobs: None,
            meter: None,
        }
    }
}

/// Why a scene cannot be staged, or a frame cannot be rendered.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StageError {
    /// There is neither a GPU nor a software adapter.
    #[error(
        "no graphics adapter: install a Vulkan driver for the GPU, or a software one (on Debian: apt install mesa-vulkan-drivers), and try again"
    )]
    NoAdapter,
    /// A size of 0, too small for some of the passes, or larger than a texture can be.
    #[error(
        "size {0}x{1}: must be 32 pixels or more along one side at least, and no more than 8192 along either"
    )]
    Size(u32, u32),
    /// A frame rate that is not above 0 or not finite.
    #[error("frame rate {0}: must be a finite number above 0")]
    FrameRate(f64),
    /// The scene file, or a file that it names.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// An unknown knob.
    #[error(transparent)]
    Knob(#[from] bevy_frugal_gi::knobs::KnobSpaceError),
    /// The meter.
    #[error(transparent)]
    OpenMeter(#[from] bevy_frugal_gi::power::OpenMeterError),
    /// A reading.
    #[error(transparent)]
    Meter(#[from] bevy_frugal_gi::power::MeterError),
    /// The environment map.
    #[error(transparent)]
    Environment(#[from] crate::scene::sky::SkyError),
    /// A pipeline that does not compile or never becomes ready.
    #[error("the renderer did not become ready: {0}")]
    NotReady(String),
    /// The image could not be read back.
    #[error("the image could not be read back: {0}")]
    ReadBack(String),
    /// The comparison of images.
    #[error(transparent)]
    Compare(#[from] crate::metrics::CompareError),
}

impl StageError {
    /// Whether the cause is the input and not the rendering.
    pub fn is_usage(&self) -> bool {
        match self {
            Self::NoAdapter
            | Self::Size(..)
            | Self::FrameRate(_)
            | Self::Scene(_)
            | Self::Knob(_)
            | Self::OpenMeter(_)
            | Self::Environment(_) => true,
            Self::Meter(_) | Self::NotReady(_) | Self::ReadBack(_) | Self::Compare(_) => false,
        }
    }
}

fn label(descriptor: &PipelineDescriptor) -> &str {
    let label = match descriptor {
        PipelineDescriptor::RenderPipelineDescriptor(descriptor) => descriptor.label.as_deref(),
        PipelineDescriptor::ComputePipelineDescriptor(descriptor) => descriptor.label.as_deref(),
    };
    label.unwrap_or("a pipeline without a name")
}

fn open_meter(
    scene: &SceneDescription,
    options: &StageOptions,
    adapter: &Adapter,
) -> Result<(Box<dyn PowerMeter>, Option<WorkLedger>), StageError> {
    let Some(name) = &options.meter else {
        return Ok((bevy_frugal_gi::power::detect(adapter)?, None));
    };
    if let Some(file) = is_work_meter(name) {
        let (meter, ledger) =
            WorkMeter::open(file, FrameLayout::of(scene, options.size.to_array()))?;
        return Ok((Box::new(meter), Some(ledger)));
    }
    Ok((bevy_frugal_gi::power::open(name)?, None))
}

/// A scene on a headless renderer.
pub struct Stage {
    app: App,
    camera: Entity,
    target: Handle<Image>,
    options: StageOptions,
    space: Arc<KnobSpace>,
    /// The settings of the next frame, for the work meter.
    shown: Option<(Arc<KnobSpace>, KnobLevels)>,
    meter: Box<dyn PowerMeter>,
    /// Counts frames for the work meter, if that is the meter.
    ledger: Option<WorkLedger>,
    idle: Watts,
    rays: RayScene,
    bounds: Option<Bounds>,
    exposure: f32,
    vertical_fov_degrees: f32,
}

impl Stage {
    /// Stages `scene`, and waits for the first finished frame.
    ///
    /// # Errors
    /// When there is no adapter, an option is out of range, the scene's files cannot be read, or
    /// the renderer does not become ready.
    pub fn open(scene: &SceneDescription, options: StageOptions) -> Result<Self, StageError> {
        Self::open_with(scene, options, |_| ())
    }

    /// [`open`](Self::open), in an app to which `extend` adds plugins: for custom materials, and
    /// for passes that are compared with ours.
    ///
    /// # Errors
    /// As [`open`](Self::open).
    pub fn open_with(
        scene: &SceneDescription,
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
        let (meter, ledger) = open_meter(scene, &options, &adapter)?;
        let geometry = scene.geometry()?;
        let rays = RayScene::from_geometry(&geometry);
        let bounds = geometry.bounds();
        let mut app = app::build(options.frames_per_second, extend);
        let (camera, target) = world::spawn(&mut app, scene, geometry, &options)?;

        let registry = app.world().resource::<KnobRegistry>().clone();
        let all = registry.space()?;
        let space = match &options.knobs {
            Some(names) => registry
                .space_with(|name| names.iter().any(|other| other == name))?
                .subset(names.iter().map(String::as_str))?,
            None => all.clone(),
        };
        let mut stage = Self {
            app,
            camera,
            target,
            space: Arc::new(space),
            shown: None,
            idle: Watts(0.0),
            meter,
            ledger,
            rays,
            bounds,
            exposure: 1.0 / (1.2 * scene.exposure_ev100.exp2()),
            vertical_fov_degrees: scene.camera.vertical_fov,
            options,
        };
        // Knobs that are not on offer stay at their best, and all figures refer to that.
        let best = all.highest();
        stage.insert_settings(Arc::new(all), best)?;
        stage.get_ready()?;
        stage.idle = stage.measure_idle()?;
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

    /// Idle power, as far as the meter covers it.
    pub fn idle(&self) -> Watts {
        self.idle
    }

    /// Triangles for ray queries.
    pub fn rays(&self) -> &RayScene {
        &self.rays
    }

    /// Bounding box of the geometry; `None` without geometry.
    pub fn bounds(&self) -> Option<Bounds> {
        self.bounds
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

    /// Sets the knobs on offer, with a camera cut: the next frame has no temporal history.
    pub fn apply(&mut self, settings: KnobLevels) {
        self.switch(settings);
        self.cut();
    }

    /// Makes the next frame a camera cut.
    fn cut(&mut self) {
        self.app.world_mut().entity_mut(self.camera).insert(CameraCut);
    }

    /// Sets the knobs on offer without a cut, as a controller does.
    pub fn switch(&mut self, settings: KnobLevels) {
        let space = Arc::clone(&self.space);
        // The space was checked when the stage was opened.
        let _ = self.insert_settings(space, settings);
    }

    /// Sets knobs from text with a camera cut: `max`, `min`, or `knob=level` pairs; the others on
    /// offer are set to their best. The text may name knobs that must be named.
    ///
    /// # Errors
    /// When the text has another form, or names an unknown knob or level.
    pub fn apply_text(&mut self, text: &str) -> Result<(), StageError> {
        self.switch_text(text)?;
        self.cut();
        Ok(())
    }

    /// As [`apply_text`](Self::apply_text), without a cut.
    ///
    /// # Errors
    /// As [`apply_text`](Self::apply_text).
    pub fn switch_text(&mut self, text: &str) -> Result<(), StageError> {
        let names = || text.split(',').filter_map(|part| Some(part.split_once('=')?.0.trim()));
        let all = self
            .app
            .world()
            .resource::<KnobRegistry>()
            .space_with(|name| names().any(|other| other == name))?;
        let offered = self.space.knobs().iter().map(|knob| knob.name.as_str());
        let named = names()
            .filter(|name| self.space.index_of(name).is_none() && all.index_of(name).is_some());
        let space = all.subset(offered.chain(named))?;
        let settings = space.parse(text)?;
        self.insert_settings(Arc::new(space), settings)
    }

    /// Applies `settings`, and the best levels of all knobs outside `space`: without them, those
    /// would return to what the camera was spawned with.
    fn insert_settings(
        &mut self,
        space: Arc<KnobSpace>,
        settings: KnobLevels,
    ) -> Result<(), StageError> {
        let registry = self.app.world().resource::<KnobRegistry>();
        let all = registry.space_with(|name| space.index_of(name).is_some())?;
        let held = world::overridden_knobs(&self.options);
        let names = all.knobs().iter().map(|knob| knob.name.as_str());
        let applied = all.subset(names.filter(|name| !held.contains(name)))?;
        let levels = applied.from_levels(|_, knob| {
            space.index_of(&knob.name).map_or(knob.levels.len() - 1, |index| settings.level(index))
        });
        self.shown = Some((space, settings));
        let wanted = KnobSettings { space: Arc::new(applied), settings: levels };
        let mut camera = self.app.world_mut().entity_mut(self.camera);
        if camera.get::<KnobSettings>() != Some(&wanted) {
            camera.insert(wanted);
        }
        Ok(())
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

    /// Renders frames until all pipelines and resources of the frame are ready.
    ///
    /// # Errors
    /// When a shader does not compile, or it takes more than 600 frames.
    pub fn get_ready(&mut self) -> Result<(), StageError> {
        let mut ready_frames = 0;
        for _ in 0..600 {
            self.frame();
            let cache = self.render_world().resource::<PipelineCache>();
            for pipeline in cache.pipelines() {
                if let CachedPipelineState::Err(error) = &pipeline.state
                    // Shaders load in the background; Bevy retries in the next frame.
                    && !matches!(error, ShaderCacheError::ShaderNotLoaded(_) | ShaderCacheError::ShaderImportNotYetAvailable)
                {
                    return Err(StageError::NotReady(error.to_string()));
                }
            }
            let waiting = cache.waiting_pipelines().next().is_some()
                || self.app.world().resource::<GiOccluders>().waiting() > 0;
            // The count lags a frame behind the image.
            ready_frames = if waiting { 0 } else { ready_frames + 1 };
            if ready_frames == 0 {
                // Loading runs in other threads; frames of small images would leave it no time.
                std::thread::sleep(Duration::from_millis(5));
            }
            // Temporal accumulation still converges to the still image. In a scene that never rests
            // it never does.
            let accumulating = self
                .render_world()
                .get_resource::<GiCounts>()
                .is_some_and(|counts| counts.settling > 0);
            if ready_frames >= if accumulating { MOST_ACCUMULATION_FRAMES } else { 4 } {
                return Ok(());
            }
        }
        let waiting =
            self.render_world().resource::<PipelineCache>().pipelines().filter_map(|pipeline| {
                match &pipeline.state {
                    CachedPipelineState::Ok(_) => None,
                    state => Some(format!("{} ({state:?})", label(&pipeline.descriptor))),
                }
            });
        Err(StageError::NotReady(format!(
            "after 600 frames these are still missing: {}",
            waiting.collect::<Vec<_>>().join(", ")
        )))
    }

    /// Renders every level of every knob on offer once, so that all pipelines are compiled before
    /// anything is metered.
    ///
    /// # Errors
    /// When the renderer does not become ready.
    pub fn warm(&mut self) -> Result<(), StageError> {
        // The other knobs are at their cheapest, which is fast. A knob that depends on another is
        // rendered with each of the other's levels, because a pipeline may be specific to a pair.
        let space = Arc::clone(&self.space);
        for (index, knob) in space.knobs().iter().enumerate() {
            for base in space.cheapest_with(knob) {
                for level in 0..knob.levels.len() {
                    self.apply(base.with_level(index, level));
                    self.frame();
                }
            }
        }
        self.apply(space.highest());
        self.get_ready()
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
