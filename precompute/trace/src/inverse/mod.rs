//! Light transport run backwards: tests of renderer and tracer that a picture cannot give.
//!
//! A matrix holds the light from each pixel of a projector to each pixel of a camera. Sen et al.
//! 2005, "Dual Photography": light paths can be walked either way, so that the transposed matrix
//! gives the image that a camera in the projector's place would take, were the camera a projector.
//!
//! | module | job |
//! |---|---|
//! | `patterns` | random patterns that a transform multiplies with |
//! | `dual` | the projector's view from few images of the camera; relighting it |

mod dual;
mod patterns;

use glam::{DVec2, DVec3, Vec3};
use rayon::prelude::*;

use crate::bsdf::{Bsdf, Shading, Surface};
use crate::color::luminance;
use crate::integrator::{Pixels, ReferenceScene, View};
use crate::light::IncidentLight;
use crate::sampler::Sampler;
pub use dual::{Capture, Recovery};
pub use patterns::Patterns;

/// Greatest number of entries of a matrix: 1 GiB.
const MOST_ENTRIES: u64 = 1 << 28;

/// Why there is no result.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum InverseError {
    /// Numbers of values do not belong together.
    #[error("{what}: {given} given, {expected} expected")]
    Size {
        /// What does not fit.
        what: &'static str,
        /// Number given.
        given: usize,
        /// Number that fits.
        expected: usize,
    },
    /// A transform needs powers of two.
    #[error("{what} is {value}; it must be a power of two and at least 2")]
    PowerOfTwo {
        /// The quantity.
        what: &'static str,
        /// Its value.
        value: usize,
    },
    /// A matrix would not fit in memory.
    #[error("a matrix of {0} entries is too large")]
    TooLarge(u64),
}

/// How [`Transport::trace`] works.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tracing {
    /// Paths per pixel of the camera, at least 1.
    pub samples: u32,
    /// Greatest number of bounces between the first surface and the last; 0 is direct light.
    pub bounces: u32,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Reflection model.
    pub shading: Shading,
}

impl Default for Tracing {
    fn default() -> Self {
        Self { samples: 64, bounces: 3, seed: 0, shading: Shading::default() }
    }
}

/// What each pixel of a camera gathers of each pixel of a projector.
///
/// The entry of a pair is the double integral, over the solid angles of both pixels, of the radiance
/// at the camera for a projector of 1 candela: its transpose is the same integral with camera and
/// projector swapped.
#[derive(Clone, Debug, PartialEq)]
pub struct Transport {
    camera: usize,
    projector: usize,
    /// Row by row: a row for each pixel of the camera.
    values: Vec<f32>,
}

impl Transport {
    /// Traces paths from `camera` and connects each of their surfaces with `projector`, both
    /// pinholes: one path serves all pixels of the projector. The scene's own lights are off.
    ///
    /// Luminance alone. The transpose is the swapped matrix only where surfaces are
    /// [double-sided](crate::scene::SceneMaterial::double_sided) or their backs unseen.
    ///
    /// # Errors
    /// When the matrix would be too large.
    pub fn trace(
        scene: &ReferenceScene,
        camera: &View,
        projector: &View,
        tracing: &Tracing,
    ) -> Result<Self, InverseError> {
        let [rows, columns] =
            [camera, projector].map(|view| u64::from(view.size.x) * u64::from(view.size.y));
        let entries = rows.saturating_mul(columns);
        if entries > MOST_ENTRIES {
            return Err(InverseError::TooLarge(entries));
        }
        let mut values = vec![0.0; entries as usize];
        let rows_of = values.par_chunks_mut((columns as usize).max(1)).enumerate();
        rows_of.for_each(|(pixel, row)| {
            let at = [pixel as u32 % camera.size.x, pixel as u32 / camera.size.x];
            for sample in 0..tracing.samples {
                let mut sampler = Sampler::new(tracing.seed, pixel as u64, sample);
                let ray = camera.sampled_ray(Pixels::Area, at, &mut sampler);
                let weight = solid_angle(camera, ray.1) / f64::from(tracing.samples);
                walk(scene, tracing, ray, weight, projector, &mut sampler, row);
            }
        });
        Ok(Self { camera: rows as usize, projector: columns as usize, values })
    }

