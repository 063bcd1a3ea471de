//! The projector's view from few images of the camera.
//!
//! Sen and Darabi 2009, "Compressive Dual Photography". For any light from the camera's side, the
//! images under known patterns are products of the patterns with the dual image. Of all images with
//! these products, the sparsest in Haar's wavelets is taken. Beck and Teboulle 2009, "A Fast
//! Iterative Shrinkage-Thresholding Algorithm for Linear Inverse Problems".

use std::f64::consts::{FRAC_1_SQRT_2, SQRT_2, TAU};

use rayon::prelude::*;

use super::{InverseError, Patterns, Transport, same};
use crate::sampler::Sampler;

/// Patches whose products are all below this share of the greatest are taken as black.
const BLACK: f64 = 1e-4;
/// Rounds of the estimate of the greatest singular value.
const POWER_ROUNDS: usize = 30;

/// Images of a camera under patterns.
#[derive(Clone, Debug)]
pub struct Capture {
    patterns: Patterns,
    camera: usize,
    /// A row for each pixel of the camera, a column for each pattern.
    images: Vec<f64>,
}

/// How an image is recovered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Recovery {
    /// Width and height of the projector's image, both powers of two.
    pub size: [usize; 2],
    /// Weight of sparsity, as a share of the weight above which the image is black; in (0, 1).
    pub sparsity: f64,
    /// Iterations, at least 1.
    pub iterations: usize,
}

impl Capture {
    /// The images of `transport` under `patterns`, a pair of exposures for each: Gaussian noise of
    /// `noise` times the camera's mean under half of the projector's light is in every exposure.
    ///
    /// # Errors
    /// When the patterns are not the projector's size.
    pub fn new(
        transport: &Transport,
        patterns: Patterns,
        noise: f64,
        seed: u64,
    ) -> Result<Self, InverseError> {
        same("pixels", patterns.pixels(), transport.projector)?;
        let camera = transport.camera;
        let half = transport.image(&vec![0.5; transport.projector])?;
        // Two exposures are subtracted.
        let deviation = noise.max(0.0) * SQRT_2 * half.iter().sum::<f64>() / camera.max(1) as f64;
        let row = |pixel: usize| -> Result<Vec<f64>, InverseError> {
            let row: Vec<f64> = transport.row(pixel).iter().map(|t| f64::from(*t)).collect();
            let mut sums = patterns.multiply(&row)?;
            if deviation > 0.0 {
                let mut sampler = Sampler::new(seed, pixel as u64, 0);
                sums.iter_mut().for_each(|sum| *sum += deviation * gaussian(&mut sampler));
            }
            Ok(sums)
        };
        let images: Vec<Vec<f64>> =
            (0..camera).into_par_iter().map(row).collect::<Result<_, _>>()?;
        Ok(Self { patterns, camera, images: images.concat() })
    }

    /// The image from the projector's place under this light from the camera's pixels, candela.
    ///
    /// # Errors
    /// When there are not as many intensities as pixels, or the size is not that of the patterns.
    pub fn dual(&self, light: &[f64], recovery: &Recovery) -> Result<Vec<f64>, InverseError> {
        let products = self.products(light)?;
        recovery.solve(&self.patterns, &products)
    }

    /// The images from the projector's place under each of `patches`, lists of the camera's pixels
    /// of 1 candela. Their sum, each with a weight of choice, is the image under that light.
    ///
    /// # Errors
    /// As of [`dual`](Self::dual); pixels out of range are left out.
    pub fn patches(
        &self,
        patches: &[Vec<usize>],
        recovery: &Recovery,
    ) -> Result<Vec<Vec<f64>>, InverseError> {
        let products: Vec<Vec<f64>> = patches
            .iter()
            .map(|patch| {
                let mut light = vec![0.0; self.camera];
                for pixel in patch {
                    light.get_mut(*pixel).into_iter().for_each(|light| *light = 1.0);
                }
                self.products(&light)
            })
            .collect::<Result<_, _>>()?;
        let greatest = |values: &[f64]| values.iter().fold(0.0, |most: f64, v| most.max(v.abs()));
        let most = products.iter().map(|products| greatest(products)).fold(0.0, f64::max);
        let solve = |products: &Vec<f64>| {
            if greatest(products) <= BLACK * most {
                return Ok(vec![0.0; self.patterns.pixels()]);
            }
            recovery.solve(&self.patterns, products)
        };
        products.par_iter().map(solve).collect()
    }

