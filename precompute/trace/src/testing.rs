//! Means with their errors, and Pearson's chi-square test of samples against the density that they are
//! said to have.

use std::f64::consts::{FRAC_1_SQRT_2, PI, TAU};

use glam::DVec3;

use crate::guide::around;
use crate::sampler::Sampler;

/// Samples of a test.
pub(crate) const COUNT: u64 = 1 << 16;
/// Points along each side of a cell at which the density is integrated.
const FINE: usize = 48;
/// Least expected count of a cell; those with fewer are merged.
const LEAST_EXPECTED: f64 = 5.0;
/// Least chance of a statistic as great as the one found. Seeds are fixed: no run fails by chance.
const LEAST_CHANCE: f64 = 1e-4;

/// Mean and its standard error.
#[cfg(any(feature = "media", all(feature = "caustics", feature = "time")))]
pub(crate) fn statistics(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let values: Vec<f64> = values.collect();
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
    (mean, (variance / (count - 1.0) / count).sqrt())
}

/// How well counts fit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fit {
    statistic: f64,
    degrees: f64,
}

impl Fit {
    /// Of `observed` counts in cells against the `expected` ones, whose sums are equal.
    pub(crate) fn new(observed: &[f64], expected: &[f64]) -> Self {
        let mut cells: Vec<_> = expected.iter().copied().zip(observed.iter().copied()).collect();
        cells.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (mut statistic, mut degrees) = (0.0, -1.0);
        let (mut merged, mut left) = ((0.0, 0.0), expected.iter().sum::<f64>());
        for (expected, observed) in cells {
            merged = (merged.0 + expected, merged.1 + observed);
            left -= expected;
            // A last cell that is too small is no cell of its own.
            if merged.0 >= LEAST_EXPECTED && (left >= LEAST_EXPECTED || left <= 1e-9 * merged.0) {
                statistic += (merged.1 - merged.0).powi(2) / merged.0;
                degrees += 1.0;
                merged = (0.0, 0.0);
            }
        }
        Self { statistic, degrees }
    }

    /// Chance of a statistic at least as great where samples have their density: Wilson and
    /// Hilferty 1931, "The Distribution of Chi-Square", equation 2.
    pub(crate) fn chance(&self) -> f64 {
        let spread = 2.0 / (9.0 * self.degrees);
        let deviation = (self.statistic / self.degrees).cbrt() - (1.0 - spread);
        0.5 * complementary_error(deviation / spread.sqrt() * FRAC_1_SQRT_2)
    }

    /// Fails where samples do not have their density.
    #[track_caller]
    pub(crate) fn assert(&self, name: &str) {
        let chance = self.chance();
        println!("{name}: {:.1} of {} degrees, p = {chance:.4}", self.statistic, self.degrees);
        assert!(self.degrees >= 1.0 && chance > LEAST_CHANCE, "{name}: {self:?}, p = {chance:e}");
    }
}

/// Abramowitz and Stegun 1964, "Handbook of Mathematical Functions", 7.1.26: within 1.5e-7.
fn complementary_error(x: f64) -> f64 {
    if x < 0.0 {
        return 2.0 - complementary_error(-x);
    }
    let t = 1.0 / (1.0 + 0.327_591_1 * x);
    let factors = [1.061_405_429, -1.453_152_027, 1.421_413_741, -0.284_496_736, 0.254_829_592];
    factors.iter().fold(0.0, |sum, factor| sum * t + factor) * t * (-x * x).exp()
}

/// Points of the unit square against their `density`, in `columns` × `rows` equal cells. What
/// `sample` gives none of is one more cell, of what the density leaves.
pub(crate) fn fit_square(
    cells: [usize; 2],
    sample: impl Fn(&mut Sampler) -> Option<[f64; 2]>,
    density: impl Fn([f64; 2]) -> f64,
) -> Fit {
    fit_cells(cells, FINE, sample, density)
}

