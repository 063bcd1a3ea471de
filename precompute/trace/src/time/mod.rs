//! Light by its time of arrival.
//!
//! Jarabo et al. 2014, "A Framework for Transient Rendering": every path of the steady image also
//! says how long its light was on its way, and serves all frames. All lights flash once, at time 0;
//! parallel light and the sky, which have no place, at the last surface of the path that they light. Scattering takes no time, and air slows no light.
//!
//! | module | job |
//! |---|---|
//! | `density` | kernels in time, and how they shrink |
//! | `film` | the image of each frame, in one call with the steady one |
//! | `output` | frames as layers of an OpenEXR file, as pictures and as an animation |
//! | `flight` | a time-of-flight camera: from phases to depth |
//! | `bounce` | what a time-of-flight camera can know of its multipath error |
//! | `single` | distances and angles in fog that are uniform in time |

mod bounce;
mod density;
mod film;
mod flight;
mod output;
mod single;

pub use bounce::{Lamp, without_bounce};
pub use density::{bandwidth, kernel};
pub use film::{Frames, Spread, TimeError, Window, frames, progressive};
pub use flight::{Capture, capture, depth, phases, phasor, range};
pub use output::OutputError;
pub use single::{AngleSample, sample_angle, sample_distance};

/// Metres per second, in vacuum.
pub const SPEED_OF_LIGHT: f64 = 299_792_458.0;

#[cfg(test)]
mod tests;
