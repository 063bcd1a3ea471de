//! Random patterns that a transform multiplies with.
//!
//! Shifts of one row of random signs: Sen and Darabi 2009, "Compressive Dual Photography"; the shift
//! structure is Romberg's, 2009, "Compressive Sensing by Random Convolution". A projector shows the
//! positive and the negative pixels one after the other, and the images are subtracted.

use glam::DVec2;

use super::{InverseError, same};
use crate::fourier::Fourier;
use crate::sampler::Sampler;

/// A set of patterns of ±1.
#[derive(Clone, Debug)]
pub struct Patterns {
    signs: Vec<f64>,
    /// By pattern, how far the row is shifted.
    shifts: Vec<usize>,
    fourier: Fourier,
    spectrum: Vec<DVec2>,
}

impl Patterns {
    /// `count` patterns of `pixels` pixels, of random signs and random shifts, each shift once.
    ///
    /// # Errors
    /// When `pixels` is no power of two, or `count` exceeds it or is 0.
    pub fn new(pixels: usize, count: usize, seed: u64) -> Result<Self, InverseError> {
        if pixels < 2 || !pixels.is_power_of_two() {
            return Err(InverseError::PowerOfTwo { what: "pixels of a pattern", value: pixels });
        }
        if count == 0 || count > pixels {
            let (what, expected) = ("patterns", pixels);
            return Err(InverseError::Size { what, given: count, expected });
        }
        let number = |i: usize, which| Sampler::new(seed, i as u64, which).number();
        let mut signs: Vec<f64> =
            (0..pixels).map(|i| if number(i, 0) < 0.5 { -1.0 } else { 1.0 }).collect();
        let mut shifts: Vec<usize> = (0..pixels).collect();
        for i in 0..pixels {
            shifts.swap(i, i + (number(i, 1) * (pixels - i) as f64) as usize);
        }
        balance(&mut signs, &shifts);
        shifts.truncate(count);
        let fourier = Fourier::at_least(pixels);
        let mut spectrum = complex(&signs);
        fourier.forward(&mut spectrum);
        Ok(Self { signs, shifts, fourier, spectrum })
    }

    /// Number of pixels of a pattern.
    pub fn pixels(&self) -> usize {
        self.signs.len()
    }

    /// Number of patterns.
    pub fn count(&self) -> usize {
        self.shifts.len()
    }

    /// Pattern number `index`, in range: ±1 for every pixel.
    pub fn pattern(&self, index: usize) -> Vec<f64> {
        let count = self.signs.len();
        (0..count).map(|i| self.signs[(i + count - self.shifts[index]) % count]).collect()
    }

    /// The sum of an image's values, each times the pattern's, for every pattern.
    ///
    /// # Errors
    /// When the image does not have as many pixels.
    pub fn multiply(&self, image: &[f64]) -> Result<Vec<f64>, InverseError> {
        same("pixels", image.len(), self.pixels())?;
        let conjugate = |root: &DVec2| DVec2::new(root.x, -root.y);
        let sums = self.convolve(complex(image), conjugate);
        Ok(self.shifts.iter().map(|shift| sums[*shift].x).collect())
    }

    /// The transposed product: the sum of the patterns, each times its weight.
    ///
    /// # Errors
    /// When there are not as many weights as patterns.
    pub fn transposed(&self, weights: &[f64]) -> Result<Vec<f64>, InverseError> {
        same("weights", weights.len(), self.count())?;
        let mut spread = vec![DVec2::ZERO; self.pixels()];
        for (shift, weight) in self.shifts.iter().zip(weights) {
            spread[*shift].x = *weight;
        }
        Ok(self.convolve(spread, |root| *root).into_iter().map(|value| value.x).collect())
    }

    fn convolve(&self, mut values: Vec<DVec2>, of: impl Fn(&DVec2) -> DVec2) -> Vec<DVec2> {
        self.fourier.forward(&mut values);
        for (value, root) in values.iter_mut().zip(&self.spectrum) {
            *value = value.rotate(of(root));
        }
        self.fourier.backward(&mut values);
        values
    }
}

/// Flips signs, in this order, until their sum is the root of their number, as large as any other
/// frequency's on average. By chance it can be near 0: images have most of their light there, and
/// the patterns would hardly see it.
fn balance(signs: &mut [f64], order: &[usize]) {
    let wanted = 2.0 * ((signs.len() as f64).sqrt() * 0.5).round();
    let mut sum: f64 = signs.iter().sum();
    for i in order {
        let over = sum - wanted;
        if over * signs[*i] > 0.0 && over.abs() >= 2.0 {
            sum -= 2.0 * signs[*i];
            signs[*i] = -signs[*i];
        }
    }
}

fn complex(values: &[f64]) -> Vec<DVec2> {
    values.iter().map(|value| DVec2::new(*value, 0.0)).collect()
}
