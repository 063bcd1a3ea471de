//! Scenes: description file, geometry by Bevy's glTF loader, and camera paths. Nothing here renders.
//!
//! | module | job |
//! |---|---|
//! | `mod` | a scene in memory, read once |
//! | `description` | contents of a `*.scene.ron` file; the scenes that come with the tool |
//! | `path` | camera paths between keys |
//! | `document` | what Bevy's loader does not read of a glTF file |
//! | `spawn` | a description's geometry in an app |
//! | `geometry` | a description's geometry as plain data |
//! | `check`, `locate` | rules of a description; line and column of a field |
//! | `fingerprint` | a scene's identity |
//! | `load` | reads and checks a description; errors name file, line, column, field and remedy |
mod check;
mod description;
mod document;
mod fingerprint;
mod geometry;
mod load;
mod locate;
mod path;
mod spawn;

use std::ops::Deref;
use std::path::Path;
use std::sync::Arc;

use frugal_trace::integrator::{ReferenceScene, View};
use frugal_trace::light::Sky;
use frugal_trace::scene::{Bounds, CameraPose, RayScene, SceneGeometry, SkyMap};
use glam::{UVec2, Vec3};

pub use description::{Camera, Environment, Geometry, SceneDescription};
use document::Checked;
pub(crate) use fingerprint::level_fingerprint;
use fingerprint::{content_hash, fingerprint};
pub(crate) use geometry::headless;
pub use load::SceneError;
pub use path::{CameraKey, CameraPath};
pub(crate) use spawn::{SpawnedGeometry, spawn};

/// Default margin of the camera bounds, as a share of the geometry's extent at each side: walls are
/// seldom thinner.
const DEFAULT_BOUNDS_MARGIN: f32 = 0.1;

/// A scene with its geometry, read once and shared by all who need it. Dereferences to its
/// description.
#[derive(Clone, Debug)]
pub struct LoadedScene {
    /// The description.
    pub description: SceneDescription,
    /// Its geometry, as Bevy shows it.
    pub geometry: Arc<SceneGeometry>,
    /// What of the geometry's file is not represented, or not as Bevy shows it, as sentences.
    pub gaps: Vec<String>,
    /// The geometry's triangles, for ray queries.
    pub rays: Arc<RayScene>,
    /// Whether global illumination has a sky to gather: an environment map that sends light.
    pub(crate) has_environment_map: bool,
    /// The environment map, where [`load()`] has read it.
    pub(crate) sky: Option<Arc<SkyMap>>,
    /// Number of the scene in the geometry's file.
    pub(crate) number: usize,
}

impl Deref for LoadedScene {
    type Target = SceneDescription;

    fn deref(&self) -> &SceneDescription {
        &self.description
    }
}

/// Reads the scene description at `path` and checks it, with the files that it names.
///
/// # Errors
/// [`SceneError`], which names file, line, column, field, problem and remedy.
pub fn load(path: impl AsRef<Path>) -> Result<LoadedScene, SceneError> {
    let mut scene = LoadedScene::new(load::read(path.as_ref())?)?;
    scene.sky = scene.sky()?;
    // One column is the same all around.
    if let Some((width, height)) = scene.sky.as_ref().map(|sky| sky.size())
        && width > 1
        && width / 2 != height
    {
        scene.gaps.push(format!(
            "the environment map has {width}×{height} texels, and is read as latitude and longitude, \
             which has twice as many columns as rows"
        ));
    }
    Ok(scene)
}

impl LoadedScene {
    /// Reads the geometry of a description.
    ///
    /// # Errors
    /// [`SceneError::Invalid`] at the geometry's field, when its file is missing or broken.
    pub fn new(description: SceneDescription) -> Result<Self, SceneError> {
        let (geometry, Checked { scene: number, gaps }) =
            geometry::read(&description).map_err(|problem| description.locate(problem))?;
        Ok(Self { gaps, number, ..Self::with_geometry(description, geometry) })
    }

