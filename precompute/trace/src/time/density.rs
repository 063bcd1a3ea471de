//! Kernels in time, and how they shrink from pass to pass.

/// Exponent of [`bandwidth`] at which variance and squared bias fall alike, as n^(−4/5).
const ALPHA: f64 = 0.8;

/// A kernel at a distance in time, per second: Perlin's smooth step, 0 beyond `bandwidth`, with the
/// integral 1. Both in seconds; 0 where `bandwidth` is not above 0.
pub fn kernel(distance: f64, bandwidth: f64) -> f64 {
    let u = (distance / bandwidth).abs();
    // This form also rejects NaN.
    if !(u < 1.0 && bandwidth > 0.0) {
        return 0.0;
    }
    (1.0 - u * u * u * (u * (6.0 * u - 15.0) + 10.0)) / bandwidth
}

/// Bandwidth of pass number `pass`, from 0, where the first has `first`; seconds.
///
/// Jarabo et al. 2014, section 4.1: `T(j + 1) = T(j) (j + α) / (j + 1)` with α = 4/5. The mean over
/// n passes then has a squared error of n^(−4/5); bins of the best width for n have n^(−2/3).
pub fn bandwidth(first: f64, pass: u32) -> f64 {
    (1..=pass).fold(first, |width, j| width * (f64::from(j) + ALPHA) / (f64::from(j) + 1.0))
}
