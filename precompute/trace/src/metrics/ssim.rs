//! Structural similarity: Wang, Bovik, Sheikh, Simoncelli 2004, "Image Quality Assessment: From
//! Error Visibility to Structural Similarity", <https://doi.org/10.1109/TIP.2003.819861>.
//!
//! Identical to scikit-image's `structural_similarity(…, gaussian_weights=True, sigma=1.5,
//! use_sample_covariance=False, data_range=255)` on the images' [luma](Picture::luma): an 11 × 11
//! Gaussian window with σ = 1.5, K₁ = 0.01, K₂ = 0.03, population covariance, and the mean over the
//! windows that lie wholly inside the image, which crops 5 pixels at every border.
//! `ssim_fixtures.py` beside this file writes the tests' expected values.
//!
//! Differences: only windows inside the image are computed, so no border rule is needed. An image
//! less than 11 pixels wide or high has no such window; it is compared in **one** window that
//! covers the whole image with equal weights.
//!
//! Luma and variances are kept in single precision. Sums run in double, since a variance is the
//! small difference of two large numbers.
//!
//! Not the crate `image-compare`: its windows are 8 × 8, do not overlap, and do not normalise the
//! covariance by the pixel count. Not `dssim`: another metric.

use super::Picture;

/// Taps of the window along one axis.
const TAPS: usize = 11;
/// Standard deviation of the window, pixels.
const SIGMA: f64 = 1.5;
/// (K₁ L)² and (K₂ L)² with L = 255.
const C1: f64 = 6.5025;
const C2: f64 = 58.5225;

/// Why two images cannot be compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SsimError {
    /// The sizes differ.
    #[error("the reference has {}×{} pixels, the image {}×{}", .reference.0, .reference.1, .picture.0, .picture.1)]
    Size {
        /// Width and height of the reference.
        reference: (u32, u32),
        /// Width and height of the other image.
        picture: (u32, u32),
    },
    /// An image has no pixels.
    #[error("an image without pixels has no error")]
    Empty,
    /// An image's number of pixels is not its width × height.
    #[error("an image of {width}×{height} does not have {pixels} pixels")]
    Malformed {
        /// Pixels in a row.
        width: u32,
        /// Rows.
        height: u32,
        /// The number of pixels.
        pixels: usize,
    },
}

/// 1 − SSIM: 0 for equal images, 1 for uncorrelated ones, up to 2 for an image and its negative.
/// Never NaN.
///
/// # Errors
/// When the images differ in size, are empty, or do not have as many pixels as their size says.
pub fn error(reference: &Picture, picture: &Picture) -> Result<f64, SsimError> {
    Reference::new(reference)?.error(picture)
}

/// A reference image with precomputed means and variances, which halves the work of each
/// comparison.
///
/// Takes 16 bytes per pixel.
#[derive(Clone, Debug)]
pub struct Reference {
    width: usize,
    height: usize,
    luma: Vec<f32>,
    /// Mean and variance of every window, row by row. One window for a small image.
    means: Vec<f64>,
    variances: Vec<f32>,
}

impl Reference {
    /// Prepares `picture`.
    ///
    /// # Errors
    /// When it is empty, or does not have as many pixels as its size says.
    pub fn new(picture: &Picture) -> Result<Self, SsimError> {
        let luma = checked_luma(picture)?;
        let (width, height) = (picture.width as usize, picture.height as usize);
        let mut reference = Self { width, height, luma, means: Vec::new(), variances: Vec::new() };
        if reference.is_small() {
            let (mean, variance) = mean_and_covariance(&reference.luma, &reference.luma);
            (reference.means, reference.variances) = (vec![mean], vec![variance as f32]);
            return Ok(reference);
        }
        let (mut means, mut variances) = (Vec::new(), Vec::new());
        let fill = |row: usize, [values, squares]: &mut [Vec<f64>; 2]| {
            let luma = &reference.luma[row * width..][..width];
            multiply(luma, luma, squares);
            widen(luma, values);
        };
        filter(width, height, fill, |_, [mean, square]| {
            means.extend_from_slice(mean);
            variances.extend(
                mean.iter().zip(square).map(|(mean, square)| (square - mean * mean) as f32),
            );
        });
        (reference.means, reference.variances) = (means, variances);
        Ok(reference)
    }

