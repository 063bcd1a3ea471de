//! Photons, spheres around their sources, and cones of directions to spheres.

use std::f64::consts::TAU;

use glam::{DVec3, Vec3};

/// Least height of a cone's cap, 1 − cosine: a tenth of a degree.
const LEAST_HEIGHT: f64 = 1.5e-6;

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
    pub(super) fn new(position: DVec3, center: DVec3, radius: f64, share: f64) -> Option<Self> {
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
