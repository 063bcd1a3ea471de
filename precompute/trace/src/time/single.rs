//! Distances and angles in fog that make arrivals uniform in time.
//!
//! Jarabo et al. 2014, "A Framework for Transient Rendering", section 5: samples by transmittance
//! leave late frames empty; these give each frame of a window as many.

use std::f64::consts::TAU;

use glam::DVec3;

/// A distance along a ray at which light of a point is scattered to the ray's start, such that the
/// whole way, start → point on the ray → light, is uniform between two lengths.
///
/// `light` is the point from the ray's start, metres; `direction` the ray's unit vector; `lengths`
/// from and to, metres, of the whole way. Gives the distance, metres, and its density, per metre;
/// `None` where no way has such a length, or where values are not finite. With x uniform in
/// `[0, 1)`.
pub fn sample_distance(
    light: DVec3,
    direction: DVec3,
    lengths: [f64; 2],
    x: f64,
) -> Option<(f64, f64)> {
    let straight = light.length();
    let from = lengths[0].max(straight);
    let span = lengths[1] - from;
    let along = light.dot(direction);
    let way = from + x * span;
    let distance = (way * way - straight * straight) / (2.0 * (way - along));
    let rest = (light - direction * distance).length();
    let density = (1.0 + (distance - along) / rest) / span;
    // Also rejects NaN, and the light on the ray, whose whole stretch before it has one length.
    (span > 0.0 && distance >= 0.0 && distance.is_finite() && density > 0.0 && density.is_finite())
        .then_some((distance, density))
}

/// A sampled angle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AngleSample {
    /// Cosine of the angle to the direction of the sensor, in [−1, 1].
    pub cosine: f64,
    /// Probability density, per steradian.
    pub density: f64,
}

/// An angle in which a step of `step` metres goes on, such that the rest of the way to a sensor
/// `sensor` metres away is uniform between its extremes; the azimuth is to be uniform. `None` where
/// either is not above 0 or not finite. With x uniform in `[0, 1)`.
///
/// The paper's density holds for steps that are at least as long as the way to the sensor; this
/// one, with the lesser of both, for all.
pub fn sample_angle(step: f64, sensor: f64, x: f64) -> Option<AngleSample> {
    let lesser = step.min(sensor);
    let rest = (step - sensor).abs() + 2.0 * lesser * x;
    let product = step * sensor;
    let cosine = (step * step + sensor * sensor - rest * rest) / (2.0 * product);
    // dθ density ÷ (2π sin θ): the sine cancels.
    let density = product / (2.0 * lesser * rest.max(f64::MIN_POSITIVE)) / TAU;
    (lesser > 0.0 && cosine.is_finite() && density.is_finite())
        .then(|| AngleSample { cosine: cosine.clamp(-1.0, 1.0), density })
}
