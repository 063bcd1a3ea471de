//! Closed forms of stripes.

use super::shutter::Shutter;
use super::waveform::Waveform;

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
}
