//! Closed forms of stripes, and what they do to an image.

use super::shutter::Shutter;
use super::waveform::{CodedError, Modulation, Waveform, positive};
use crate::metrics::Radiance;

/// Exposures nearer to a whole number of periods than this share of a period have no stripes.
const WHOLE: f64 = 1e-9;

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
        let periods = shutter.exposure() * wave.frequency();
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
            bright_rows: (rest - on).abs() / shutter.row_time(),
            dark_rows: (rest - off).abs() / shutter.row_time(),
        }
    }

    /// Brightest ÷ darkest light, at least 1: infinite where some rows are black, 1 for no light.
    pub fn contrast(&self) -> f64 {
        if self.bright == self.dark { 1.0 } else { self.bright / self.dark }
    }
}

/// Standard deviation of a profile ÷ its mean: the error that stripes leave in a grey image after
/// its brightness is corrected. 0 for an empty or black one.
pub fn deviation(profile: &[f64]) -> f64 {
    let count = profile.len().max(1) as f64;
    let mean = profile.iter().sum::<f64>() / count;
    if mean <= 0.0 {
        return 0.0;
    }
    (profile.iter().map(|row| (row / mean - 1.0).powi(2)).sum::<f64>() / count).sqrt()
}

/// The exposure, among `exposures`, seconds, at which a light's stripes are faintest, and their
/// [deviation]: what an attacker who may choose the exposure is left with. A good light has a large
/// one. Exposures that are out of range are left out; `None` without any.
pub fn worst_exposure(
    modulation: &impl Modulation,
    exposures: impl IntoIterator<Item = f64>,
    row_time: f64,
    rows: u32,
) -> Option<(f64, f64)> {
    let shutters =
        exposures.into_iter().filter_map(|exposure| Shutter::new(exposure, row_time, rows).ok());
    shutters
        .map(|shutter| (shutter.exposure(), deviation(&shutter.profile(modulation, 0.0))))
        .min_by(|a, b| a.1.total_cmp(&b.1))
}

/// Peak signal-to-noise ratio, decibels, of an image against a reference, with `white` the light
/// above which the camera clips, above 0. The image is scaled to the reference's mean and then
/// clipped; the reference is not, so that overexposure counts as error. Infinite for equal images.
///
/// # Errors
/// [`CodedError`] when the sizes differ or `white` is out of range.
pub fn psnr(reference: &Radiance, image: &Radiance, white: f64) -> Result<f64, CodedError> {
    positive("the white level", white)?;
    let (given, expected) = (image.rgb.len(), reference.rgb.len());
    if given != expected || expected == 0 {
        return Err(CodedError::Size { what: "pixels", given, expected });
    }
    let mean = image.mean();
    let scale = if mean > 0.0 { reference.mean() / mean } else { 1.0 };
    let errors = reference
        .rgb
        .iter()
        .flatten()
        .zip(image.rgb.iter().flatten())
        .map(|(own, other)| (f64::from(*own) - (f64::from(*other) * scale).min(white)).powi(2));
    let squared = errors.sum::<f64>() / (3 * expected) as f64;
    Ok(10.0 * (white * white / squared).log10())
}