fn fit_cells(
    [columns, rows]: [usize; 2],
    fine: usize,
    sample: impl Fn(&mut Sampler) -> Option<[f64; 2]>,
    density: impl Fn([f64; 2]) -> f64,
) -> Fit {
    let mut observed = vec![0.0; columns * rows + 1];
    let mut astray = 0;
    for pixel in 0..COUNT {
        // One sample a pixel: stratified ones would fit too well.
        let cell = sample(&mut Sampler::new(29, pixel, 0)).map(|[u, v]| {
            assert!((0.0..=1.0).contains(&u) && (0.0..=1.0).contains(&v), "{u} {v}");
            astray += u64::from(density([u, v]) <= 0.0);
            let index = |x: f64, count: usize| ((x * count as f64) as usize).min(count - 1);
            index(v, rows) * columns + index(u, columns)
        });
        observed[cell.unwrap_or(columns * rows)] += 1.0;
    }
    // Rounding takes a few over an edge of the density.
    assert!(astray * 2000 < COUNT, "{astray} samples of density 0");
    // One row has no second coordinate.
    let (across, down) = (fine, if rows == 1 { 1 } else { fine });
    let share = COUNT as f64 / (columns * across * rows * down) as f64;
    let mut expected = vec![0.0; columns * rows + 1];
    for row in 0..rows * down {
        let v = (row as f64 + 0.5) / (rows * down) as f64;
        for column in 0..columns * across {
            let u = (column as f64 + 0.5) / (columns * across) as f64;
            expected[row / down * columns + column / across] += density([u, v]) * share;
        }
    }
    let (sum, none) = (expected.iter().sum::<f64>(), observed[columns * rows]);
    let total = COUNT as f64;
    // The quadrature's own error must not stand for samples that were never missing.
    if none == 0.0 || sum > total {
        assert!((sum / total - 1.0).abs() < 0.01, "a density's integral is {}", sum / total);
        expected.iter_mut().for_each(|expected| *expected *= (total - none) / sum);
        expected[columns * rows] = none;
    } else {
        expected[columns * rows] = total - sum;
    }
    Fit::new(&observed, &expected)
}

/// Unit vectors against their `density`, per steradian. Rings around `axis` have equal solid angles
/// for a `focus` of 1, and are the finer near the axis the greater it is.
pub(crate) fn fit_directions(
    rings: (DVec3, i32),
    sample: impl Fn(&mut Sampler) -> Option<DVec3>,
    density: impl Fn(DVec3) -> f64,
) -> Fit {
    fit_edges(rings, FINE, sample, density)
}

/// As [`fit_directions`], for a density with edges: `fine`² points integrate it in each cell.
pub(crate) fn fit_edges(
    (axis, focus): (DVec3, i32),
    fine: usize,
    sample: impl Fn(&mut Sampler) -> Option<DVec3>,
    density: impl Fn(DVec3) -> f64,
) -> Fit {
    let (right, up) = axis.any_orthonormal_pair();
    let place = |direction: DVec3| {
        assert!((direction.length() - 1.0).abs() < 1e-9, "{direction}");
        let height = (0.5 * (1.0 - direction.dot(axis))).clamp(0.0, 1.0);
        let turn = direction.dot(up).atan2(direction.dot(right)) / TAU;
        [turn.rem_euclid(1.0), height.powf(1.0 / f64::from(focus))]
    };
    let density = |[turn, ring]: [f64; 2]| {
        let solid_angle = 4.0 * PI * f64::from(focus) * ring.powi(focus - 1);
        density(around(axis, 1.0 - 2.0 * ring.powi(focus), turn)) * solid_angle
    };
    fit_cells([16, 16], fine, |sampler| sample(sampler).map(place), density)
}

#[test]
fn quantiles_are_those_of_the_tables() {
    for (degrees, statistic, chance) in
        [(5.0, 11.070, 0.05), (10.0, 23.209, 0.01), (100.0, 149.449, 1e-3), (30.0, 29.336, 0.5)]
    {
        let found = Fit { statistic, degrees }.chance();
        assert!((found / chance - 1.0).abs() < 0.03, "{found} for {chance}");
    }
}

#[test]
fn small_cells_are_merged() {
    let fit = Fit::new(&[1.0, 99.0, 1.0, 101.0, 3.0], &[2.0, 100.0, 2.0, 100.0, 1.0]);
    // 5 for 5, 99 and 101 for 100.
    assert!((fit.statistic - 0.02).abs() < 1e-12 && fit.degrees == 2.0, "{fit:?}");
    let fit = Fit::new(&[1.0, 1.0, 98.0], &[1.0, 1.0, 98.0]);
    assert!(fit.degrees < 1.0, "{fit:?}");
}

#[test]
fn wrong_densities_are_refused() {
    let skewed = |power: f64| {
        fit_square(
            [16, 16],
            |sampler| Some(sampler.pair()).map(|[u, v]| [u.powf(power), v]),
            |_| 1.0,
        )
    };
    skewed(1.0).assert("numbers");
    assert!(skewed(1.1).chance() < LEAST_CHANCE, "{:?}", skewed(1.1));
    // A share that goes missing, and one that the density does not expect.
    let missing = |lost: f64, kept: f64| {
        fit_square(
            [16, 16],
            |sampler| (sampler.number() >= lost).then(|| sampler.pair()),
            move |_| kept,
        )
    };
    missing(0.3, 0.7).assert("a share");
    assert!(missing(0.33, 0.7).chance() < LEAST_CHANCE);
    let cosine = |direction: DVec3| direction.y.max(0.0) / PI;
    let lifted = |height: f64| {
        fit_directions(
            (DVec3::Y, 1),
            |sampler| {
                let [u, v] = sampler.pair();
                Some(around(DVec3::Y, u.powf(height), v))
            },
            cosine,
        )
    };
    lifted(0.5).assert("by the cosine");
    assert!(lifted(0.55).chance() < LEAST_CHANCE, "{:?}", lifted(0.55));
}
