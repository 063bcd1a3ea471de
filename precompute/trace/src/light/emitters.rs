//! Emissive triangles, and sampling of points on them.

use std::collections::HashMap;

use glam::DVec3;

use crate::color::{color, luminance};
use crate::sampler::pick;
use crate::scene::{Hit, SceneGeometry, Side, Triangle};

/// Steps along a triangle's edge at which an emissive texture is read to estimate the triangle's
/// power.
const STEPS: u32 = 8;
/// Least estimate, as a share of what the texture's mean would give: a bright spot that all steps
/// miss is sampled, too.
const LEAST_SHARE: f64 = 0.01;

/// All emissive triangles, sampled by power: area × mean luminance. Where a texture modulates
/// emission the mean is an estimate, and points are uniform over a triangle: the choice of points
/// is only as good as the estimate, but what they emit is always the texel's.
#[derive(Debug, Default)]
pub(crate) struct Emitters {
    triangles: Vec<Triangle>,
    /// Running sum of power.
    cumulative: Vec<f64>,
    /// Mean luminance by mesh and triangle, nits; empty for a mesh that emits nothing.
    means: Vec<Vec<f64>>,
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
        let mut emitters =
            Self { means: vec![Vec::new(); geometry.meshes.len()], ..Self::default() };
        let mut power = 0.0;
        let mut texture_means = HashMap::new();
        for triangle in geometry.triangles() {
            let material = &geometry.materials[geometry.meshes[triangle.mesh].material];
            let own = luminance(color(material.emissive));
            // A product with an overflowing area is left out below.
            if own <= 0.0 || !own.is_finite() {
                continue;
            }
            let mean = material.emissive_texture.map_or(own, |read| {
                let mean = || geometry.textures[read.texture].mean();
                let [red, green, blue, _] = *texture_means.entry(read.texture).or_insert_with(mean);
                let overall = color(material.emissive) * DVec3::new(red, green, blue);
                mean_luminance(geometry, &triangle).max(luminance(overall) * LEAST_SHARE)
            });
            let means = &mut emitters.means[triangle.mesh];
            means.resize(triangle.index + 1, 0.0);
            let [a, b, c] = triangle.corners.map(|corner| corner.as_dvec3());
            let own = 0.5 * (b - a).cross(c - a).length() * mean;
            if own > 0.0 && own.is_finite() {
                means[triangle.index] = mean;
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

    /// Sampling density at a hit, per m²: the triangle's mean luminance ÷ the power of all
    /// triangles.
    pub(crate) fn density(&self, hit: &Hit) -> f64 {
        let mean =
            self.means.get(hit.triangle.mesh).and_then(|means| means.get(hit.triangle.index));
        match (mean, self.cumulative.last()) {
            (Some(mean), Some(power)) => mean / power,
            _ => 0.0,
        }
    }

    /// Samples a point; `None` where no triangle is emissive.
    pub(crate) fn sample(&self, choice: f64, [u1, u2]: [f64; 2]) -> Option<EmitterPoint> {
        let triangle = self.triangles[pick(&self.cumulative, choice)?];
        // Uniform over the triangle: Turk 1990, "Generating Random Points in Triangles".
        let root = u1.sqrt();
        let (second, third) = (root * (1.0 - u2), root * u2);
        let [a, b, c] = triangle.corners.map(|corner| corner.as_dvec3());
        let hit = on(triangle, [1.0 - second - third, second, third]);
        Some(EmitterPoint {
            position: a + (b - a) * second + (c - a) * third,
            density: self.density(&hit),
            hit,
        })
    }
}

/// A hit on a triangle's front.
fn on(triangle: Triangle, weights: [f64; 3]) -> Hit {
    let weights = weights.map(|weight| weight as f32);
    Hit { distance: 0.0, side: Side::Front, triangle, weights }
}

/// Mean luminance over a triangle, from a grid of points.
fn mean_luminance(geometry: &SceneGeometry, triangle: &Triangle) -> f64 {
    let steps = f64::from(STEPS);
    // Centres of the parts into which lines through the steps cut the triangle.
    let centres = (0..STEPS).flat_map(|i| (0..STEPS).map(move |j| (i, j))).map(|(i, j)| {
        let (u, v) = ((f64::from(i) + 1.0 / 3.0) / steps, (f64::from(j) + 1.0 / 3.0) / steps);
        let (u, v) = if i + j < STEPS { (u, v) } else { (1.0 - u, 1.0 - v) };
        [1.0 - u - v, u, v]
    });
    let luminances = centres.map(|weights| luminance(geometry.emission(&on(*triangle, weights))));
    luminances.sum::<f64>() / (steps * steps)
}