    /// What one pixel of the camera, in range, gathers of each pixel of the projector.
    pub fn row(&self, pixel: usize) -> &[f32] {
        &self.values[pixel * self.projector..(pixel + 1) * self.projector]
    }

    /// The camera's image when the projector's pixels have these intensities, candela.
    ///
    /// # Errors
    /// When there are not as many intensities as pixels.
    pub fn image(&self, intensities: &[f64]) -> Result<Vec<f64>, InverseError> {
        same("intensities", intensities.len(), self.projector)?;
        let gathered = |pixel: usize| {
            self.row(pixel).iter().zip(intensities).map(|(t, light)| f64::from(*t) * light).sum()
        };
        Ok((0..self.camera).map(gathered).collect())
    }

    /// The image from the projector's place when the camera's pixels send light of these
    /// intensities, candela: the transposed product.
    ///
    /// # Errors
    /// When there are not as many intensities as pixels.
    pub fn dual(&self, intensities: &[f64]) -> Result<Vec<f64>, InverseError> {
        same("intensities", intensities.len(), self.camera)?;
        let mut image = vec![0.0; self.projector];
        for (pixel, light) in intensities.iter().enumerate() {
            for (sum, t) in image.iter_mut().zip(self.row(pixel)) {
                *sum += f64::from(*t) * light;
            }
        }
        Ok(image)
    }
}

fn same(what: &'static str, given: usize, expected: usize) -> Result<(), InverseError> {
    if given == expected { Ok(()) } else { Err(InverseError::Size { what, given, expected }) }
}

/// One path: adds to `row` what it brings from each pixel of the projector.
fn walk(
    scene: &ReferenceScene,
    tracing: &Tracing,
    (mut origin, mut direction): (Vec3, DVec3),
    weight: f64,
    projector: &View,
    sampler: &mut Sampler,
    row: &mut [f32],
) {
    let (mut throughput, half) = (DVec3::splat(weight), projector.half());
    for _ in 0..=tracing.bounces {
        let Some(hit) = scene.closest(origin, direction) else { break };
        let surface = Surface::new(&scene.geometry, &hit);
        let bsdf = Bsdf::new(&surface, -direction, tracing.shading);
        origin = surface.ray_origin();
        let to_light = projector.pose.position.as_dvec3() - surface.position;
        let distance = to_light.length();
        if let Some(pixel) = seen_by(projector, half, surface.position).filter(|_| distance > 0.0) {
            let towards = to_light / distance;
            let reflected = throughput * bsdf.evaluate(towards).0 / (distance * distance);
            let incident = IncidentLight { direction: towards, distance, illuminance: DVec3::ZERO };
            let light = luminance(reflected);
            if light > 0.0 && light.is_finite() && scene.is_lit(origin, &incident) {
                row[pixel] += light as f32;
            }
        }
        let Some(sampled) = bsdf.sample(sampler) else { break };
        throughput *= sampled.weight;
        direction = sampled.direction;
    }
}

/// Solid angle of a pixel of `view` in `direction`, steradian: its area on a plane at 1 metre × the
/// cube of the cosine.
fn solid_angle(view: &View, direction: DVec3) -> f64 {
    let half = view.half();
    let area = 4.0 * half.x * half.y / view.size.as_dvec2().element_product();
    area * view.pose.forward().as_dvec3().dot(direction).max(0.0).powi(3)
}

/// Which pixel of `view`, whose [half](View::half) is `half`, sees a point.
fn seen_by(view: &View, half: DVec2, point: DVec3) -> Option<usize> {
    let ray = point - view.pose.position.as_dvec3();
    let local = view.pose.rotation.as_dquat().inverse() * ray;
    let (ahead, size) = (-local.z, view.size.as_dvec2());
    let x = (local.x / (ahead * half.x) + 1.0) * 0.5 * size.x;
    let y = (1.0 - local.y / (ahead * half.y)) * 0.5 * size.y;
    // This form also rejects NaN.
    let is_seen = ahead > 0.0 && x >= 0.0 && y >= 0.0 && x < size.x && y < size.y;
    is_seen.then(|| y as usize * view.size.x as usize + x as usize)
}

#[cfg(test)]
mod source_tests;
#[cfg(test)]
mod tests;
