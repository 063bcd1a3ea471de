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
//! | `bounce` | what a time-of-flight camera can know of its multipath error |
//! | `single` | distances and angles in fog that are uniform in time |

#[cfg(feature = "media")]
mod beams;
mod bounce;
mod film;
mod flight;
mod output;
mod single;

#[cfg(feature = "media")]
pub use beams::{Beams, beams, narrowing};
pub use bounce::without_bounce;
pub use film::{Frames, Spread, TimeError, Window, bandwidth, frames, kernel, progressive};
pub use flight::{Capture, capture, depth, phases, phasor, range};
pub use output::OutputError;
pub use single::{AngleSample, sample_angle, sample_distance};

/// Metres per second, in vacuum.
pub const SPEED_OF_LIGHT: f64 = 299_792_458.0;

#[cfg(all(test, feature = "media"))]
mod fog_tests;
#[cfg(test)]
mod tests;
