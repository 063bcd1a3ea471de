//! Burley 2020, "Practical Hash-based Owen Scrambling", <https://jcgt.org/published/0009/04/01/>:
//! the first two dimensions of Sobol's sequence, shuffled and Owen-scrambled by hashes.
//!
//! Every pair of numbers of a path is a pair of that sequence with its own shuffle and scramble, so
//! that the samples of a pixel are stratified in every pair and independent between pairs and
//! between pixels. A number depends only on seed, pixel, sample and dimension: images do not depend
//! on the number of threads.

/// The random numbers of one sample of one pixel.
#[derive(Clone, Debug)]
pub(crate) struct Sampler {
    pixel: u64,
    sample: u32,
    dimension: u64,
}

impl Sampler {
    /// Numbers for sample number `sample` of pixel number `pixel`.
    pub(crate) fn new(seed: u64, pixel: u64, sample: u32) -> Self {
        Self { pixel: mix(mix(seed) ^ pixel), sample, dimension: 0 }
    }

    /// The next number, in [0, 1).
    pub(crate) fn number(&mut self) -> f64 {
        self.pair()[0]
    }

    /// The next two numbers, each in [0, 1), stratified together.
    pub(crate) fn pair(&mut self) -> [f64; 2] {
        let key = mix(self.pixel.wrapping_add(self.dimension));
        self.dimension += 1;
        let order = mix(key);
        let index = scramble(self.sample, order as u32);
        [
            unit(scramble(index.reverse_bits(), (order >> 32) as u32)),
            unit(scramble(sobol(index), key as u32)),
        ]
    }
}

/// Where `choice`, in [0, 1), falls among running sums of weights; `None` without any.
pub(crate) fn pick(cumulative: &[f64], choice: f64) -> Option<usize> {
    let wanted = choice * cumulative.last()?;
    Some(cumulative.partition_point(|sum| *sum <= wanted).min(cumulative.len() - 1))
}

