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
//! | `authorised` | lights that one camera undoes |
//! | `barcode` | codes as ratios of frequencies, and their detector |

mod authorised;
mod barcode;
mod recovery;
mod sequence;
mod shutter;
mod stripes;
mod waveform;

pub use authorised::{authorised_frequency, critical_frames, dynamic};
pub use barcode::{CODES, Detector, Verdict, barcode, ratios};
pub use recovery::{Attack, Draw};
pub use sequence::{Scramble, Sequence, best_step};
pub use shutter::{Shutter, compose};
pub use stripes::{Stripes, deviation, psnr, worst_exposure};
pub use waveform::{CodedError, Modulation, Waveform};

#[cfg(test)]
mod tests;
