//! What is rendered: a scene file, or a level of an app.

use std::cell::Cell;
use std::ops::Deref;
use std::path::Path;

use bevy_frugal_gi::stage::extract::{ExtractedScene, ExtractedSky};
use bevy_frugal_gi::stage::{StageError, StageOptions};
use frugal_core::frontier::SceneIdentity;
use frugal_core::knobs::KnobSpace;
use frugal_trace::integrator::ReferenceScene;
use frugal_trace::light::Sky;

use super::connection::Connection;
use super::process::StageProcess;
use super::program::Program;
use crate::scene::{
    self, Camera, Environment, Geometry, LoadedScene, SceneDescription, SceneError,
};
use crate::stage::{built_in_knobs, useful_knobs};

/// A scene file, or a level of an app: what the search and the path tracer need of it, and the program
/// that renders it. Dereferences to its scene. Says when it ends what of it is not shown or not
/// path-traced.
pub(crate) struct StagedScene {
    /// As maps and files name it.
    pub name: String,
    /// As messages name it.
    pub label: String,
    /// What renders it.
    pub program: Program,
    /// Every knob of the program, opt-in ones included.
    pub knobs: KnobSpace,
    scene: LoadedScene,
    /// Only of an app.
    level: Option<Level>,
}

/// What only a level of an app has.
struct Level {
    fingerprint: String,
    sky: ExtractedSky,
    opt_in: Vec<String>,
    /// The program that it came from, until that is taken.
    running: Cell<Option<Connection>>,
}

impl Deref for StagedScene {
    type Target = LoadedScene;

    fn deref(&self) -> &LoadedScene {
        &self.scene
    }
}

impl Drop for StagedScene {
    /// What a file's scene lacks is said once its command is through. What an app's lacks, only path
    /// tracing shows.
    fn drop(&mut self) {
        if self.level.is_none() {
            self.warn();
        }
    }
}

impl StagedScene {
    fn warn(&self) {
        for gap in &self.scene.gaps {
            eprintln!("warning: {}: {gap}", self.label);
        }
    }

    /// Loads a scene file.
    ///
    /// # Errors
    /// When it or what it names cannot be used.
    pub(crate) fn of_file(path: &Path) -> Result<Self, SceneError> {
        let scene = scene::load(path)?;
        let file = path
            .file_name()
            .map_or_else(|| path.display().to_string(), |name| name.to_string_lossy().into_owned());
        Ok(Self {
            name: file.strip_suffix(".scene.ron").map_or_else(|| file.clone(), str::to_owned),
            label: path.display().to_string(),
            program: Program::File(path.to_owned()),
            knobs: built_in_knobs(true),
            scene,
            level: None,
        })
    }

    /// Starts an app, and waits for its level.
    ///
    /// # Errors
    /// When it cannot be started, or has no level.
    pub(crate) fn of_app(program: Program) -> Result<Self, StageError> {
        let mut connection = Connection::open(&program, None)?;
        let (knobs, opt_in, scene) = connection.load(true)?;
        let extracted: ExtractedScene = postcard::from_bytes(&scene).map_err(|error| {
            StageError::failed(format!("the app's scene cannot be read: {error}"))
        })?;
        let name = match &program {
            Program::App { level: Some(level), .. } => format!("{}/{level}", connection.hello.app),
            _ => connection.hello.app.clone(),
        };
        let ExtractedScene { geometry, lights, sky, exposure_ev100, near, far, gaps, .. } =
            extracted;
        let has_environment_map = extracted.has_environment_map;
        let camera = Camera { vertical_fov: extracted.vertical_fov_degrees, near, far };
        let description = SceneDescription {
            lights,
            exposure_ev100,
            camera,
            ..SceneDescription::new(Geometry::Procedural(String::new()))
        };
        let mut scene = LoadedScene {
            gaps,
            has_environment_map,
            ..LoadedScene::with_geometry(description, geometry)
        };
        let fingerprint = scene::level_fingerprint(&scene, &scene.geometry);
        scene.description.environment = match &sky {
            ExtractedSky::Black => Environment::None,
            ExtractedSky::Constant(radiance) => Environment::Constant(*radiance),
            // Its texels are in `sky`.
            ExtractedSky::Map(_, intensity) => Environment::Map(String::new(), *intensity),
        };
        let running = Cell::new(Some(connection));
        Ok(Self {
            label: name.clone(),
            name,
            program,
            knobs,
            scene,
            level: Some(Level { fingerprint, sky, opt_in, running }),
        })
    }

    /// Name and fingerprint.
    ///
    /// # Errors
    /// When a file of the scene cannot be read.
    pub(crate) fn identity(&self) -> Result<SceneIdentity, SceneError> {
        let fingerprint = match &self.level {
            Some(level) => level.fingerprint.clone(),
            None => self.scene.fingerprint()?,
        };
        Ok(SceneIdentity { name: self.name.clone(), fingerprint })
    }

    /// A hash of the files of a scene file's geometry; `None` of an app, whose files nobody knows.
    ///
    /// # Errors
    /// When a file of the scene cannot be read.
    pub(crate) fn content(&self) -> Result<Option<String>, SceneError> {
        match self.level {
            Some(_) => Ok(None),
            None => self.scene.content().map(Some),
        }
    }

    /// The scene for the path tracer.
    ///
    /// # Errors
    /// When the environment map cannot be read, or the geometry is broken.
    pub(crate) fn reference(&self) -> Result<ReferenceScene, String> {
        let sky = match self.level.as_ref().map(|level| &level.sky) {
            None => return self.scene.reference(),
            Some(ExtractedSky::Black) => Sky::Black,
            Some(ExtractedSky::Constant(radiance)) => Sky::constant(*radiance),
            Some(ExtractedSky::Map(map, intensity)) => Sky::map(map.clone(), *intensity),
        };
        self.warn();
        self.scene.reference_under(sky)
    }

    /// Names of the knobs that can affect its images: an app's own among them.
    pub(crate) fn useful_knobs(&self) -> Vec<String> {
        let useful = useful_knobs(&self.scene);
        let Some(level) = &self.level else { return useful };
        let built_in = built_in_knobs(true);
        let is_textured = !self.scene.geometry.textures.is_empty();
        let is_useful = |name: &String| match name.as_str() {
            // An app may ask for reflections, contact shadows or fog, and its textures may have mip
            // levels.
            "effects" => true,
            "texture_detail" => is_textured,
            _ => useful.contains(name) || built_in.index_of(name).is_none(),
        };
        let names = self.knobs.knobs().iter().map(|knob| knob.name.clone());
        names.filter(|name| is_useful(name) && !level.opt_in.contains(name)).collect()
    }

    /// A process that renders it, for images whose power nobody reads.
    pub(crate) fn process(&self, options: StageOptions) -> StageProcess {
        StageProcess::new(self.program.clone(), self.take_running(), options, None, None)
    }

    /// The program that the level came from, once.
    pub(super) fn take_running(&self) -> Option<Connection> {
        self.level.as_ref()?.running.take()
    }
}
