//! Light by its time of arrival.
//!
//! Jarabo et al. 2014, "A Framework for Transient Rendering": every path of the steady image also
//! carries the travel time of its light, and so serves all frames. All lights flash once, at time
//! 0. Parallel light and the sky have no place: their time starts at the surface that they light.
//! Scattering takes no time, and air slows no light.
//!
//! | module | job |
//! |---|---|
//! | `film` | the image of each frame, in one call with the steady one; kernels in time |
//! | `output` | frames as layers of an OpenEXR file, as pictures and as an animation |
//! | `flight` | a time-of-flight camera: from phases to depth |
//! | `beams` | light in fog from beams; with the feature `media` |
//! | `photons` | caustics, from photons; with the feature `caustics` |
//! | `bounce` | what a time-of-flight camera can know of its multipath error |

#[cfg(feature = "media")]
mod beams;
mod bounce;
mod film;
mod flight;
mod output;
#[cfg(feature = "caustics")]
mod photons;

use glam::DVec3;

#[cfg(feature = "media")]
pub use beams::{Beams, beams, narrowing};
pub use bounce::without_bounce;
pub use film::{Frames, Spread, TimeError, Window, bandwidth, frames, kernel, progressive};
pub use flight::{Capture, capture, depth, phases, phasor, range};
pub use output::OutputError;
#[cfg(feature = "caustics")]
pub use photons::{Photons, caustics, shrinking};

/// Metres per second, in vacuum.
pub const SPEED_OF_LIGHT: f64 = 299_792_458.0;

/// A distance along a ray through fog at which light of a point is scattered to the ray's start, such
/// that the whole way, start → point on the ray → light, is uniform between two lengths: Jarabo et al.
/// 2014, section 5. Samples by transmittance leave late frames empty; these give each frame of a window
/// as many.
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

#[cfg(test)]
mod flight_tests;
#[cfg(all(test, feature = "media"))]
mod fog_tests;
#[cfg(all(test, feature = "caustics"))]
mod photon_tests;
#[cfg(test)]
mod tests;
