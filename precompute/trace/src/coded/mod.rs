//! A rolling-shutter camera under modulated light.
//!
//! Zhu et al. 2017, "Automating Visual Privacy Protection Using a Smart LED" (`LiShield`): a light
//! that blinks faster than the eye sees draws stripes in the image of a camera that exposes its rows
//! one after another. The stripes have a closed form; so have lights that no exposure undoes,
//! lights that one known camera undoes, and a code in the ratio of their frequencies.
//!
//! Light is linear: an image under several lights is the sum of the images of each light, with every
//! row scaled by that light's [profile](Shutter::profile). That holds for indirect light too.
//!
//! | module | job |
//! |---|---|
//! | `waveform` | a square wave, and its integral |
//! | `sequence` | square waves one after another: scrambled frequencies |
//! | `shutter` | rows of light, and images from them |
//! | `barcode` | codes as ratios of frequencies, and their detector |

mod barcode;
mod sequence;
mod shutter;
mod waveform;

pub use barcode::{CODES, Detector, Verdict, barcode, ratios};
pub use sequence::Sequence;
pub use shutter::{Shutter, compose};
use waveform::positive;
pub use waveform::{CodedError, Modulation, Waveform};

/// The frequency, hertz, whose `periods` periods, at least 1, last one `exposure`, seconds: every
/// row gets the same light.
///
/// # Errors
/// [`CodedError::OutOfRange`] when one is.
pub fn authorised_frequency(exposure: f64, periods: u32) -> Result<f64, CodedError> {
    positive("the exposure", exposure)?;
    positive("the number of periods", f64::from(periods))?;
    Ok(f64::from(periods) / exposure)
}

#[cfg(test)]
mod tests;