    /// Width and height in pixels.
    pub fn size(&self) -> (u32, u32) {
        (self.width as u32, self.height as u32)
    }

    /// 1 − SSIM of `picture` against this one, as [`error`].
    ///
    /// # Errors
    /// When `picture` is of another size, or does not have as many pixels as its size says.
    pub fn error(&self, picture: &Picture) -> Result<f64, SsimError> {
        if (picture.width, picture.height) != self.size() {
            return Err(SsimError::Size {
                reference: self.size(),
                picture: (picture.width, picture.height),
            });
        }
        let other = checked_luma(picture)?;
        let similarity = if self.is_small() {
            self.similarity_in_one_window(&other)
        } else {
            self.similarity(&other)
        };
        // Rounding may take the similarity of almost equal images past 1.
        Ok((1.0 - similarity).clamp(0.0, 2.0))
    }

    fn is_small(&self) -> bool {
        self.width < TAPS || self.height < TAPS
    }

    fn similarity_in_one_window(&self, other: &[f32]) -> f64 {
        let (mean, variance) = mean_and_covariance(other, other);
        let (_, covariance) = mean_and_covariance(&self.luma, other);
        window_similarity(self.means[0], mean, self.variances[0], variance as f32, covariance)
    }

    fn similarity(&self, other: &[f32]) -> f64 {
        let width = self.width;
        let columns = width - TAPS + 1;
        let fill = |row: usize, [values, squares, products]: &mut [Vec<f64>; 3]| {
            let luma = &other[row * width..][..width];
            widen(luma, values);
            multiply(luma, luma, squares);
            multiply(&self.luma[row * width..][..width], luma, products);
        };
        let mut similarities = vec![0.0; columns];
        let mut total = 0.0f64;
        filter(width, self.height, fill, |row, [mean, square, product]| {
            let reference_mean = &self.means[row * columns..][..columns];
            let reference_variance = &self.variances[row * columns..][..columns];
            let (mean, square, product) =
                (&mean[..columns], &square[..columns], &product[..columns]);
            let similarities = &mut similarities[..columns];
            for i in 0..columns {
                let variance = (square[i] - mean[i] * mean[i]) as f32;
                let covariance = product[i] - reference_mean[i] * mean[i];
                similarities[i] = window_similarity(
                    reference_mean[i],
                    mean[i],
                    reference_variance[i],
                    variance,
                    covariance,
                );
            }
            total += sum(similarities);
        });
        total / self.means.len() as f64
    }
}

/// SSIM of one window. Its covariance is rounded as the variances are, so that for equal statistics
/// numerator and denominator are equal and the quotient is exactly 1.
#[inline]
fn window_similarity(
    mean_a: f64,
    mean_b: f64,
    variance_a: f32,
    variance_b: f32,
    covariance: f64,
) -> f64 {
    let (a, b, covariance) = (mean_a, mean_b, f64::from(covariance as f32));
    let like = (a * b + a * b + C1) * (covariance + covariance + C2);
    like / ((a * a + b * b + C1) * (f64::from(variance_a) + f64::from(variance_b) + C2))
}

fn checked_luma(picture: &Picture) -> Result<Vec<f32>, SsimError> {
    let (width, height, pixels) = (picture.width, picture.height, picture.rgb.len());
    if u64::from(width) * u64::from(height) != pixels as u64 {
        return Err(SsimError::Malformed { width, height, pixels });
    }
    if pixels == 0 {
        return Err(SsimError::Empty);
    }
    Ok(picture.luma())
}

