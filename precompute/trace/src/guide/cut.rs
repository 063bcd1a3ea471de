//! Cuts the sources of a place's photons into spheres.

use glam::DVec3;

use super::Photon;
use super::sources::{Cone, Sphere};
use crate::scene::Bounds;

/// Photons that a sphere needs.
const LEAST_PHOTONS: usize = 4;
/// Greatest depth of splits.
const GREATEST_DEPTH: u32 = 40;
/// Spheres with a smaller share are left out.
const LEAST_SHARE: f64 = 0.01;
/// Standard errors by which a sphere must be brighter than what BSDF sampling expects: a branch that
/// chance suggests costs time and no noise.
const MARGIN: f64 = 1.0;
/// Parts of a sphere must cover this part of its power.
const COVERED: f64 = 0.9;

/// Spheres that are `contrast` times as bright as BSDF sampling expects.
pub(super) fn spheres(photons: &mut [Photon], contrast: f64) -> Vec<Sphere> {
    let total: f64 = photons.iter().map(|photon| f64::from(photon.power)).sum();
    let (mut place, mut normal) = (DVec3::ZERO, DVec3::ZERO);
    for photon in photons.iter() {
        place += photon.position.as_dvec3() / photons.len() as f64;
        normal += photon.normal.as_dvec3();
    }
    let normal = normal.normalize_or_zero();
    let mut cut = Cut { place, normal, total, contrast, spheres: Vec::new() };
    cut.grow(photons, 0);
    cut.spheres
}

/// The spheres found so far, of those that a place sees.
struct Cut {
    place: DVec3,
    normal: DVec3,
    /// Power of all photons.
    total: f64,
    /// Least brightness of a sphere, as a multiple of what BSDF sampling expects.
    contrast: f64,
    spheres: Vec<Sphere>,
}

impl Cut {
    /// Covers the sources of `photons` by one sphere or by those of two parts of them,
    /// whichever tells more about where light comes from. Returns how much: the divergence from
    /// BSDF sampling (Kullback and Leibler 1951), and the power that its spheres cover.
    ///
    /// Parts must cover nearly all that one sphere does: paths that find the rest are rare and
    /// bright.
    fn grow(&mut self, photons: &mut [Photon], depth: u32) -> (f64, f64) {
        let own = self.sphere(photons);
        let first = self.spheres.len();
        let splits = photons.len() >= 2 * LEAST_PHOTONS && depth < GREATEST_DEPTH;
        if let Some(count) = if splits { split(photons) } else { None } {
            let (low, high) = photons.split_at_mut(count);
            let (low, high) = (self.grow(low, depth + 1), self.grow(high, depth + 1));
            let parts = (low.0 + high.0, low.1 + high.1);
            let better =
                |(_, gain, power): (Sphere, f64, f64)| parts.0 > gain && parts.1 > COVERED * power;
            if own.is_none_or(better) {
                return parts;
            }
        }
        self.spheres.truncate(first);
        let Some((sphere, gain, power)) = own else { return (0.0, 0.0) };
        self.spheres.push(sphere);
        (gain, power)
    }

    /// A sphere around the sources of `photons`, and what it tells and covers; `None` where it is not
    /// brighter than what BSDF sampling expects.
    fn sphere(&self, photons: &[Photon]) -> Option<(Sphere, f64, f64)> {
        if photons.len() < LEAST_PHOTONS {
            return None;
        }
        let bounds = Bounds::around(photons.iter().map(|photon| photon.source))?;
        let (mut sum, mut squares) = (0.0, 0.0);
        for photon in photons {
            sum += f64::from(photon.power);
            squares += f64::from(photon.power).powi(2);
        }
        // Few points do not reach the ends of the range that they are drawn from.
        let count = photons.len() as f64;
        let radius = 0.5 * bounds.size().length() * ((count + 1.0) / (count - 1.0)) as f32;
        let sphere = Sphere { center: bounds.center(), radius, share: 0.0 };
        let cone = Cone::new(self.place, &sphere)?;
        // What a Lambertian surface would send there.
        let expected = 2.0 * (1.0 - cone.least_cosine) * cone.axis.dot(self.normal).max(0.05);
        let certain = 1.0 - MARGIN * squares.sqrt() / sum;
        let share = sum / self.total * certain;
        (share > self.contrast * expected && share - expected >= LEAST_SHARE).then(|| {
            let sphere = Sphere { share: (share - expected) as f32, ..sphere };
            (sphere, share * (share / expected).ln(), sum)
        })
    }
}

/// Sorts `photons` so that the first ones and the others are each as close together as can be, and
/// returns how many come first: least sum of power × length, as a part of the whole, over the three
/// axes. Small bright sources stay whole. `None` where all sources are one point.
fn split(photons: &mut [Photon]) -> Option<usize> {
    let total: f64 = photons.iter().map(|photon| f64::from(photon.power)).sum();
    let mut best = (1.0, 0, 0);
    for axis in 0..3 {
        photons.sort_unstable_by(|a, b| a.source[axis].total_cmp(&b.source[axis]));
        let at = |i: usize| f64::from(photons[i].source[axis]);
        let (first, last) = (at(0), at(photons.len() - 1));
        let mut low = 0.0;
        for i in 1..photons.len() {
            low += f64::from(photons[i - 1].power);
            let cost = low * (at(i - 1) - first) + (total - low) * (last - at(i));
            // This form also rejects NaN.
            let cost = cost / (total * (last - first));
            if at(i - 1) < at(i) && cost < best.0 {
                best = (cost, axis, i);
            }
        }
    }
    let (_, axis, count) = best;
    photons.sort_unstable_by(|a, b| a.source[axis].total_cmp(&b.source[axis]));
    (count > 0).then_some(count)
}