    fn products(&self, light: &[f64]) -> Result<Vec<f64>, InverseError> {
        same("intensities", light.len(), self.camera)?;
        let mut products = vec![0.0; self.patterns.count()];
        for (row, light) in self.images.chunks_exact(self.patterns.count()).zip(light) {
            products.iter_mut().zip(row).for_each(|(sum, own)| *sum += own * light);
        }
        Ok(products)
    }
}

impl Recovery {
    /// The sparsest image whose products with the patterns are about these.
    fn solve(&self, patterns: &Patterns, products: &[f64]) -> Result<Vec<f64>, InverseError> {
        let [width, height] = self.size;
        for (what, value) in [("the width", width), ("the height", height)] {
            if !value.is_power_of_two() {
                return Err(InverseError::PowerOfTwo { what, value });
            }
        }
        same("pixels", width * height, patterns.pixels())?;
        let haar = Haar::new(width, height);
        let backward = |coefficients: &[f64]| {
            let mut image = coefficients.to_vec();
            haar.backward(&mut image);
            image
        };
        let step = 1.0 / greatest_square(patterns)?;
        let mut own = vec![0.0; patterns.pixels()];
        let mut ahead = own.clone();
        let mut momentum = 1.0_f64;
        let mut threshold = None;
        for _ in 0..self.iterations.max(1) {
            let residual: Vec<f64> = patterns
                .multiply(&backward(&ahead))?
                .iter()
                .zip(products)
                .map(|(own, wanted)| wanted - own)
                .collect();
            let mut slope = patterns.transposed(&residual)?;
            haar.forward(&mut slope);
            // At first the slope is that of the products alone.
            let threshold = *threshold.get_or_insert_with(|| {
                step * self.sparsity * slope.iter().fold(0.0, |most: f64, v| most.max(v.abs()))
            });
            let next = 0.5 * (1.0 + (1.0 + 4.0 * momentum * momentum).sqrt());
            for ((own, ahead), slope) in own.iter_mut().zip(&mut ahead).zip(slope) {
                let moved = *ahead + step * slope;
                let shrunk = (moved.abs() - threshold).max(0.0).copysign(moved);
                *ahead = shrunk + (momentum - 1.0) / next * (shrunk - *own);
                *own = shrunk;
            }
            momentum = next;
        }
        Ok(backward(&own))
    }
}

/// The square of the greatest singular value of the patterns' matrix, slightly over.
fn greatest_square(patterns: &Patterns) -> Result<f64, InverseError> {
    let mut values: Vec<f64> =
        (0..patterns.pixels()).map(|i| Sampler::new(1, i as u64, 0).number() - 0.5).collect();
    let mut square = 1.0;
    for _ in 0..POWER_ROUNDS {
        let length = values.iter().map(|value| value * value).sum::<f64>().sqrt();
        values.iter_mut().for_each(|value| *value /= length.max(f64::MIN_POSITIVE));
        values = patterns.transposed(&patterns.multiply(&values)?)?;
        square = values.iter().map(|value| value * value).sum::<f64>().sqrt();
    }
    Ok(1.1 * square)
}

/// Box and Muller 1958.
pub(super) fn gaussian(sampler: &mut Sampler) -> f64 {
    let [radius, angle] = sampler.pair();
    (-2.0 * (1.0 - radius).ln()).sqrt() * (TAU * angle).cos()
}

/// An image's transform by Haar's wavelets in two dimensions, orthonormal: Haar 1910; Mallat 1989
/// on the pyramid.
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
        values[start + i * stride] = (a + b) * FRAC_1_SQRT_2;
        values[start + (count / 2 + i) * stride] = (a - b) * FRAC_1_SQRT_2;
    }
}

/// The inverse of [`split`].
fn join(values: &mut [f64], start: usize, stride: usize, count: usize) {
    let line: Vec<f64> = (0..count).map(|i| values[start + i * stride]).collect();
    for i in 0..count / 2 {
        let (sum, difference) = (line[i], line[count / 2 + i]);
        values[start + 2 * i * stride] = (sum + difference) * FRAC_1_SQRT_2;
        values[start + (2 * i + 1) * stride] = (sum - difference) * FRAC_1_SQRT_2;
    }
}