/// `SplitMix64`'s finaliser (Steele, Lea and Flood 2014, "Fast Splittable Pseudorandom Number
/// Generators").
fn mix(value: u64) -> u64 {
    let value = value.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let value = (value ^ (value >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let value = (value ^ (value >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    value ^ (value >> 31)
}

/// Owen's scramble: every binary digit is flipped or not by a hash of the digits before it.
fn scramble(value: u32, seed: u32) -> u32 {
    // Laine and Karras 2011, with the constants that Burley gives.
    let mut x = value.reverse_bits().wrapping_add(seed);
    for factor in [0x6c50_b47c, 0xb82f_1e52, 0xc7af_e638, 0x8d22_f6e6] {
        x ^= x.wrapping_mul(factor);
    }
    x.reverse_bits()
}

/// The second dimension of Sobol's sequence; the first is the index with its bits reversed.
fn sobol(mut index: u32) -> u32 {
    let (mut value, mut direction) = (0, 1 << 31);
    while index != 0 {
        if index & 1 != 0 {
            value ^= direction;
        }
        index >>= 1;
        direction ^= direction >> 1;
    }
    value
}

fn unit(bits: u32) -> f64 {
    f64::from(bits) * (-32.0_f64).exp2()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{COUNT, Fit, fit_square};

    fn pairs(seed: u64, pixel: u64, dimension: usize, count: u32) -> Vec<[f64; 2]> {
        let pair_of = |sample| {
            let mut sampler = Sampler::new(seed, pixel, sample);
            for _ in 0..dimension {
                sampler.pair();
            }
            sampler.pair()
        };
        (0..count).map(pair_of).collect()
    }

    #[test]
    fn every_pair_is_stratified() {
        // A (0, 2)-sequence: 64 points fall one each into 64 elementary intervals of any shape.
        for dimension in [0, 1, 7] {
            let points = pairs(3, 11, dimension, 64);
            for (columns, rows) in [(64, 1), (8, 8), (1, 64), (16, 4)] {
                let cell = |[x, y]: [f64; 2]| {
                    (x * f64::from(columns)) as usize * rows + (y * rows as f64) as usize
                };
                let mut intervals: Vec<usize> = points.iter().copied().map(cell).collect();
                intervals.sort_unstable();
                assert!(
                    intervals.into_iter().eq(0..64),
                    "{columns}×{rows} in dimension {dimension}"
                );
            }
        }
    }

    #[test]
    fn pixels_dimensions_and_seeds_are_independent() {
        // Products of independent numbers have the mean 1/4 and the variance 7/144.
        let count = 4096_u32;
        for (seed, pixel, dimension) in [(3, 12, 0), (4, 11, 0), (3, 11, 1), (3, 11, 2)] {
            let mean = |pick: usize| {
                // One sample a pixel: stratification would hide a correlation.
                let products = (0..count).map(|i| {
                    let pair_of = |seed, pixel, dimension: usize| {
                        let mut sampler = Sampler::new(seed, pixel + u64::from(i) * 1000, 0);
                        for _ in 0..dimension {
                            sampler.pair();
                        }
                        sampler.pair()
                    };
                    pair_of(3, 11, 0)[0] * pair_of(seed, pixel, dimension)[pick]
                });
                products.sum::<f64>() / f64::from(count)
            };
            let tolerance = 4.0 * (7.0_f64 / 144.0 / f64::from(count)).sqrt();
            for pick in [0, 1] {
                assert!(
                    (mean(pick) - 0.25).abs() < tolerance,
                    "{seed} {pixel} {dimension}: {}",
                    mean(pick)
                );
            }
        }
    }

    #[test]
    fn numbers_are_below_one() {
        assert!(unit(u32::MAX) < 1.0 && unit(0) == 0.0);
        assert_eq!(pairs(1, 2, 3, 16), pairs(1, 2, 3, 16));
    }

    #[test]
    fn numbers_are_uniform_in_pairs_and_between_them() {
        type Numbers = fn(&mut Sampler) -> [f64; 2];
        let cases: [(&str, Numbers); 4] = [
            ("a pair", Sampler::pair),
            ("the third pair", |sampler| [sampler.pair(), sampler.pair(), sampler.pair()][2]),
            ("two numbers", |sampler| [sampler.number(), sampler.number()]),
            ("seconds of two pairs", |sampler| [sampler.pair()[1], sampler.pair()[1]]),
        ];
        for (name, numbers) in cases {
            let fit = fit_square([16, 16], |sampler| Some(numbers(sampler)), |_| 1.0);
            fit.assert(name);
        }
        let mut neighbours = [0.0; 256];
        let number = |seed, pixel, sample| Sampler::new(seed, pixel, sample).number();
        for pixel in 0..COUNT {
            let [u, v] = [number(3, 2 * pixel, 0), number(3, 2 * pixel + 1, 0)];
            neighbours[(u * 16.0) as usize * 16 + (v * 16.0) as usize] += 1.0;
        }
        Fit::new(&neighbours, &[COUNT as f64 / 256.0; 256]).assert("two pixels");
        // A sample's number in every pixel, and the first one by seed.
        for name in ["sample 5 of pixels", "seeds"] {
            let mut observed = [0.0; 64];
            for i in 0..COUNT {
                let number = if name == "seeds" { number(i, 0, 0) } else { number(3, i, 5) };
                observed[(number * 64.0) as usize] += 1.0;
            }
            Fit::new(&observed, &[COUNT as f64 / 64.0; 64]).assert(name);
        }
    }

    #[test]
    fn picks_are_in_proportion_to_weights() {
        let weights = [0.0, 1.0, 3.0, 0.0, 0.5, 1e-3, 2.0, 0.0];
        let cumulative: Vec<f64> = weights
            .iter()
            .scan(0.0, |sum, weight| {
                *sum += weight;
                Some(*sum)
            })
            .collect();
        let mut observed = [0.0; 8];
        for i in 0..COUNT {
            let index = pick(&cumulative, Sampler::new(3, i, 0).number()).unwrap();
            assert!(weights[index] > 0.0, "{index} has no weight");
            observed[index] += 1.0;
        }
        Fit::new(&observed, &weights.map(|weight| weight / 6.501 * COUNT as f64)).assert("picks");
    }
}
