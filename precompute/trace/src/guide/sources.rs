//! Spheres that send much light to a place, and sampling of directions to them.
//!
//! Light is stored by the place that it came from, not by its direction: every point of a cell aims
//! at the same sphere (parallax, as in Ruppert, Herholz and Lensch 2020, "Robust Fitting of
//! Parallax-Aware Mixtures for Path Guiding", whose lobes are smooth). Directions to a sphere are
//! uniform over its cone.

use std::f64::consts::TAU;

use glam::{DVec3, Vec3};

/// Most spheres of a place.
pub(super) const MOST_SPHERES: usize = 16;
/// Photons that a sphere needs.
const LEAST_PHOTONS: usize = 4;
/// Least height of a cone's cap, 1 − cosine: a tenth of a degree.
const LEAST_HEIGHT: f64 = 1.5e-6;
/// Greatest depth of splits.
const GREATEST_DEPTH: u32 = 40;
/// Spheres with a smaller share of the samples are left out.
const LEAST_SHARE: f64 = 0.01;
/// Least share of guided samples that is worth its time.
const LEAST_GUIDED: f64 = 0.05;
/// Greatest share of guided samples, so that a wrong guide costs a bounded factor.
const GREATEST_SHARE: f64 = 0.8;
/// Standard errors by which a sphere must be brighter than what BSDF sampling expects.
const MARGIN: f64 = 3.0;
/// Parts of a sphere must cover this part of its power.
const COVERED: f64 = 0.9;
/// A striking sphere is so many times brighter than what BSDF sampling expects.
const CONTRAST: f64 = 10.0;
/// Part of a striking sphere's share that each place gives it, whatever its own photons show.
const SHARED: f32 = 0.5;

/// Light that arrived at a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Photon {
    /// Metres.
    pub(crate) position: Vec3,
    /// Normal of the surface on the side of the light, unit length.
    pub(crate) normal: Vec3,
    /// Where the light came from, metres.
    pub(crate) source: Vec3,
    /// Luminance of its power, in a unit that is the same for all; above 0.
    pub(crate) power: f32,
}

/// Spheres that send much light to a place.
#[derive(Clone, Debug, Default)]
pub(crate) struct Sources {
    spheres: Vec<Sphere>,
}

#[derive(Clone, Copy, Debug)]
struct Sphere {
    /// Metres.
    center: Vec3,
    radius: f32,
    /// Share of samples.
    share: f32,
}

/// The spheres as seen from a point.
#[derive(Clone, Debug)]
pub(crate) struct Cones {
    cones: [Cone; MOST_SPHERES],
    count: usize,
    /// Share of samples that are guided.
    share: f64,
}

#[derive(Clone, Copy, Debug, Default)]
struct Cone {
    axis: DVec3,
    least_cosine: f64,
    /// Share of all samples.
    share: f64,
    /// Share × density per steradian inside the cone.
    density: f64,
}

impl Sources {
    /// Learns from the `photons` of one place, whose order it changes; `None` where they show no
    /// more than BSDF sampling finds by itself.
    ///
    /// The few photons of a place may miss a small bright sphere that it sees, and paths that find
    /// it by chance are then rare and bright. So a part of the samples aims at what is `striking`.
    pub(crate) fn learn(photons: &mut [Photon], striking: Option<&Self>) -> Option<Self> {
        let mut spheres = Self::spheres(photons, 1.0);
        let shared = striking.iter().flat_map(|striking| &striking.spheres);
        spheres.extend(shared.map(|sphere| Sphere { share: sphere.share * SHARED, ..*sphere }));
        Self::new(spheres)
    }

    /// Small bright spheres alone, from the `photons` of all places of one orientation, whose order
    /// it changes.
    pub(crate) fn striking(photons: &mut [Photon]) -> Option<Self> {
        Self::new(Self::spheres(photons, CONTRAST))
    }

    /// Spheres that are `contrast` times as bright as BSDF sampling expects.
    fn spheres(photons: &mut [Photon], contrast: f64) -> Vec<Sphere> {
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

    fn new(mut spheres: Vec<Sphere>) -> Option<Self> {
        spheres.sort_by(|a, b| b.share.total_cmp(&a.share));
        spheres.truncate(MOST_SPHERES);
        let share: f64 = spheres.iter().map(|sphere| f64::from(sphere.share)).sum();
        if share > GREATEST_SHARE {
            spheres.iter_mut().for_each(|sphere| sphere.share *= (GREATEST_SHARE / share) as f32);
        }
        (share >= LEAST_GUIDED).then_some(Self { spheres })
    }

    /// The spheres as seen from `position`, metres; those around it are left out.
    pub(crate) fn seen_from(&self, position: DVec3) -> Cones {
        let mut cones = Cones { cones: [Cone::default(); MOST_SPHERES], count: 0, share: 0.0 };
        for sphere in &self.spheres {
            let cone = Cone::new(
                position,
                sphere.center.as_dvec3(),
                f64::from(sphere.radius),
                f64::from(sphere.share),
            );
            if let Some(cone) = cone {
                cones.cones[cones.count] = cone;
                cones.count += 1;
                cones.share += cone.share;
            }
        }
        cones
    }
}

impl Cones {
    /// Share of samples that [`sample`](Self::sample) should take, below 1.
    pub(crate) fn share(&self) -> f64 {
        self.share
    }

