//! Codes as ratios of frequencies.
//!
//! Exposure and read-out of a camera scale or blur all stripes alike; the ratio of their frequencies
//! stays. Zhu et al. 2017, section on barcodes and algorithm 2.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};

use super::sequence::Sequence;
use super::waveform::{CodedError, Waveform, positive};
use crate::color::{LUMINANCE, color};
use crate::fourier::Fourier;
use crate::metrics::Radiance;

/// The three published codes of one channel, hertz. A light of three channels sends all of them, one
/// in each.
pub const CODES: [[f64; 3]; 3] =
    [[400.0, 600.0, 800.0], [1000.0, 1200.0, 1400.0], [1600.0, 1800.0, 2000.0]];

/// Transforms are this much longer than their signals: the maxima of a spectrum lie between the
/// frequencies of a transform of the signal's own length.
const PADDING: usize = 4;

/// A light that shows each of a code's `frequencies`, hertz, for `dwell` seconds: at best a third of
/// a frame, so that a block of rows sees one or two of them. `duty` and `peak` as of
/// [`Waveform::new`].
///
/// # Errors
/// [`CodedError::OutOfRange`] when one is, or there is no frequency.
pub fn barcode(
    frequencies: &[f64],
    dwell: f64,
    duty: f64,
    peak: f64,
) -> Result<Sequence, CodedError> {
    let waves = frequencies.iter().map(|f| Ok((dwell, Waveform::new(*f, duty, 0.0, peak)?)));
    Sequence::new(waves.collect::<Result<Vec<_>, CodedError>>()?)
}

/// All ratios of two of the frequencies, the lower ÷ the higher: 3 of three, 36 of nine.
pub fn ratios(frequencies: &[f64]) -> Vec<f64> {
    let pairs = frequencies
        .iter()
        .enumerate()
        .flat_map(|(i, a)| frequencies[i + 1..].iter().map(move |b| a.min(*b) / a.max(*b)));
    pairs.filter(|ratio| ratio.is_finite() && *ratio < 1.0).collect()
}

/// Least number of matching ratios is this share of the code's ratios + the number after it, rounded up.
const LEAST_SHARE: f64 = 0.1;
const LEAST_MATCHES: f64 = 2.0;

/// How a code is looked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Detector {
    /// Blocks along each side of the image, at least 1.
    pub blocks: u32,
    /// Peaks of a block's spectrum, at least 1.
    pub peaks: usize,
    /// Rows per second that the camera is taken to read; only the band depends on it.
    pub rows_per_second: f64,
    /// Lowest and highest frequency, hertz.
    pub band: [f64; 2],
    /// Greatest difference of a ratio from one of the code.
    pub tolerance: f64,
    /// Least power of a peak ÷ the median power of its block's band; 0 for any.
    pub prominence: f64,
    /// Least agreement of a peak's phase across the blocks beside its own, in [0, 1]: stripes cross
    /// the whole image, textures do not. 1 ÷ blocks is what chance gives; 0 for any.
    pub coherence: f64,
    /// Whether the three channels are searched apart; else their luminance. The 36 ratios of three
    /// channels' codes leave hardly a ratio out: a verdict then tells that there are stripes of
    /// several frequencies (harmonics of one, too) more than which.
    pub colors: bool,
}

impl Default for Detector {
    /// The published settings.
    fn default() -> Self {
        Self {
            blocks: 4,
            peaks: 2,
            rows_per_second: 30_000.0,
            band: [400.0, 15_000.0],
            tolerance: 0.05,
            prominence: 0.0,
            coherence: 0.0,
            colors: false,
        }
    }
}

impl Detector {
    /// Settings for pictures with textures of their own. With the published ones nearly every
    /// picture of a corpus of ours is taken to carry a code: two peaks of each of 16 spectra give
    /// 496 ratios, and the bands around three codes cover a quarter of all ratios.
    pub fn strict() -> Self {
        Self { prominence: 30.0, coherence: 0.97, ..Self::default() }
    }
}

/// What a detector found.
#[derive(Clone, Debug, PartialEq)]
pub struct Verdict {
    /// Frequencies of all blocks, hertz, by the detector's rows per second.
    pub frequencies: Vec<f64>,
    /// Ratios of two of them that match the code.
    pub matches: usize,
    /// Least number for a detection.
    pub threshold: usize,
}

impl Verdict {
    /// Whether the image carries the code.
    pub fn is_protected(&self) -> bool {
        self.matches >= self.threshold
    }
}

