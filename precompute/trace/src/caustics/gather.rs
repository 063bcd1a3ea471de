//! Diffuse surfaces that the camera sees, directly or by mirrors, and light that photons bring them,
//! within radii that shrink with the number of photons.

use std::f64::consts::PI;

use glam::{DVec3, Vec3};

use super::map::{Photon, PhotonMap};
use super::{Density, Reflector, Split};
use crate::color::luminance;
use crate::integrator::path::GREATEST_SURVIVAL;
#[cfg(feature = "time")]
use crate::integrator::path::{Arrival, Record};
use crate::sampler::Sampler;

/// Greatest ratio of a photon's cosines to shading and to geometric normal.
const GREATEST_RATIO: f64 = 4.0;
/// Radius of the estimate of curvature, in radii of the first pass: second derivatives are noisier
/// than values.
const PILOT: f64 = 2.0;
/// Greatest and least adaptive radius, in radii of the first pass.
const GREATEST: f64 = 1.5;
const LEAST: f64 = 0.05;

/// A point where photons are gathered.
pub(super) struct Point<'a> {
    at: Reflector<'a>,
    /// What of its light reaches the camera.
    throughput: DVec3,
    /// Most surfaces that may have reflected a photon.
    most: u32,
    /// Metres along the camera ray to it, and to the first surface.
    #[cfg_attr(not(feature = "time"), expect(dead_code, reason = "light in time alone asks"))]
    lengths: [f64; 2],
}

/// The light of photons near a point.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Gathered {
    /// Radiance along the camera ray × number of photons that left lights, nits.
    pub(super) radiance: DVec3,
    /// Radius, metres.
    radius: f64,
    /// Mean of squared luminance of contributions, per area: Σγ² / (π r²).
    squares: f64,
}

impl<'a> Split<'a> {
    /// Every diffuse surface along a camera ray that specular parts reflect.
    pub(super) fn points(
        &self,
        (mut origin, mut direction): (Vec3, DVec3),
        sampler: &mut Sampler,
    ) -> Vec<Point<'a>> {
        let (mut found, mut throughput) = (Vec::new(), DVec3::ONE);
        let mut lengths = [0.0; 2];
        for surfaces in 0.. {
            if self.settings.bounces.is_some_and(|bounces| surfaces > bounces) {
                break;
            }
            let Some(at) = self.closest(origin, direction) else { break };
            lengths[0] += f64::from(at.hit.distance);
            if surfaces == 0 {
                lengths[1] = lengths[0];
            }
            let next = at.is_specular.then(|| {
                let next = at.bsdf.sample(sampler)?.direction;
                let lobes = at.lobes(next)?;
                let weight = lobes.specular * (lobes.cosine / lobes.density);
                let survival = luminance(weight).min(GREATEST_SURVIVAL);
                (sampler.number() < survival).then(|| (weight / survival, next))
            });
            origin = at.surface.ray_origin();
            if !at.is_mirror() {
                let most = self.settings.bounces.map_or(u32::MAX, |bounces| bounces - surfaces);
                found.push(Point { at, throughput, most, lengths });
            }
            let Some((weight, next)) = next.flatten() else { break };
            throughput *= weight;
            direction = next;
        }
        found
    }
}

impl Point<'_> {
    /// Gathers the nearest `count` photons within `reach`, metres. The farthest one gives the radius
    /// and is not counted: with it, the mean would be `count` ÷ (`count` − 1) too high.
    pub(super) fn nearest(&self, map: &PhotonMap, count: u32, reach: f64) -> Gathered {
        let count = count.max(2) as usize;
        let mut near = map.nearest(self.place(), self.normal(), count, reach as f32);
        let mut gathered = Gathered { radius: reach, ..Gathered::default() };
        if near.len() == count {
            gathered.radius = near.pop().map_or(reach, |(squared, _)| f64::from(squared).sqrt());
        }
        near.iter().for_each(|(_, photon)| gathered.add(self.light(photon)));
        gathered.per_area()
    }

    /// Gathers all photons within `radius`, metres, and calls `each` with the squared distance of
    /// each in radii and its luminance.
    fn within(&self, map: &PhotonMap, radius: f64, mut each: impl FnMut(f64, f64)) -> Gathered {
        let mut gathered = Gathered { radius, ..Gathered::default() };
        map.within(self.place(), self.normal(), radius as f32, |squared, photon| {
            let light = self.light(photon);
            gathered.add(light);
            each(f64::from(squared) / (radius * radius), luminance(light));
        });
        gathered.per_area()
    }

    /// The light of photons within `radius`, metres, of `count` that left lights, nits; `record` is told
    /// of each.
    #[cfg(feature = "time")]
    pub(super) fn arrivals(
        &self,
        map: &PhotonMap,
        [radius, count]: [f64; 2],
        record: &mut impl Record,
    ) -> DVec3 {
        let (share, mut sum) = ((PI * radius * radius * count).recip(), DVec3::ZERO);
        map.within(self.place(), self.normal(), radius as f32, |_, photon| {
            let light = self.light(photon) * share;
            sum += light;
            record.arrived(Arrival {
                light,
                surfaces: photon.surfaces + 1,
                length: photon.length + self.lengths[0],
                last: self.lengths[1],
                odds: 1.0,
            });
        });
        sum
    }

    fn place(&self) -> Vec3 {
        self.at.surface.position.as_vec3()
    }

    fn normal(&self) -> Vec3 {
        self.at.surface.geometric_normal.as_vec3()
    }

    /// What a photon adds, nits · m².
    fn light(&self, photon: &Photon) -> DVec3 {
        if photon.surfaces > self.most {
            return DVec3::ZERO;
        }
        let direction = photon.direction.as_dvec3();
        let Some(lobes) = self.at.lobes(direction) else { return DVec3::ZERO };
        // Photons already are fewer by the geometric normal's cosine.
        let ratio = lobes.cosine / direction.dot(self.at.surface.geometric_normal);
        let reflected = self.throughput * lobes.diffuse * ratio.min(GREATEST_RATIO);
        reflected * photon.power.as_dvec3()
    }
}