/// Mean of `b`, and covariance of `a` and `b`, with equal weights.
fn mean_and_covariance(a: &[f32], b: &[f32]) -> (f64, f64) {
    let count = a.len() as f64;
    let mean_of = |values: &[f32]| values.iter().copied().map(f64::from).sum::<f64>() / count;
    let (mean_a, mean_b) = (mean_of(a), mean_of(b));
    let covariance = a
        .iter()
        .zip(b)
        .map(|(&a, &b)| (f64::from(a) - mean_a) * (f64::from(b) - mean_b))
        .sum::<f64>()
        / count;
    (mean_b, covariance)
}

/// Filters `N` quantities with the Gaussian window at once. `fill` writes them for one row of the
/// image, `emit` receives them for one row of windows.
///
/// Keeps only the eleven horizontally filtered rows that a window needs, so that they stay in
/// cache.
fn filter<const N: usize>(
    width: usize,
    height: usize,
    fill: impl Fn(usize, &mut [Vec<f64>; N]),
    mut emit: impl FnMut(usize, &[Vec<f64>; N]),
) {
    let weights = weights();
    let columns = width - TAPS + 1;
    let row_of = |length: usize| -> [Vec<f64>; N] { std::array::from_fn(|_| vec![0.0; length]) };
    let mut input = row_of(width);
    let mut output = row_of(columns);
    let mut ring: [[Vec<f64>; N]; TAPS] = std::array::from_fn(|_| row_of(columns));
    for row in 0..height {
        fill(row, &mut input);
        for (input, output) in input.iter().zip(&mut ring[row % TAPS]) {
            weigh(&weights, std::array::from_fn(|tap| &input[tap..]), output);
        }
        if row + 1 >= TAPS {
            let first = row + 1 - TAPS;
            for (quantity, output) in output.iter_mut().enumerate() {
                weigh(
                    &weights,
                    std::array::from_fn(|tap| &ring[(first + tap) % TAPS][quantity][..]),
                    output,
                );
            }
            emit(first, &output);
        }
    }
}

/// The window along one axis, normalised; symmetric, so six of the eleven weights suffice.
fn weights() -> [f64; TAPS / 2 + 1] {
    let bell = |distance: usize| (-0.5 * (distance as f64 / SIGMA).powi(2)).exp();
    let total = bell(0) + 2.0 * (1..=TAPS / 2).map(bell).sum::<f64>();
    std::array::from_fn(|tap| bell(TAPS / 2 - tap) / total)
}

/// `output[i]` = Σ weight × `rows[tap][i]`. Every row is at least as long as `output`.
fn weigh(weights: &[f64; TAPS / 2 + 1], rows: [&[f64]; TAPS], output: &mut [f64]) {
    let length = output.len();
    // Slices of equal and known length, so that bounds are checked once and the loop is vectorised.
    let [a, b, c, d, e, f, g, h, i, j, k] = rows.map(|row| &row[..length]);
    let [w0, w1, w2, w3, w4, w5] = *weights;
    for n in 0..length {
        let outer = w0 * (a[n] + k[n]) + w1 * (b[n] + j[n]) + w2 * (c[n] + i[n]);
        let inner = w3 * (d[n] + h[n]) + w4 * (e[n] + g[n]) + w5 * f[n];
        output[n] = outer + inner;
    }
}

fn widen(values: &[f32], output: &mut [f64]) {
    for (value, output) in values.iter().zip(output) {
        *output = f64::from(*value);
    }
}

fn multiply(a: &[f32], b: &[f32], output: &mut [f64]) {
    for ((a, b), output) in a.iter().zip(b).zip(output) {
        *output = f64::from(*a) * f64::from(*b);
    }
}

/// Sums in eight lanes, in a fixed order.
fn sum(values: &[f64]) -> f64 {
    let (chunks, rest) = values.as_chunks::<8>();
    let mut lanes = [0.0; 8];
    for chunk in chunks {
        for (lane, value) in lanes.iter_mut().zip(chunk) {
            *lane += value;
        }
    }
    lanes.iter().sum::<f64>() + rest.iter().sum::<f64>()
}

#[cfg(test)]
#[path = "ssim_tests.rs"]
mod tests;
