//! Haar's wavelets in two dimensions, orthonormal: Haar 1910; Mallat 1989 on the pyramid.

/// An image's transform.
#[derive(Clone, Copy, Debug)]
pub(super) struct Haar {
    /// Both powers of two.
    width: usize,
    height: usize,
}

impl Haar {
    pub(super) fn new(width: usize, height: usize) -> Self {
        Self { width, height }
    }

    /// Coefficients of the image, in place.
    pub(super) fn forward(self, image: &mut [f64]) {
        let (mut width, mut height) = (self.width, self.height);
        while width > 1 || height > 1 {
            (0..height).for_each(|y| split(image, y * self.width, 1, width));
            (0..width).for_each(|x| split(image, x, self.width, height));
            (width, height) = ((width / 2).max(1), (height / 2).max(1));
        }
    }

    /// The image of coefficients, in place.
    pub(super) fn backward(self, image: &mut [f64]) {
        let levels = self.width.max(self.height).trailing_zeros();
        for level in (0..levels).rev() {
            let (width, height) = ((self.width >> level).max(1), (self.height >> level).max(1));
            (0..width).for_each(|x| join(image, x, self.width, height));
            (0..height).for_each(|y| join(image, y * self.width, 1, width));
        }
    }
}

/// Sums of pairs to the first half of a line, differences to the second.
fn split(values: &mut [f64], start: usize, stride: usize, count: usize) {
    let line: Vec<f64> = (0..count).map(|i| values[start + i * stride]).collect();
    for i in 0..count / 2 {
        let (a, b) = (line[2 * i], line[2 * i + 1]);
        values[start + i * stride] = (a + b) * std::f64::consts::FRAC_1_SQRT_2;
        values[start + (count / 2 + i) * stride] = (a - b) * std::f64::consts::FRAC_1_SQRT_2;
    }
}

/// The inverse of [`split`].
fn join(values: &mut [f64], start: usize, stride: usize, count: usize) {
    let line: Vec<f64> = (0..count).map(|i| values[start + i * stride]).collect();
    for i in 0..count / 2 {
        let (sum, difference) = (line[i], line[count / 2 + i]);
        values[start + 2 * i * stride] = (sum + difference) * std::f64::consts::FRAC_1_SQRT_2;
        values[start + (2 * i + 1) * stride] = (sum - difference) * std::f64::consts::FRAC_1_SQRT_2;
    }
}
