//! The stage: a headless Bevy app that shows a scene to one camera, one finished frame at a time.
//!
//! Nothing is shared with a window: time steps by hand, pipelines compile before they are needed,
//! and a frame is over when the GPU is done.

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
use bevy::math::{Quat, UVec2, Vec3};
use bevy::render::RenderApp;
use bevy::render::render_resource::{
    CachedPipelineState, PipelineCache, PipelineDescriptor, PollType,
};
use bevy::render::renderer::RenderDevice;
use bevy::shader::ShaderCacheError;
use bevy::transform::components::Transform;
use bevy_frugal_gi::gi::{CameraCut, GiCounts, GiOccluders};
use bevy_frugal_gi::knobs::{KnobRegistry, KnobSettings, KnobSpace, RenderSettings};
use bevy_frugal_gi::power::{Adapter, MeterInfo, PowerMeter};
use bevy_frugal_gi::units::Watts;

use crate::cost::{FrameLayout, WorkLedger, WorkMeter, is_work_meter};
use crate::metrics::Picture;
use crate::scene::{Bounds, RayScene, SceneDescription, SceneError};

pub use crate::metrics::Radiance;
pub use adapter::{adapter, software_adapter};
pub use evaluator::StageEvaluator;
pub use frame_renderer::StageFrameRenderer;
pub use remote::{RemoteError, RemoteStage, StageRequest, serve};
pub use useful::{every_knob, knobs, useful_knobs};
pub use world::populate;

/// What is drawn into.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Output {
    /// What a screen would show: 8-bit sRGB, tone-mapped.
    #[default]
    Display,
    /// Linear radiance in nits, before exposure; without antialiasing and post-processing, which
    /// belong to a display.
    Radiance,
}

/// Which light an image holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Component {
    /// All of it.
    #[default]
    Full,
    /// What the renderer shows without global illumination; of a path-traced image, what one
    /// surface at most scattered.
    Direct,
    /// What lamps light by way of other surfaces, all of them matt; of a path-traced image, what
    /// more than one surface scattered.
    Indirect,
    /// What global illumination gives: indirect light, and that of emissive surfaces and of the sky
    /// on others.
    Global,
}

/// Frames that averaged light may take to come to rest.
const MOST_SETTLING_FRAMES: u32 = 70;

/// How a scene is staged.
#[derive(Clone, Debug, PartialEq)]
pub struct StageOptions {
    /// Width and height, pixels.
    pub size: UVec2,
    /// Target frame rate, which turns energy per frame into power.
    pub frames_per_second: f64,
    /// What is drawn into.
    pub output: Output,
    /// Which light.
    pub component: Component,
    /// Names of the knobs to offer; where none are given, all that need not be named. The others
    /// stand at their best.
    pub knobs: Option<Vec<String>>,
    /// Meter by name; the one that suits the adapter where none is given.
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

/// Why a scene cannot be staged, or a frame not be rendered.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StageError {
    /// There is no GPU, nor a software one.
    #[error(
        "no graphics adapter: install a Vulkan driver for the GPU, or a software one (on Debian: apt install mesa-vulkan-drivers), and try again"
    )]
    NoAdapter,
    /// A size of 0, too small for some of the passes, or larger than a texture can be.
    #[error(
        "size {0}x{1}: must be 32 pixels or more along one side at least, and no more than 8192 along either"
    )]
    Size(u32, u32),
    /// Not a positive number.
    #[error("frame rate {0}: must be a finite number above 0")]
    FrameRate(f64),
    /// The scene file, or one that it names.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A knob that does not exist.
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
    /// A pipeline that does not compile, or never gets ready.
    #[error("the renderer did not get ready: {0}")]
    NotReady(String),
    /// The image could not be read back.
    #[error("the picture could not be read back: {0}")]
    ReadBack(String),
    /// The comparison of images.
    #[error(transparent)]
    Compare(#[from] crate::metrics::CompareError),
}

impl StageError {
    /// Whether the input is to blame, rather than the rendering.
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
    meter: Box<dyn PowerMeter>,
    /// Where the meter counts work: what it is told of.
    ledger: Option<WorkLedger>,
    idle: Watts,
    rays: RayScene,
    bounds: Option<Bounds>,
    exposure: f32,
    vertical_fov_degrees: f32,
}

impl Stage {
    /// Stages `scene`, and waits until the first finished frame.
    ///
    /// # Errors
    /// When there is no adapter, the options make no sense, the scene's files cannot be read, or
    /// the renderer does not get ready.
    pub fn open(scene: &SceneDescription, options: StageOptions) -> Result<Self, StageError> {
        Self::open_with(scene, options, |_| ())
    }

