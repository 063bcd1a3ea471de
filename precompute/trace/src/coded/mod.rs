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
//! | `sequence` | square waves one after another: scrambled frequencies, random intensities |
//! | `shutter` | rows of light, and images from them |
//! | `stripes` | closed forms of stripes; what they do to an image |
//! | `recovery` | how many frames undo random intensities |
//! | `barcode` | codes as ratios of frequencies, and their detector |

mod barcode;
mod recovery;
mod sequence;
mod shutter;
mod stripes;
mod waveform;

pub use barcode::{CODES, Detector, Verdict, barcode, ratios};
pub use recovery::{Attack, Draw};
pub use sequence::{Scramble, Sequence, best_step};
pub use shutter::{Shutter, compose};
pub use stripes::{Stripes, deviation, psnr, worst_exposure};
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

/// A light that knows one camera's exposure and clock: [flat](authorised_frequency) while a frame of
/// `camera` is exposed, and of `other` frequency, hertz, in the `gap`, seconds, until the next.
/// Frames begin at multiples of its [period](Sequence::period).
///
/// # Errors
/// [`CodedError::OutOfRange`] when an argument is.
pub fn dynamic(
    camera: &Shutter,
    periods: u32,
    gap: f64,
    other: f64,
    duty: f64,
    peak: f64,
) -> Result<Sequence, CodedError> {
    let frequency = authorised_frequency(camera.exposure(), periods)?;
    let frame = f64::from(camera.rows()) * camera.row_time() + camera.exposure();
    Sequence::new([
        (frame, Waveform::new(frequency, duty, 0.0, peak)?),
        (gap, Waveform::new(other, duty, 0.0, peak)?),
    ])
}

/// The waves of critical frames, one a frame, which a camera that knows their times averages: phases
/// are spread evenly over a period. The mean is flat for every exposure where `duty` × `count` is
/// whole; any one of them is striped.
///
/// # Errors
/// [`CodedError::OutOfRange`] when `count` is 0 or a value is out of range.
pub fn critical_frames(
    frequency: f64,
    duty: f64,
    peak: f64,
    count: u32,
) -> Result<Vec<Waveform>, CodedError> {
    positive("the number of frames", f64::from(count))?;
    let phase = |frame: u32| f64::from(frame) / f64::from(count);
    (0..count).map(|frame| Waveform::new(frequency, duty, phase(frame), peak)).collect()
}

#[cfg(test)]
mod tests;
