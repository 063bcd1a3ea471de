//! Geometry and lights, prepared for path tracing, and ray queries.

use glam::{DVec3, Vec3};

use super::color;
use super::emitters::Emitters;
use super::lights::{IncidentLight, PunctualLight};
use super::sky::Sky;
use super::surface::is_cut_out;
use crate::scene::mesh::GeometryError;
use crate::scene::rays::Hit;
use crate::scene::sky::SkyError;
use crate::scene::{
    AlphaMode, Environment, Light, RayScene, SceneDescription, SceneError, SceneGeometry, Side,
    SkyMap,
};

/// Share of the distance to a light that shadow rays test: the emissive triangle at the end must
/// not occlude itself.
const FREE_SHARE: f64 = 1.0 - 1e-5;

/// Why a scene cannot be path-traced.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReferenceError {
    /// The scene's file, or one that it names.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The environment map.
    #[error(transparent)]
    Sky(#[from] SkyError),
    /// The geometry.
    #[error("the geometry cannot be used: {0}")]
    Geometry(#[from] GeometryError),
}

/// A scene for [`render`](super::render()).
#[derive(Debug)]
pub struct ReferenceScene {
    pub(super) geometry: SceneGeometry,
    pub(super) lights: Vec<PunctualLight>,
    pub(super) emitters: Emitters,
    pub(super) sky: Sky,
    rays: RayScene,
    /// By material, whether it is double-sided and opaque: most are, and their hits need no further
    /// test.
    is_solid: Vec<bool>,
}

impl ReferenceScene {
    /// Reads what `description` names and builds its ray tree.
    ///
    /// # Errors
    /// When a file that it names cannot be read or is broken.
    pub fn new(description: &SceneDescription) -> Result<Self, ReferenceError> {
        Self::with_geometry(description, description.geometry()?)
    }

    /// The same with geometry that is already loaded, in place of the description's.
    ///
    /// # Errors
    /// When the environment cannot be read or the geometry is broken.
    pub fn with_geometry(
        description: &SceneDescription,
        geometry: SceneGeometry,
    ) -> Result<Self, ReferenceError> {
        let sky = match &description.environment {
            Environment::None => Sky::Black,
            Environment::Constant(radiance) if *radiance == [0.0; 3] => Sky::Black,
            Environment::Constant(radiance) => Sky::Constant(color(*radiance)),
            Environment::Map(file, intensity) => {
                Sky::map(SkyMap::read(&description.resolve(file))?, *intensity)
            }
        };
        Self::from_parts(geometry, &description.lights, sky)
    }

    /// A scene from loaded parts.
    pub(super) fn from_parts(
        geometry: SceneGeometry,
        lights: &[Light],
        sky: Sky,
    ) -> Result<Self, ReferenceError> {
        geometry.validate()?;
        Ok(Self {
            rays: RayScene::from_geometry(&geometry),
            lights: lights.iter().filter_map(PunctualLight::new).collect(),
            emitters: Emitters::new(&geometry),
            is_solid: geometry
                .materials
                .iter()
                .map(|material| material.double_sided && material.alpha == AlphaMode::Opaque)
                .collect(),
            sky,
            geometry,
        })
    }

    /// Number of triangles that rays can hit.
    pub fn triangle_count(&self) -> usize {
        self.rays.triangle_count()
    }

    /// The first hit of a path.
    ///
    /// Bevy culls back faces of single-sided materials, so paths pass through them, at the camera
    /// and at every bounce alike: an invisible face emits and reflects nothing. Alpha cut-outs are
    /// ignored too.
    pub(super) fn closest(&self, origin: Vec3, direction: DVec3) -> Option<Hit> {
        self.rays.closest_where(origin, direction.as_vec3(), f32::INFINITY, |hit| {
            self.accepts(hit, Side::Back)
        })
    }

    /// Whether light of an emissive triangle or of the sky reaches `origin`. Culls the same faces
    /// as [`closest`](Self::closest), since BSDF sampling finds the same light.
    pub(super) fn is_unoccluded(&self, origin: Vec3, direction: DVec3, distance: f64) -> bool {
        let reach = (distance * FREE_SHARE) as f32;
        !self
            .rays
            .any_where(origin, direction.as_vec3(), reach, |hit| self.accepts(hit, Side::Back))
    }

    /// Whether a punctual light reaches `origin`.
    ///
    /// Bevy's shadow maps and the plugin's light maps are rendered from the **light**: a
    /// single-sided triangle that faces away from the light casts no shadow. This ray starts at the
    /// other end, and so passes through front faces. Closed solids cast the same shadow either way;
    /// sheets and rooms that only have an inside do not, and there the direct light must match the
    /// renderer's.
    pub(super) fn is_lit(&self, origin: Vec3, light: &IncidentLight) -> bool {
        let reach = (light.distance * FREE_SHARE) as f32;
        !self.rays.any_where(origin, light.direction.as_vec3(), reach, |hit| {
            self.accepts(hit, Side::Front)
        })
    }

    /// Whether there are lights that scattered paths can hit.
    pub(super) fn has_extended_light(&self) -> bool {
        !self.emitters.is_empty() || self.sky.is_lit()
    }

    fn accepts(&self, hit: &Hit, culled: Side) -> bool {
        let material = self.geometry.meshes[hit.triangle.mesh].material;
        self.is_solid[material]
            || ((hit.side != culled || self.geometry.materials[material].double_sided)
                && !is_cut_out(&self.geometry, hit))
    }
}
