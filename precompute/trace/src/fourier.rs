//! Fourier transforms of a power-of-two length: Cooley and Tukey 1965, "An Algorithm for the Machine
//! Calculation of Complex Fourier Series". A complex number is a vector (real, imaginary), whose
//! `rotate` is the complex product.

use std::f64::consts::TAU;

use glam::DVec2;

/// A transform of one length, with its table of roots of unity.
#[derive(Clone, Debug)]
pub(crate) struct Fourier {
    /// exp(−2πi k ÷ length) of the first half.
    roots: Vec<DVec2>,
}

impl Fourier {
    /// The transform of the least power of two that is at least `length`, and at least 2.
    pub(crate) fn at_least(length: usize) -> Self {
        let length = length.next_power_of_two().max(2);
        let root = |k: usize| DVec2::from_angle(-TAU * k as f64 / length as f64);
        Self { roots: (0..length / 2).map(root).collect() }
    }

    /// Number of values.
    pub(crate) fn length(&self) -> usize {
        self.roots.len() * 2
    }

    /// Σ value · exp(−2πi jk ÷ length), in place; `values` has [`length`](Self::length) of them.
    pub(crate) fn forward(&self, values: &mut [DVec2]) {
        let length = self.length();
        assert_eq!(values.len(), length, "values of a transform");
        let shift = usize::BITS - length.trailing_zeros();
        for i in 0..length {
            let j = i.reverse_bits() >> shift;
            if i < j {
                values.swap(i, j);
            }
        }
        let mut half = 1;
        while half < length {
            let stride = length / (2 * half);
            for block in values.chunks_exact_mut(2 * half) {
                let (low, high) = block.split_at_mut(half);
                for (k, (low, high)) in low.iter_mut().zip(high).enumerate() {
                    let turned = high.rotate(self.roots[k * stride]);
                    (*low, *high) = (*low + turned, *low - turned);
                }
            }
            half *= 2;
        }
    }

    /// The inverse of [`forward`](Self::forward).
    #[cfg(any(feature = "inverse", test))]
    pub(crate) fn backward(&self, values: &mut [DVec2]) {
        let conjugate = |value: &mut DVec2| value.y = -value.y;
        values.iter_mut().for_each(conjugate);
        self.forward(values);
        let scale = 1.0 / self.length() as f64;
        values.iter_mut().for_each(|value| *value = DVec2::new(value.x, -value.y) * scale);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_the_sum_that_defines_it_and_is_inverted() {
        for length in [2, 8, 64] {
            let fourier = Fourier::at_least(length);
            let values: Vec<DVec2> =
                (0..length).map(|i| DVec2::new((i * i) as f64 % 7.0, (i as f64).sin())).collect();
            let mut found = values.clone();
            fourier.forward(&mut found);
            for (k, found) in found.iter().enumerate() {
                let angle = |j: usize| -TAU * (j * k) as f64 / length as f64;
                let terms = values.iter().enumerate();
                let sum: DVec2 = terms.map(|(j, v)| v.rotate(DVec2::from_angle(angle(j)))).sum();
                assert!(found.distance(sum) < 1e-9, "{k} of {length}");
            }
            fourier.backward(&mut found);
            assert!(found.iter().zip(&values).all(|(a, b)| a.distance(*b) < 1e-12));
        }
    }
}
