//! Participating media: homogeneous fog in a box.
//!
//! Radiance, units and lights are those of the rest of the crate; a medium's coefficients are per
//! metre. `line` samples distances along a ray through fog.

mod line;

use std::f64::consts::PI;

use glam::DVec3;
use thiserror::Error;

use crate::color::color;
use crate::guide::around;
use crate::scene::Bounds;
pub(crate) use line::{CHANNELS, Equiangular, Line};

/// Greatest magnitude of the asymmetry: beyond it the phase function is a spike that no sampling
/// of lights finds.
const GREATEST_ASYMMETRY: f32 = 0.99;
/// Asymmetries nearer to 0 scatter evenly: the inverse of the distribution divides by them.
const LEAST_ASYMMETRY: f64 = 1e-4;

/// Fog: a medium with the same coefficients everywhere within a box, and vacuum around it. Its
/// refractive index is that of vacuum, and it emits nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fog {
    /// Share of light that is absorbed per metre, linear RGB, 1/m, each at least 0.
    pub absorption: [f32; 3],
    /// Share of light that is scattered per metre, linear RGB, 1/m, each at least 0.
    pub scattering: [f32; 3],
    /// Mean cosine of the angle by which scattered light turns, in [−0.99, 0.99]: 0 scatters evenly,
    /// about 0.8 is mist, below 0 it scatters back.
    pub asymmetry: f32,
    /// Where the fog is, metres. Fog around the whole scene absorbs sun and sky on their way in:
    /// the box says how long that way is.
    pub bounds: Bounds,
}

/// Why a [`Fog`] is invalid.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum FogError {
    /// A coefficient is negative or not finite.
    #[error("fog coefficients are numbers from 0, per metre, not {0}")]
    Coefficient(f32),
    /// The asymmetry is out of range.
    #[error("the asymmetry of fog is in [-0.99, 0.99], not {0}")]
    Asymmetry(f32),
    /// The box is not finite, or its corners are in the wrong order.
    #[error("the bounds of fog are finite, and the least corner is not above the greatest")]
    Bounds,
}

impl Fog {
    /// Checks all values.
    ///
    /// # Errors
    /// The first value that is out of range.
    pub fn validate(&self) -> Result<(), FogError> {
        for coefficient in self.absorption.into_iter().chain(self.scattering) {
            // This form also rejects NaN.
            if !(coefficient >= 0.0 && coefficient.is_finite()) {
                return Err(FogError::Coefficient(coefficient));
            }
        }
        if self.asymmetry.is_nan() || self.asymmetry.abs() > GREATEST_ASYMMETRY {
            return Err(FogError::Asymmetry(self.asymmetry));
        }
        let Bounds { min, max } = self.bounds;
        let valid = min.is_finite() && max.is_finite() && min.cmple(max).all();
        if valid { Ok(()) } else { Err(FogError::Bounds) }
    }

    /// Whether all coefficients are 0.
    pub fn is_empty(&self) -> bool {
        self.extinction() == DVec3::ZERO
    }

    /// Absorption + scattering, 1/m.
    pub(crate) fn extinction(&self) -> DVec3 {
        color(self.absorption) + self.scattering()
    }

    /// 1/m.
    pub(crate) fn scattering(&self) -> DVec3 {
        color(self.scattering)
    }

    pub(crate) fn asymmetry(&self) -> f64 {
        f64::from(self.asymmetry)
    }

    /// The part of a ray that is in fog: a ray from `origin` in `direction`, a unit vector, up to
    /// `reach`, metres, which may be infinite. `None` where it is nowhere in fog.
    pub(crate) fn line(&self, origin: DVec3, direction: DVec3, reach: f64) -> Option<Line> {
        let inverse = direction.recip();
        let (min, max) = (self.bounds.min.as_dvec3(), self.bounds.max.as_dvec3());
        let (mut near, mut far) = (0.0_f64, reach);
        for axis in 0..3 {
            if direction[axis] == 0.0 {
                if origin[axis] < min[axis] || origin[axis] > max[axis] {
                    return None;
                }
                continue;
            }
            let one = (min[axis] - origin[axis]) * inverse[axis];
            let other = (max[axis] - origin[axis]) * inverse[axis];
            near = near.max(one.min(other));
            far = far.min(one.max(other));
        }
        (near < far && far.is_finite()).then(|| Line {
            origin,
            direction,
            near,
            far,
            extinction: self.extinction(),
            scatters: self.scattering() != DVec3::ZERO,
            channels: CHANNELS,
        })
    }

    /// Share of light, linear RGB, that gets from one end of a ray to the other; arguments as for
    /// [`line`](Self::line).
    pub(crate) fn transmittance(&self, origin: DVec3, direction: DVec3, reach: f64) -> DVec3 {
        let through = |line: Line| line.transmittance(line.far);
        self.line(origin, direction, reach).map_or(DVec3::ONE, through)
    }
}

/// Share of light per steradian that turns by an angle of this `cosine`, with the mean cosine
/// `asymmetry` in (−1, 1): Henyey and Greenstein 1941, "Diffuse Radiation in the Galaxy". It is the
/// density of [`sample`], per steradian.
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
    around(direction, cosine, u2).normalize()
}

#[cfg(test)]
mod tests;