impl Detector {
    /// Looks for a code with these [`ratios`] in `image`. Values that are not finite count as black.
    ///
    /// # Errors
    /// [`CodedError`] when a setting is out of range, or the image is incomplete or has less than 8
    /// rows or less than one column per block.
    pub fn detect(&self, image: &Radiance, code: &[f64]) -> Result<Verdict, CodedError> {
        positive("the number of blocks", f64::from(self.blocks))?;
        positive("the number of peaks", self.peaks as f64)?;
        positive("the rows per second", self.rows_per_second)?;
        let (width, rows) = (image.width as usize, image.height as usize);
        let blocks = self.blocks as usize;
        let expected = width * rows;
        if image.rgb.len() != expected || width < blocks || rows < 8 * blocks {
            return Err(CodedError::Size { what: "pixels", given: image.rgb.len(), expected });
        }
        let weights: &[DVec3] = if self.colors { &DVec3::AXES } else { &[LUMINANCE] };
        let height = rows / blocks;
        let fourier = Fourier::at_least(height * PADDING);
        let mut frequencies = Vec::new();
        for weight in weights {
            for row in 0..blocks {
                let spectrum = |column: usize| {
                    let columns = column * width / blocks..(column + 1) * width / blocks;
                    let mean = |y: usize| {
                        let pixels = &image.rgb[y * width..][columns.clone()];
                        let sum: f64 = pixels.iter().map(|pixel| value(*pixel, *weight)).sum();
                        sum / columns.len() as f64
                    };
                    let signal = (row * height..(row + 1) * height).map(mean).collect::<Vec<_>>();
                    spectrum(&signal, &fourier)
                };
                let spectra: Vec<Vec<DVec2>> = (0..blocks).map(spectrum).collect();
                for own in 0..blocks {
                    frequencies.extend(self.strongest(&spectra, own));
                }
            }
        }
        let is_known =
            |ratio: &f64| code.iter().any(|known| (ratio - known).abs() <= self.tolerance);
        let matches = ratios(&frequencies).iter().filter(|ratio| is_known(ratio)).count();
        let threshold = (LEAST_SHARE * code.len() as f64 + LEAST_MATCHES).ceil() as usize;
        Ok(Verdict { frequencies, matches, threshold })
    }

    /// Frequencies of the strongest peaks, hertz, in the spectrum of block `own` of a row of blocks.
    fn strongest(&self, spectra: &[Vec<DVec2>], own: usize) -> Vec<f64> {
        let length = spectra[own].len();
        let hertz = self.rows_per_second / length as f64;
        let power = |i: usize| spectra[own][i].length_squared();
        let last = length / 2 - 1;
        let from = ((self.band[0] / hertz).ceil().max(1.0) as usize).min(last);
        let to = ((self.band[1] / hertz).floor().max(0.0) as usize).min(last);
        let mut band: Vec<f64> = (from..=to).map(power).collect();
        if band.is_empty() {
            return Vec::new();
        }
        let middle = band.len() / 2;
        let median = *band.select_nth_unstable_by(middle, f64::total_cmp).1;
        let least = (median * self.prominence).max(f64::MIN_POSITIVE);
        let coherence = |i: usize| {
            let sum: DVec2 = spectra.iter().map(|values| values[i]).sum();
            let powers: f64 = spectra.iter().map(|values| values[i].length_squared()).sum();
            sum.length_squared() / (powers * spectra.len() as f64)
        };
        let is_peak = |i: &usize| {
            let own = power(*i);
            own >= least
                && own >= power(*i - 1)
                && own > power(*i + 1)
                && coherence(*i) >= self.coherence
        };
        let mut peaks: Vec<usize> = (from..=to).filter(is_peak).collect();
        peaks.sort_by(|a, b| power(*b).total_cmp(&power(*a)));
        peaks.truncate(self.peaks);
        // The vertex of the parabola through the logarithms of three values.
        let refined = |i: usize| {
            let [before, own, after] =
                [i - 1, i, i + 1].map(|i| power(i).max(f64::MIN_POSITIVE).ln());
            let bend = before - 2.0 * own + after;
            let shift = if bend < 0.0 { 0.5 * (before - after) / bend } else { 0.0 };
            (i as f64 + shift.clamp(-0.5, 0.5)) * hertz
        };
        peaks.into_iter().map(refined).collect()
    }
}

/// The transform of a signal without its trend, padded.
fn spectrum(signal: &[f64], fourier: &Fourier) -> Vec<DVec2> {
    let mut values = vec![DVec2::ZERO; fourier.length()];
    let length = signal.len() as f64;
    for (i, (value, own)) in values.iter_mut().zip(without_trend(signal)).enumerate() {
        // Hann's window: without it the spectrum of a slow change covers the band.
        value.x = own * (0.5 - 0.5 * (TAU * (i as f64 + 0.5) / length).cos());
    }
    fourier.forward(&mut values);
    values
}

fn value(pixel: [f32; 3], weights: DVec3) -> f64 {
    let sum = color(pixel).dot(weights);
    if sum.is_finite() { sum } else { 0.0 }
}

/// The signal ÷ its mean, less the line of least squares through it.
fn without_trend(signal: &[f64]) -> impl Iterator<Item = f64> {
    let count = signal.len() as f64;
    let mean = signal.iter().sum::<f64>() / count;
    let middle = 0.5 * (count - 1.0);
    let moment: f64 = signal.iter().enumerate().map(|(i, v)| (i as f64 - middle) * v).sum();
    let slope = moment / (count * (count * count - 1.0) / 12.0).max(f64::MIN_POSITIVE);
    let scale = if mean > 0.0 { 1.0 / mean } else { 0.0 };
    signal.iter().enumerate().map(move |(i, v)| (v - mean - slope * (i as f64 - middle)) * scale)
}
