//! A record: light at one point of fog, and where it may be extrapolated.

use std::f64::consts::{PI, TAU};

use glam::{DMat3, DVec3};

use super::jet::{Jet, distance, eigen, form_factor};
use super::{CacheSettings, Shape};
use crate::bsdf::Surface;
use crate::color::luminance;
use crate::integrator::ReferenceScene;
use crate::integrator::path::{emitter, per_steradian};
use crate::light::Sampled;
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
///
/// Radiance is also sampled at points of lights, combined by Veach and Guibas 1995: noise of a
/// record is an error of the whole region in which it is used.
pub(crate) fn gather(
    scene: &ReferenceScene,
    extinction: DVec3,
    position: DVec3,
    rings: u32,
    [seed, number]: [u64; 2],
) -> (DVec3, [Jet; 3]) {
    let columns = 2 * rings;
    let count = rings * columns;
    let samples = count / 2;
    // Solid angle of a sample: 1 ÷ the expected number per steradian, of both techniques.
    let share =
        |density: f64| (f64::from(count) / (4.0 * PI) + f64::from(samples) * density).recip();
    let through = |distance: f64| (-extinction * distance).exp();
    let (mut light, mut shares) = (DVec3::ZERO, 0.0);
    for sample in 0..samples {
        let mut sampler = Sampler::new(!seed, number, sample);
        let Some(sampled) = emitter(scene, position, &mut sampler) else { continue };
        let Sampled { direction, distance, radiance, density, .. } = sampled;
        if radiance.is_finite() && scene.is_unoccluded(position.as_vec3(), direction, distance) {
            light += radiance * through(distance) * share(density);
            shares += share(density);
        }
    }
    let mut hit = |direction: DVec3| -> (DVec3, DVec3) {
        let Some(hit) = scene.closest(position.as_vec3(), direction) else {
            shares += share(0.0);
            return (direction * FAR, DVec3::ZERO);
        };
        let (surface, distance) = (Surface::new(&scene.geometry, &hit), f64::from(hit.distance));
        let ray = direction * distance;
        let emission = if surface.emission.is_finite() { surface.emission } else { DVec3::ZERO };
        let own = scene.emitters.density(&hit);
        let own = share(per_steradian(own, ray, surface.geometric_normal));
        light += emission * through(distance) * own;
        shares += own;
        (ray, emission)
    };
    let mut sampler = Sampler::new(seed, number, 0);
    let mut ends = Vec::with_capacity(count as usize);
    for row in 0..rings {
        for column in 0..columns {
            let [u, v] = sampler.pair();
            let height = 1.0 - 2.0 * (f64::from(row) + u) / f64::from(rings);
            let (sin, cos) = (TAU * (f64::from(column) + v) / f64::from(columns)).sin_cos();
            let side = (1.0 - height * height).max(0.0).sqrt();
            ends.push(hit(DVec3::new(side * cos, height, -side * sin)));
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
    // Shares sum to 4π in the mean; by their own sum, even light is exact.
    (light / shares, jets)
}

/// A record at `position`.
pub(crate) fn record(
    scene: &ReferenceScene,
    extinction: DVec3,
    position: DVec3,
    settings: &CacheSettings,
    number: u64,
) -> Record {
    let (radiance, jets) =
        gather(scene, extinction, position, settings.rings, [settings.seed, number]);
    let weights = crate::color::LUMINANCE;
    let hessian =
        jets[0].hessian * weights.x + jets[1].hessian * weights.y + jets[2].hessian * weights.z;
    let (values, vectors) = eigen(hessian);
    // The triangles' light, not the samples': where samples alone find light its Hessian is 0, and
    // the record would darken all around it.
    let value = DVec3::from_array(jets.map(|jet| jet.value));
    let radii = radii(luminance(value), values, settings);
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