    /// [`open`](Self::open), in an app to which `extend` adds plugins: for materials that are not
    /// Bevy's, and passes that are compared with ours.
    ///
    /// # Errors
    /// As [`open`](Self::open).
    pub fn open_with(
        scene: &SceneDescription,
        options: StageOptions,
        extend: impl FnOnce(&mut App),
    ) -> Result<Self, StageError> {
        // Ambient occlusion makes five mip levels of the view, also at half the resolution. Where
        // there is no room for them, Bevy ends rendering.
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
            idle: Watts(0.0),
            meter,
            ledger,
            rays,
            bounds,
            exposure: 1.0 / (1.2 * scene.exposure_ev100.exp2()),
            vertical_fov_degrees: scene.camera.vertical_fov,
            options,
        };
        // Knobs that are not offered stand at their best, in this stage and so in every figure that
        // it gives.
        let best = all.highest();
        stage.insert_settings(Arc::new(all), best);
        stage.get_ready()?;
        stage.idle = stage.measure_idle()?;
        Ok(stage)
    }

    /// The knobs on offer.
    pub fn space(&self) -> &Arc<KnobSpace> {
        &self.space
    }

    /// How it was staged.
    pub fn options(&self) -> &StageOptions {
        &self.options
    }

    /// The meter's name and provenance.
    pub fn meter(&self) -> MeterInfo {
        self.meter.info()
    }

    /// Power while nothing is rendered, as far as the meter covers it.
    pub fn idle(&self) -> Watts {
        self.idle
    }

    /// Triangles for questions that need no image.
    pub fn rays(&self) -> &RayScene {
        &self.rays
    }

    /// The box around the geometry, where there is any.
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

    /// The render world, for tests that read what the GPU holds.
    pub fn render_world(&self) -> &bevy::ecs::world::World {
        self.app.sub_app(RenderApp).world()
    }

    /// Moves the camera.
    pub fn place(&mut self, position: Vec3, rotation: Quat) {
        if let Some(mut transform) = self.app.world_mut().get_mut::<Transform>(self.camera) {
            *transform = Transform { translation: position, rotation, ..Default::default() };
        }
    }

    /// Sets the knobs on offer, as of a camera cut: the next frame owes nothing to those before.
    pub fn apply(&mut self, settings: RenderSettings) {
        self.switch(settings);
        self.app.world_mut().entity_mut(self.camera).insert(CameraCut);
    }

    /// Sets the knobs on offer in the midst of play, as a controller does.
    pub fn switch(&mut self, settings: RenderSettings) {
        let space = Arc::clone(&self.space);
        self.insert_settings(space, settings);
    }

    /// Sets the knobs that a text tells of, and those on offer that it does not at their best:
    /// `max`, `min`, or `knob=level` pairs. Knobs that must be named are among them where it does.
    ///
    /// # Errors
    /// When the text is of another form, or names a knob or a level that is not there.
    pub fn apply_text(&mut self, text: &str) -> Result<(), StageError> {
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
        self.insert_settings(Arc::new(space), settings);
        self.app.world_mut().entity_mut(self.camera).insert(CameraCut);
        Ok(())
    }

    fn insert_settings(&mut self, space: Arc<KnobSpace>, settings: RenderSettings) {
        let wanted = KnobSettings { space, settings };
        let mut camera = self.app.world_mut().entity_mut(self.camera);
        if camera.get::<KnobSettings>() != Some(&wanted) {
            camera.insert(wanted);
        }
    }

    /// Renders one frame to its end.
    pub fn frame(&mut self) {
        if self.options.output == Output::Radiance || self.options.component != Component::Full {
            world::hold_overrides(self.app.world_mut(), self.camera, &self.options);
        }
        self.app.update();
        let device = self.app.sub_app(RenderApp).world().resource::<RenderDevice>();
        // Fails only when the device is lost, which the next frame reports better.
        let _ = device.poll(PollType::wait_indefinitely());
        if let (Some(ledger), Some(shown)) =
            (&self.ledger, self.app.world().get::<KnobSettings>(self.camera))
        {
            ledger.count(&shown.space, shown.settings);
        }
    }

    /// Renders frames until every pipeline that the frame needs is there.
    ///
    /// # Errors
    /// When a shader does not compile, or it takes more than 600 frames.
    pub fn get_ready(&mut self) -> Result<(), StageError> {
        let mut quiet = 0;
        for _ in 0..600 {
            self.frame();
            let cache = self.render_world().resource::<PipelineCache>();
            for pipeline in cache.pipelines() {
                if let CachedPipelineState::Err(error) = &pipeline.state
                    // Shaders load in the background, and Bevy asks again in the next frame.
                    && !matches!(error, ShaderCacheError::ShaderNotLoaded(_) | ShaderCacheError::ShaderImportNotYetAvailable)
                {
                    return Err(StageError::NotReady(error.to_string()));
                }
            }
            let waiting = cache.waiting_pipelines().next().is_some()
                || self.app.world().resource::<GiOccluders>().waiting() > 0;
            // The count lags a frame behind the image.
            quiet = if waiting { 0 } else { quiet + 1 };
            if quiet == 0 {
                // What is waited for loads in other threads, which small images would leave no
                // time.
                std::thread::sleep(Duration::from_millis(5));
            }
            // Light that was averaged over frames is on its way to what a still image shows. Where
            // a scene never rests, it never gets there.
            let settling = self
                .render_world()
                .get_resource::<GiCounts>()
                .is_some_and(|counts| counts.settling > 0);
            if quiet >= if settling { MOST_SETTLING_FRAMES } else { 4 } {
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

    /// Shows every level of every knob on offer once: what a level has to compile is compiled
    /// before anything is metered.
    ///
    /// # Errors
    /// When the renderer does not get ready.
    pub fn warm(&mut self) -> Result<(), StageError> {
        // The others at their cheapest, so that it does not take long. A knob that acts only with
        // another is shown with each of the other's levels: one pipeline may serve a pair.
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

    /// What the last frame shows.
    ///
    /// # Errors
    /// When it cannot be read back.
    pub fn picture(&self) -> Result<Picture, StageError> {
        capture::picture(self.render_world(), &self.target)
    }

    /// The last frame's radiance, in nits.
    ///
    /// # Errors
    /// When it cannot be read back, or the stage's output is no radiance.
    pub fn radiance(&self) -> Result<Radiance, StageError> {
        capture::radiance(self.render_world(), &self.target, self.exposure)
    }
}
