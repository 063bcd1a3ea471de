//! Geometry and lights, prepared for path tracing, and ray queries.

use std::sync::Arc;

use glam::{DVec3, Vec3};

use crate::bsdf::is_cut_out;
use crate::light::{Emitters, IncidentLight, Light, PunctualLight, Sky};
use crate::scene::{AlphaMode, GeometryError, Hit, RayScene, SceneGeometry, Side};

/// Share of the distance to a light that shadow rays test: the emissive triangle at the end must
/// not occlude itself.
const FREE_SHARE: f64 = 1.0 - 1e-5;

/// A scene for [`render`](super::render()).
#[derive(Debug)]
pub struct ReferenceScene {
    pub(crate) geometry: Arc<SceneGeometry>,
    pub(super) lights: Vec<PunctualLight>,
    pub(crate) emitters: Emitters,
    pub(crate) sky: Sky,
    rays: Arc<RayScene>,
    /// By material, whether it is double-sided and opaque: most are, and their hits need no further
    /// test.
    is_solid: Vec<bool>,
    #[cfg(feature = "media")]
    pub(crate) fog: Option<crate::media::Fog>,
}

impl ReferenceScene {
    /// A scene whose `rays` are those of `geometry`'s triangles. Lights that are dark or not finite
    /// are left out.
    ///
    /// # Errors
    /// When the geometry is not [valid](SceneGeometry::validate).
    pub fn new(
        geometry: Arc<SceneGeometry>,
        rays: Arc<RayScene>,
        lights: &[Light],
        sky: Sky,
    ) -> Result<Self, GeometryError> {
        geometry.validate()?;
        Ok(Self {
            lights: lights.iter().filter_map(PunctualLight::new).collect(),
            emitters: Emitters::new(&geometry),
            is_solid: geometry
                .materials
                .iter()
                .map(|material| material.double_sided && material.alpha == AlphaMode::Opaque)
                .collect(),
            rays,
            sky,
            geometry,
            #[cfg(feature = "media")]
            fog: None,
        })
    }

    /// The same scene with fog in place of what fog it had. Fog that neither absorbs nor scatters
    /// is none.
    ///
    /// # Errors
    /// When the fog is not [valid](crate::media::Fog::validate).
    #[cfg(feature = "media")]
    pub fn with_fog(self, fog: crate::media::Fog) -> Result<Self, crate::media::FogError> {
        fog.validate()?;
        Ok(Self { fog: Some(fog).filter(|fog| !fog.is_empty()), ..self })
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
    pub(crate) fn closest(&self, origin: Vec3, direction: DVec3) -> Option<Hit> {
        self.rays.closest_where(origin, direction.as_vec3(), f32::INFINITY, |hit| {
            self.accepts(hit, Side::Back)
        })
    }

    /// Whether light of an emissive triangle or of the sky reaches `origin`. Culls the same faces
    /// as [`closest`](Self::closest), since BSDF sampling finds the same light.
    pub(crate) fn is_unoccluded(&self, origin: Vec3, direction: DVec3, distance: f64) -> bool {
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
    pub(crate) fn is_lit(&self, origin: Vec3, light: &IncidentLight) -> bool {
        let reach = (light.distance * FREE_SHARE) as f32;
        !self.rays.any_where(origin, light.direction.as_vec3(), reach, |hit| {
            self.accepts(hit, Side::Front)
        })
    }

    /// Whether there are lights that scattered paths can hit.
    pub(crate) fn has_extended_light(&self) -> bool {
        !self.emitters.is_empty() || self.sky.is_lit()
    }

    fn accepts(&self, hit: &Hit, culled: Side) -> bool {
        let material = self.geometry.meshes[hit.triangle.mesh].material;
        self.is_solid[material]
            || ((hit.side != culled || self.geometry.materials[material].double_sided)
                && !is_cut_out(&self.geometry, hit))
    }
}