impl Gathered {
    fn add(&mut self, light: DVec3) {
        self.radiance += light;
        self.squares += luminance(light).powi(2);
    }

    fn per_area(mut self) -> Self {
        let area = PI * self.radius * self.radius;
        let scale = if area > 0.0 && area.is_finite() { area.recip() } else { 0.0 };
        // Photons at one point have no density.
        let scale = if scale.is_finite() { scale } else { 0.0 };
        self.radiance *= scale;
        self.squares *= scale;
        self
    }
}

/// A pixel's radius and sums.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Progress {
    /// Sum of the passes, nits.
    sum: DVec3,
    passes: u32,
    /// Radius of the first pass, metres, and of the next one; 0 before the first.
    first: f64,
    radius: f64,
    /// Sums of squared contributions per area and of the Laplacian.
    squares: f64,
    laplacian: f64,
}

impl Progress {
    /// Adds one pass: the light of `points`, from a map of `count` photons that left lights.
    pub(super) fn add(
        &mut self,
        density: Density,
        map: &PhotonMap,
        count: f64,
        points: &[Point],
        reach: f64,
    ) {
        self.passes += 1;
        let first = match density {
            Density::Nearest { count: nearest } => {
                for point in points {
                    self.sum += point.nearest(map, nearest, reach).radiance / count;
                }
                return;
            }
            Density::Adaptive { first, .. } => first,
        };
        if self.first == 0.0 {
            let Some(point) = points.first() else { return };
            self.first = point.nearest(map, first, reach).radius;
            self.radius = self.first;
        }
        let passes = f64::from(self.passes);
        // The best radius of the pilot falls with the tenth root of the photons.
        let pilot = self.first * PILOT * passes.powf(-0.1);
        for point in points {
            self.sum += point.within(map, self.radius, |_, _| ()).radiance / count;
            let mut laplacian = 0.0;
            let near = point.within(map, pilot, |s, light| {
                // Of the kernel 4/(π h²) (1 − s)³, with s = distance²/h².
                laplacian += 48.0 * (1.0 - s) * (3.0 * s - 1.0) * light;
            });
            self.squares += near.squares / count;
            self.laplacian += laplacian / (PI * pilot.powi(4) * count);
        }
        let (squares, laplacian) = (self.squares / passes, self.laplacian / passes);
        self.radius = balanced(squares, laplacian, count, passes + 1.0)
            .clamp(self.first * LEAST, self.first * GREATEST);
    }

    /// The mean of the passes, nits.
    pub(super) fn mean(&self) -> DVec3 {
        self.sum / f64::from(self.passes.max(1))
    }
}

/// The radius of pass number `pass`, of `count` photons each, that makes the error of the mean of
/// all passes least.
///
/// With a constant kernel a pass has the variance `squares` / (π r² count) and the bias r² Δ / 8.
/// Of the mean over n passes with r ∝ n^(−1/6), these are 3/4 and 3/2 of what n passes with the last
/// radius would have: error² = 3/4 A/r² + 9/4 B r⁴ is least at r⁶ = A/(6 B).
fn balanced(squares: f64, laplacian: f64, count: f64, pass: f64) -> f64 {
    let noise = squares / (PI * count * pass);
    let blur = (laplacian / 8.0).powi(2);
    let radius = (noise / (6.0 * blur)).powf(1.0 / 6.0);
    // No photons, or no curvature.
    if radius.is_nan() { f64::INFINITY } else { radius }
}
