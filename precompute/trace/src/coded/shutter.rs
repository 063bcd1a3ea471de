//! A rolling shutter's rows, closed forms of their stripes, and images from them.

use super::waveform::{CodedError, Modulation, Waveform, positive};
use crate::metrics::Radiance;

/// Exposures nearer to a whole number of periods than this share of a period have no stripes.
const WHOLE: f64 = 1e-9;

/// A rolling shutter: row i is exposed from i · `row_time` on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shutter {
    exposure: f64,
    row_time: f64,
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

/// Light and width of the stripes of a square wave: Zhu et al. 2017, equations 3 to 6. Light ramps
/// linearly between them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stripes {
    /// Light of the brightest and darkest rows: the peak's unit × seconds.
    pub bright: f64,
    /// See `bright`.
    pub dark: f64,
    /// Rows of full light in each stripe; infinite where there are no stripes.
    pub bright_rows: f64,
    /// Rows of least light in each stripe; infinite where there are no stripes.
    pub dark_rows: f64,
}

impl Stripes {
    /// The stripes of `wave` in a frame of `shutter`.
    ///
    /// Where the exposure is a whole number of periods, all rows have the light of that many.
    pub fn new(wave: &Waveform, shutter: &Shutter) -> Self {
        let period = 1.0 / wave.frequency();
        let (on, off) = (period * wave.duty(), period * (1.0 - wave.duty()));
        let periods = shutter.exposure * wave.frequency();
        let (whole, rest) = (periods.floor(), periods - periods.floor());
        if rest.min(1.0 - rest) < WHOLE {
            let light = wave.peak() * on * periods.round();
            return Self {
                bright: light,
                dark: light,
                bright_rows: f64::INFINITY,
                dark_rows: f64::INFINITY,
            };
        }
        let rest = rest * period;
        Self {
            bright: wave.peak() * (whole * on + rest.min(on)),
            dark: wave.peak() * (whole * on + (rest - off).max(0.0)),
            bright_rows: (rest - on).abs() / shutter.row_time,
            dark_rows: (rest - off).abs() / shutter.row_time,
        }
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