    /// A description with `geometry` in place of its own.
    pub fn with_geometry(description: SceneDescription, geometry: SceneGeometry) -> Self {
        let rays = RayScene::from_geometry(&geometry).into();
        Self {
            has_environment_map: description.environment.sends_light(),
            description,
            geometry: geometry.into(),
            gaps: Vec::new(),
            rays,
            sky: None,
            number: 0,
        }
    }

    /// The scene's identity: 32 hexadecimal digits that change with every change of the scene's
    /// images or camera space: its triangles, materials and textures, in any order, and the values
    /// of its description, but not its paths, its layout or its name. The same on every machine.
    ///
    /// # Errors
    /// [`SceneError::Invalid`] at the environment whose file cannot be read.
    pub fn fingerprint(&self) -> Result<String, SceneError> {
        Ok(fingerprint(&self.description, &self.geometry, &self.environment_bytes()?))
    }

    /// A hash of the bytes of the geometry's file, its buffers and images. They show more than the path
    /// tracer reads, which is all that the fingerprint holds: normal maps, glass, blended surfaces.
    ///
    /// # Errors
    /// [`SceneError::Invalid`] at the geometry whose file cannot be read.
    pub(crate) fn content(&self) -> Result<String, SceneError> {
        let bytes =
            geometry::file_bytes(&self.description).map_err(|problem| self.locate(problem))?;
        let (Geometry::Gltf(name) | Geometry::Procedural(name)) = &self.description.geometry;
        let file = self.resolve(name);
        let folder = file.parent().unwrap_or(Path::new(""));
        // A missing image is left out of what is shown, too.
        let others = document::files(&bytes)
            .into_iter()
            .map(|name| std::fs::read(folder.join(name)).unwrap_or_default());
        Ok(content_hash(others.chain([bytes])))
    }

    /// The camera space: the description's bounds, else the geometry's bounding box minus a tenth
    /// of its extent at each side. Without geometry a cubic metre around the origin.
    pub fn camera_bounds(&self) -> Bounds {
        let fallback = Bounds { min: Vec3::splat(-0.5), max: Vec3::splat(0.5) };
        self.description.bounds.unwrap_or_else(|| {
            self.geometry.bounds().map_or(fallback, |bounds| bounds.shrunk(DEFAULT_BOUNDS_MARGIN))
        })
    }

    /// The environment map, read where [`load()`] has not done so; `None` without one.
    ///
    /// # Errors
    /// [`SceneError::Invalid`] at its field.
    pub(crate) fn sky(&self) -> Result<Option<Arc<SkyMap>>, SceneError> {
        match (&self.environment, &self.sky) {
            (Environment::Map(..), Some(sky)) => Ok(Some(Arc::clone(sky))),
            _ => Ok(self.read_sky()?.map(Arc::new)),
        }
    }

    /// The scene for the path tracer.
    ///
    /// # Errors
    /// When the environment map cannot be read, or the geometry is broken.
    pub fn reference(&self) -> Result<ReferenceScene, String> {
        let map = self.sky().map_err(|error| error.to_string())?;
        let sky = match (&self.environment, map) {
            (Environment::Constant(radiance), _) => Sky::constant(*radiance),
            (Environment::Map(_, intensity), Some(map)) => {
                Sky::map(Arc::unwrap_or_clone(map), *intensity)
            }
            _ => Sky::Black,
        };
        self.reference_under(sky)
    }

    /// The same with another environment.
    pub(crate) fn reference_under(&self, sky: Sky) -> Result<ReferenceScene, String> {
        let (geometry, rays) = (Arc::clone(&self.geometry), Arc::clone(&self.rays));
        ReferenceScene::new(geometry, rays, &self.lights, sky)
            .map_err(|error| format!("the geometry cannot be used: {error}"))
    }
}

impl SceneDescription {
    /// A view of `size` pixels with the scene's lens, for the path tracer.
    pub fn view(&self, pose: CameraPose, size: UVec2) -> View {
        let (vertical_fov_degrees, near) = (self.camera.vertical_fov, self.camera.near);
        View { pose, vertical_fov_degrees, near, size }
    }
}
