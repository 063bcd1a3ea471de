//! Spheres that send much light to a place, and sampling of directions to them.
//!
//! Light is stored by the place that it came from, not by its direction: every point of a cell aims
//! at the same sphere (parallax, as in Ruppert, Herholz and Lensch 2020, "Robust Fitting of
//! Parallax-Aware Mixtures for Path Guiding", whose lobes are smooth). Directions to a sphere are
//! uniform over its cone.

use std::f64::consts::TAU;

use glam::{DVec3, Vec3};

use super::Photon;
use super::cut::spheres;

/// Most spheres of a place.
const MOST_SPHERES: usize = 16;
/// Most branches per surface on average, so that a wrong guide costs a bounded time.
const GREATEST_SHARE: f64 = 0.8;
/// A striking sphere is so many times brighter than what BSDF sampling expects.
const CONTRAST: f64 = 10.0;
/// Part of a striking sphere's share that each place gives it, whatever its own photons show.
const SHARED: f32 = 0.5;
/// Least height of a cone's cap, 1 − cosine: a tenth of a degree.
const LEAST_HEIGHT: f64 = 1.5e-6;

/// Spheres that send much light to a place.
#[derive(Clone, Debug, Default)]
pub(crate) struct Sources {
    spheres: Vec<Sphere>,
}

/// The spheres as seen from a point.
#[derive(Clone, Debug)]
pub(crate) struct Cones {
    cones: Vec<Cone>,
    /// Branches per surface, on average.
    share: f64,
}

impl Sources {
    /// Learns from the `photons` of one place, whose order it changes; `None` where they show no
    /// more than BSDF sampling finds by itself.
    ///
    /// The few photons of a place may miss a small bright sphere that it sees, and paths that find
    /// it by chance are then rare and bright. So some branches aim at what is `striking`.
    pub(crate) fn learn(photons: &mut [Photon], striking: Option<&Self>) -> Option<Self> {
        let mut spheres = spheres(photons, 1.0);
        let shared = striking.iter().flat_map(|striking| &striking.spheres);
        spheres.extend(shared.map(|sphere| Sphere { share: sphere.share * SHARED, ..*sphere }));
        Self::new(spheres)
    }

    /// Small bright spheres alone, from the `photons` of all places of one orientation, whose order
    /// it changes.
    pub(crate) fn striking(photons: &mut [Photon]) -> Option<Self> {
        Self::new(spheres(photons, CONTRAST))
    }

    fn new(mut spheres: Vec<Sphere>) -> Option<Self> {
        spheres.sort_by(|a, b| b.share.total_cmp(&a.share));
        spheres.truncate(MOST_SPHERES);
        let share: f64 = spheres.iter().map(|sphere| f64::from(sphere.share)).sum();
        if share > GREATEST_SHARE {
            spheres.iter_mut().for_each(|sphere| sphere.share *= (GREATEST_SHARE / share) as f32);
        }
        (!spheres.is_empty()).then_some(Self { spheres })
    }

    /// The spheres as seen from `position`, metres; those around it are left out.
    pub(crate) fn seen_from(&self, position: DVec3) -> Cones {
        let cones: Vec<Cone> =
            self.spheres.iter().filter_map(|sphere| Cone::new(position, sphere)).collect();
        Cones { share: cones.iter().map(|cone| cone.share).sum(), cones }
    }
}

impl Cones {
    /// Branches per surface that [`sample`](Self::sample) should give a direction, on average; below 1.
    pub(crate) fn share(&self) -> f64 {
        self.share
    }

    /// A direction, of unit length. `choice` is in [0, share).
    pub(crate) fn sample(&self, mut choice: f64, pair: [f64; 2]) -> DVec3 {
        let cone = self.cones.iter().find(|cone| {
            choice -= cone.share;
            choice < 0.0
        });
        // Rounding may leave a little.
        let Some(cone) = cone.or(self.cones.last()) else { return DVec3::Y };
        around(cone.axis, 1.0 - (1.0 - cone.least_cosine) * pair[0], pair[1])
    }

    /// Share × density per steradian with which [`sample`](Self::sample) takes `direction`, a unit
    /// vector.
    pub(crate) fn density(&self, direction: DVec3) -> f64 {
        let inside = self.cones.iter().filter(|cone| cone.axis.dot(direction) >= cone.least_cosine);
        inside.map(|cone| cone.density).sum()
    }
}

/// The direction with a `cosine` to `axis`, `turn` turns around it.
pub(crate) fn around(axis: DVec3, cosine: f64, turn: f64) -> DVec3 {
    let (right, up) = axis.any_orthonormal_pair();
    let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
    let (across, along) = (turn * TAU).sin_cos();
    axis * cosine + right * (sine * along) + up * (sine * across)
}

/// A part of space from which much light comes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sphere {
    /// Metres.
    pub(super) center: Vec3,
    pub(super) radius: f32,
    /// Branches towards it per surface, on average.
    pub(super) share: f32,
}

/// The directions to a sphere from a point.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Cone {
    pub(super) axis: DVec3,
    pub(super) least_cosine: f64,
    /// Branches towards it per surface, on average.
    pub(super) share: f64,
    /// Share × density per steradian inside the cone.
    pub(super) density: f64,
}

impl Cone {
    /// `None` from inside the sphere.
    pub(super) fn new(position: DVec3, sphere: &Sphere) -> Option<Self> {
        let (radius, share) = (f64::from(sphere.radius), f64::from(sphere.share));
        let ray = sphere.center.as_dvec3() - position;
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
