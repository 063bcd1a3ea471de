//! Henyey and Greenstein 1941, "Diffuse Radiation in the Galaxy": a phase function.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

/// Asymmetries nearer to 0 scatter evenly: the inverse of the distribution divides by them.
const LEAST_ASYMMETRY: f64 = 1e-4;

/// Share of light per steradian that turns by an angle of this `cosine`, with the mean cosine
/// `asymmetry` in (−1, 1). It is the density of [`sample`], per steradian.
pub(crate) fn density(asymmetry: f64, cosine: f64) -> f64 {
    let squared = asymmetry * asymmetry;
    let base = (1.0 + squared - 2.0 * asymmetry * cosine.clamp(-1.0, 1.0)).max(1e-12);
    (1.0 - squared) / (4.0 * PI * base * base.sqrt())
}

/// Samples the direction in which light that travels in `direction`, a unit vector, goes on.
pub(crate) fn sample(asymmetry: f64, direction: DVec3, [u1, u2]: [f64; 2]) -> DVec3 {
    let cosine = if asymmetry.abs() < LEAST_ASYMMETRY {
        1.0 - 2.0 * u1
    } else {
        let squared = asymmetry * asymmetry;
        let part = (1.0 - squared) / (1.0 + asymmetry - 2.0 * asymmetry * u1);
        ((1.0 + squared - part * part) / (2.0 * asymmetry)).clamp(-1.0, 1.0)
    };
    let (right, up) = direction.any_orthonormal_pair();
    let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
    let (across, along) = (u2 * TAU).sin_cos();
    (direction * cosine + right * (sine * along) + up * (sine * across)).normalize()
}
