//! A rolling shutter's rows, and images from them.

use super::waveform::{CodedError, Modulation, positive};
use crate::metrics::Radiance;

/// A rolling shutter: row i is exposed from i · `row_time` on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shutter {
    pub(super) exposure: f64,
    pub(super) row_time: f64,
    rows: u32,
}

impl Shutter {
    /// `exposure` of a row and time between rows, seconds, both above 0. Phones read 30 000 to
    /// 100 000 rows a second.
    ///
    /// # Errors
    /// [`CodedError::OutOfRange`] when one is not finite or not above 0.
    pub fn new(exposure: f64, row_time: f64, rows: u32) -> Result<Self, CodedError> {
        positive("the exposure", exposure)?;
        positive("the time between rows", row_time)?;
        Ok(Self { exposure, row_time, rows })
    }

    /// Light of every row ÷ that of the same light without modulation, for a frame that begins at
    /// `start`, seconds: 1 on average over whole periods. Zeros for a light that is off.
    pub fn profile(&self, modulation: &impl Modulation, start: f64) -> Vec<f64> {
        let steady = modulation.mean() * self.exposure;
        let row = |row: u32| {
            let light = modulation.light(start + f64::from(row) * self.row_time, self.exposure);
            if steady > 0.0 { light / steady } else { 0.0 }
        };
        (0..self.rows).map(row).collect()
    }
}

/// The rolling-shutter image of lights: for each its image under steady light, and the
/// [profile](Shutter::profile) of each of its three channels. What every light sends by way of
/// surfaces, however many, is modulated with it.
///
/// # Errors
/// [`CodedError::Size`] when there is no light, images differ in size, or a profile does not have as
/// many rows as its image.
pub fn compose(lights: &[(&Radiance, [&[f64]; 3])]) -> Result<Radiance, CodedError> {
    let Some(((first, _), _)) = lights.split_first() else {
        return Err(CodedError::Size { what: "lights", given: 0, expected: 1 });
    };
    let (width, pixels) = (first.width.max(1) as usize, first.rgb.len());
    let mut rgb = vec![[0.0; 3]; pixels];
    for (image, profiles) in lights {
        if image.width != first.width || image.rgb.len() != pixels {
            let given = image.rgb.len();
            return Err(CodedError::Size { what: "pixels", given, expected: pixels });
        }
        let rows = pixels.div_ceil(width);
        if let Some(profile) = profiles.iter().find(|profile| profile.len() != rows) {
            return Err(CodedError::Size { what: "rows", given: profile.len(), expected: rows });
        }
        for (row, (sums, pixels)) in rgb.chunks_mut(width).zip(image.rgb.chunks(width)).enumerate()
        {
            let scales = profiles.map(|profile| profile[row] as f32);
            for (sum, pixel) in sums.iter_mut().zip(pixels) {
                (0..3).for_each(|channel| sum[channel] += pixel[channel] * scales[channel]);
            }
        }
    }
    Ok(Radiance { rgb, ..**first })
}