    /// A direction, of unit length. `choice` is in [0, share).
    pub(crate) fn sample(&self, mut choice: f64, pair: [f64; 2]) -> DVec3 {
        let cones = &self.cones[..self.count];
        let cone = cones.iter().find(|cone| {
            choice -= cone.share;
            choice < 0.0
        });
        // Rounding may leave a little.
        let Some(cone) = cone.or(cones.last()) else { return DVec3::Y };
        around(cone.axis, 1.0 - (1.0 - cone.least_cosine) * pair[0], pair[1])
    }

    /// Share × density per steradian with which [`sample`](Self::sample) takes `direction`, a unit
    /// vector.
    pub(crate) fn density(&self, direction: DVec3) -> f64 {
        let cones = &self.cones[..self.count];
        let inside = cones.iter().filter(|cone| cone.axis.dot(direction) >= cone.least_cosine);
        inside.map(|cone| cone.density).sum()
    }
}

impl Cone {
    /// `None` from inside the sphere.
    fn new(position: DVec3, center: DVec3, radius: f64, share: f64) -> Option<Self> {
        let ray = center - position;
        let squared = ray.length_squared();
        let sine_squared = radius * radius / squared;
        // This form also rejects NaN.
        let outside = sine_squared < 0.9 && squared < f64::INFINITY;
        if !outside {
            return None;
        }
        // 1 − cosine, without cancellation.
        let height = sine_squared / (1.0 + (1.0 - sine_squared).sqrt());
        let height = height.max(LEAST_HEIGHT);
        Some(Self {
            axis: ray / squared.sqrt(),
            least_cosine: 1.0 - height,
            share,
            density: share / (TAU * height),
        })
    }
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
        let (min, max) = bounds(photons);
        let own = self.sphere(photons, min, max);
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

    /// A sphere around the sources of `photons`, which lie between `min` and `max`, and what it
    /// tells and covers; `None` where it is not brighter than what BSDF sampling expects.
    fn sphere(&self, photons: &[Photon], min: Vec3, max: Vec3) -> Option<(Sphere, f64, f64)> {
        if photons.len() < LEAST_PHOTONS {
            return None;
        }
        let (mut sum, mut squares) = (0.0, 0.0);
        for photon in photons {
            sum += f64::from(photon.power);
            squares += f64::from(photon.power).powi(2);
        }
        // Few points do not reach the ends of the range that they are drawn from.
        let count = photons.len() as f64;
        let radius = 0.5 * (max - min).length() * ((count + 1.0) / (count - 1.0)) as f32;
        let center = 0.5 * min + 0.5 * max;
        let cone = Cone::new(self.place, center.as_dvec3(), f64::from(radius), 0.0)?;
        // What a Lambertian surface would send there.
        let expected = 2.0 * (1.0 - cone.least_cosine) * cone.axis.dot(self.normal).max(0.05);
        let certain = 1.0 - MARGIN * squares.sqrt() / sum;
        let share = sum / self.total * certain;
        (share > self.contrast * expected && share - expected >= LEAST_SHARE).then(|| {
            let sphere = Sphere { center, radius, share: (share - expected) as f32 };
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

fn bounds(photons: &[Photon]) -> (Vec3, Vec3) {
    photons.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(min, max), photon| {
        (min.min(photon.source), max.max(photon.source))
    })
}

/// The direction with a `cosine` to `axis`, `turn` turns around it.
pub(crate) fn around(axis: DVec3, cosine: f64, turn: f64) -> DVec3 {
    let (right, up) = axis.any_orthonormal_pair();
    let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
    let (across, along) = (turn * TAU).sin_cos();
    axis * cosine + right * (sine * along) + up * (sine * across)
}

/// Moves photons that `is_first` before the others, and returns their number.
pub(super) fn partition(photons: &mut [Photon], is_first: impl Fn(&Photon) -> bool) -> usize {
    let mut count = 0;
    for i in 0..photons.len() {
        if is_first(&photons[i]) {
            photons.swap(i, count);
            count += 1;
        }
    }
    count
}
