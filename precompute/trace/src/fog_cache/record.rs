//! A record: light at one point of fog, and where it may be extrapolated.

use std::f64::consts::{PI, TAU};

use glam::{DMat3, DVec3};

use super::jet::{Jet, distance, eigen, form_factor};
use super::{CacheSettings, Shape};
use crate::bsdf::Surface;
use crate::color::luminance;
use crate::integrator::ReferenceScene;
use crate::sampler::Sampler;

/// Distance of what a ray misses, metres: only its direction matters, since it is dark.
const FAR: f64 = 1e4;

/// Mean radiance over all directions at a point, nits, and its derivatives.
#[derive(Clone, Debug)]
pub(crate) struct Record {
    pub(crate) position: DVec3,
    pub(crate) radiance: DVec3,
    /// Of red, green and blue, nits per metre.
    pub(crate) gradients: [DVec3; 3],
    /// Offsets from `position` of length 1 after this matrix are at the border of validity.
    pub(crate) metric: DMat3,
}

impl Record {
    /// Weight of the record at `point`, 0 outside its region; equation 2.23 of Marco's thesis.
    pub(crate) fn weight(&self, point: DVec3) -> f64 {
        let inside = (1.0 - (self.metric * (point - self.position)).length()).max(0.0);
        inside * inside * (3.0 - 2.0 * inside)
    }

    /// Radiance at `point` to first order, at least 0.
    pub(crate) fn at(&self, point: DVec3) -> DVec3 {
        let offset = point - self.position;
        let slopes = DVec3::from_array(self.gradients.map(|gradient| gradient.dot(offset)));
        (self.radiance + slopes).max(DVec3::ZERO)
    }
}

/// Mean radiance and its derivatives at `position`, from emissive surfaces that rays find: one ray
/// for each of `rings` × 2 `rings` equal solid angles. Where neighbouring rays end on different
/// surfaces the triangle between them is slanted, and its derivatives are those of visibility.
pub(crate) fn gather(
    scene: &ReferenceScene,
    extinction: DVec3,
    position: DVec3,
    rings: u32,
    sampler: &mut Sampler,
) -> (DVec3, [Jet; 3]) {
    let columns = 2 * rings;
    let hit = |direction: DVec3| -> (DVec3, DVec3) {
        let Some(hit) = scene.closest(position.as_vec3(), direction) else {
            return (direction * FAR, DVec3::ZERO);
        };
        let emission = Surface::new(&scene.geometry, &hit).emission;
        let emission = if emission.is_finite() { emission } else { DVec3::ZERO };
        (direction * f64::from(hit.distance), emission)
    };
    let mut ends = Vec::with_capacity((rings * columns) as usize);
    let mut radiance = DVec3::ZERO;
    for row in 0..rings {
        for column in 0..columns {
            let [u, v] = sampler.pair();
            let height = 1.0 - 2.0 * (f64::from(row) + u) / f64::from(rings);
            let (sin, cos) = (TAU * (f64::from(column) + v) / f64::from(columns)).sin_cos();
            let side = (1.0 - height * height).max(0.0).sqrt();
            let end = hit(DVec3::new(side * cos, height, -side * sin));
            radiance += end.1 * (-extinction * end.0.length()).exp();
            ends.push(end);
        }
    }
    let mut jets = [Jet::ZERO; 3];
    let mut add = |corners: [(DVec3, DVec3); 3]| {
        let mut farthest = corners[0];
        for corner in corners {
            if corner.0.length_squared() > farthest.0.length_squared() {
                farthest = corner;
            }
        }
        let (ray, emission) = farthest;
        if emission == DVec3::ZERO || ray == DVec3::ZERO {
            return;
        }
        let (factor, length) = (form_factor(corners.map(|corner| corner.0)), distance(ray));
        for channel in 0..3 {
            let light = Jet { value: emission[channel], ..Jet::ZERO };
            let own = factor.times(length.decay(extinction[channel])).times(light);
            jets[channel] = jets[channel].plus(own);
        }
    };
    let end = |row: u32, column: u32| ends[(row * columns + column % columns) as usize];
    for column in 0..columns {
        for row in 0..rings - 1 {
            let (a, b) = (end(row, column), end(row, column + 1));
            let (c, d) = (end(row + 1, column), end(row + 1, column + 1));
            add([a, c, b]);
            add([b, c, d]);
        }
        // The poles are closed by fans from their first rays.
        add([end(0, 0), end(0, column), end(0, column + 1)]);
        let last = rings - 1;
        add([end(last, 0), end(last, column + 1), end(last, column)]);
    }
    (radiance / f64::from(rings * columns), jets)
}

/// A record at `position`.
pub(crate) fn record(
    scene: &ReferenceScene,
    extinction: DVec3,
    position: DVec3,
    settings: &CacheSettings,
    sampler: &mut Sampler,
) -> Record {
    let (radiance, jets) = gather(scene, extinction, position, settings.rings, sampler);
    let weights = crate::color::LUMINANCE;
    let hessian =
        jets[0].hessian * weights.x + jets[1].hessian * weights.y + jets[2].hessian * weights.z;
    let (values, vectors) = eigen(hessian);
    let radii = radii(luminance(radiance), values, settings);
    let metric = DMat3::from_diagonal(radii.recip()) * vectors.transpose();
    let gradients = jets.map(|jet| jet.gradient);
    Record { position, radiance, gradients, metric }
}

/// Radii along the eigenvectors, metres: equation 2.22 of Marco's thesis, R⁵ = 10 L ε / (4π |λ|),
/// with the factor that an even Hessian integrates to (printed is 15).
pub(crate) fn radii(radiance: f64, values: DVec3, settings: &CacheSettings) -> DVec3 {
    let values = match settings.shape {
        Shape::Anisotropic => values.abs(),
        Shape::Isotropic => DVec3::splat(values.abs().max_element()),
    };
    let [least, most] = settings.radii;
    if radiance <= 0.0 {
        // In full shadow no triangle is lit: derivatives are 0 and do not see its border.
        return DVec3::splat(least);
    }
    DVec3::from_array(values.to_array().map(|value| {
        let fifth = 10.0 * radiance * settings.tolerance / (4.0 * PI * value);
        if value > 0.0 && fifth.is_finite() { fifth.powf(0.2).clamp(least, most) } else { most }
    }))
}
