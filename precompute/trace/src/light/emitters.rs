//! Emissive triangles, and sampling of points on them.

use glam::DVec3;

use crate::color::{color, luminance};
use crate::scene::{Hit, SceneGeometry, Side, Triangle};

/// All emissive triangles, sampled by power: area × luminance.
#[derive(Debug, Default)]
pub(crate) struct Emitters {
    triangles: Vec<Triangle>,
    /// Running sum of power.
    cumulative: Vec<f64>,
}

/// A point on an emissive triangle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EmitterPoint {
    /// Metres.
    pub(crate) position: DVec3,
    /// Probability density, per m².
    pub(crate) density: f64,
    /// The same point as a hit on the triangle's front.
    pub(crate) hit: Hit,
}

impl Emitters {
    /// The emissive triangles of `geometry`, which must be valid.
    pub(crate) fn new(geometry: &SceneGeometry) -> Self {
        let mut emitters = Self::default();
        let mut power = 0.0;
        for triangle in geometry.triangles() {
            let [a, b, c] = triangle.corners.map(|corner| corner.as_dvec3());
            let area = 0.5 * (b - a).cross(c - a).length();
            let own = area
                * luminance(color(
                    geometry.materials[geometry.meshes[triangle.mesh].material].emissive,
                ));
            if own > 0.0 && own.is_finite() {
                power += own;
                emitters.triangles.push(triangle);
                emitters.cumulative.push(power);
            }
        }
        emitters
    }

    /// Whether no triangle is emissive.
    pub(crate) fn is_empty(&self) -> bool {
        self.triangles.is_empty()
    }

    /// Area × luminance of all triangles, m² · nits.
    pub(crate) fn power(&self) -> f64 {
        self.cumulative.last().copied().unwrap_or(0.0)
    }

    /// Sampling density on a triangle that emits `radiance`, per m²: the luminance ÷ the power of
    /// all triangles.
    pub(crate) fn density(&self, radiance: DVec3) -> f64 {
        self.cumulative.last().map_or(0.0, |power| luminance(radiance) / power)
    }

    /// Samples a point; `None` where no triangle is emissive.
    pub(crate) fn sample(
        &self,
        geometry: &SceneGeometry,
        choice: f64,
        [u1, u2]: [f64; 2],
    ) -> Option<EmitterPoint> {
        let power = *self.cumulative.last()?;
        let index = self
            .cumulative
            .partition_point(|sum| *sum <= choice * power)
            .min(self.triangles.len() - 1);
        let triangle = self.triangles[index];
        // Uniform over the triangle: Turk 1990, "Generating Random Points in Triangles".
        let root = u1.sqrt();
        let (second, third) = (root * (1.0 - u2), root * u2);
        let [a, b, c] = triangle.corners.map(|corner| corner.as_dvec3());
        let radiance = color(geometry.materials[geometry.meshes[triangle.mesh].material].emissive);
        let weights = [1.0 - second - third, second, third].map(|weight| weight as f32);
        Some(EmitterPoint {
            position: a + (b - a) * second + (c - a) * third,
            density: self.density(radiance),
            hit: Hit { distance: 0.0, side: Side::Front, triangle, weights },
        })
    }
}
