//! Histograms of the directions from which photons came to a place.
//!
//! Zhu et al. 2020, "Photon-Driven Neural Path Guiding", without its network, and with cells of one
//! size: photons by cubes of space, directions by bins of equal solid angle. Theirs is one part of a
//! mixture; here only what exceeds BSDF sampling is kept, for branches.

use std::collections::HashMap;
use std::f64::consts::{PI, TAU};

use glam::DVec3;
use rayon::prelude::*;

use super::{Photon, cube};
use crate::sampler::pick;
use crate::scene::extent;

/// Cubes along the diagonal of all photons' positions. More tell more places apart, with fewer
/// photons each.
const CUBES: f32 = 8.0;
/// Bins around the axis and along it. More tell small sources apart, but need more photons.
const COLUMNS: usize = 16;
const ROWS: usize = COLUMNS / 2;
/// Solid angle of a bin, steradians.
const BIN: f64 = 4.0 * PI / (COLUMNS * ROWS) as f64;
/// Photons that a histogram needs. What fewer ones show is chance: branches into it take time, and
/// nothing from the noise.
const LEAST_PHOTONS: usize = 32;
/// Branches per surface, on average: fewer are not worth their time, and more are scaled down.
const LEAST_SHARE: f64 = 0.05;
const GREATEST_SHARE: f64 = 0.8;

/// Histograms by place.
#[derive(Clone, Debug)]
pub(crate) struct Grid {
    /// Metres.
    side: f32,
    histograms: HashMap<[i32; 4], Histogram>,
}

/// Directions from which a place gets more light than BSDF sampling expects.
#[derive(Clone, Debug)]
pub(crate) struct Histogram {
    /// Branches per surface towards each bin, on average, and their running sum.
    shares: Vec<f64>,
    cumulative: Vec<f64>,
}

impl Grid {
    pub(super) fn learn(photons: &[Photon]) -> Self {
        let extent = extent(photons.iter().map(|photon| photon.position));
        let side = (extent.length() / CUBES).max(f32::MIN_POSITIVE);
        let mut cubes: HashMap<[i32; 4], Vec<&Photon>> = HashMap::new();
        for photon in photons {
            cubes.entry(cube(photon.position, photon.normal, side)).or_default().push(photon);
        }
        let learn = |(key, photons): ([i32; 4], Vec<&Photon>)| {
            Histogram::learn(&photons).map(|histogram| (key, histogram))
        };
        Self { side, histograms: cubes.into_par_iter().filter_map(learn).collect() }
    }

    /// What sends light to a place on a surface with `normal`.
    pub(super) fn at(&self, position: DVec3, normal: DVec3) -> Option<&Histogram> {
        self.histograms.get(&cube(position.as_vec3(), normal.as_vec3(), self.side))
    }
}

impl Histogram {
    /// Learns from the `photons` of one place; `None` where they show no more than BSDF sampling
    /// finds by itself.
    fn learn(photons: &[&Photon]) -> Option<Self> {
        if photons.len() < LEAST_PHOTONS {
            return None;
        }
        let mut powers = vec![0.0; COLUMNS * ROWS];
        let mut normal = DVec3::ZERO;
        for photon in photons {
            let direction = photon.source.as_dvec3() - photon.position.as_dvec3();
            powers[bin(direction.normalize_or_zero())] += f64::from(photon.power);
            normal += photon.normal.as_dvec3();
        }
        let normal = normal.normalize_or_zero();
        let middle = |i| within(i, 0.5, 0.5);
        let cosines: Vec<f64> = (0..powers.len()).map(|i| middle(i).dot(normal).max(0.0)).collect();
        let (total, even) = (powers.iter().sum::<f64>(), cosines.iter().sum::<f64>());
        let excess = |(power, cosine): (&f64, &f64)| (power / total - cosine / even).max(0.0);
        let mut shares: Vec<f64> = powers.iter().zip(&cosines).map(excess).collect();
        let share: f64 = shares.iter().sum();
        let scale = (GREATEST_SHARE / share).min(1.0);
        shares.iter_mut().for_each(|share| *share *= scale);
        let running = |sum: &mut f64, share: &f64| {
            *sum += share;
            Some(*sum)
        };
        let cumulative = shares.iter().scan(0.0, running).collect();
        (share >= LEAST_SHARE).then_some(Self { shares, cumulative })
    }

    /// Branches per surface that [`sample`](Self::sample) should give a direction, on average; below 1.
    pub(super) fn share(&self) -> f64 {
        self.cumulative[self.cumulative.len() - 1]
    }

    /// A direction, of unit length. `choice` is in [0, share).
    pub(super) fn sample(&self, choice: f64, [u, v]: [f64; 2]) -> DVec3 {
        within(pick(&self.cumulative, choice / self.share()).unwrap_or(0), u, v)
    }

    /// Share × density per steradian with which [`sample`](Self::sample) takes `direction`, a unit
    /// vector.
    pub(super) fn density(&self, direction: DVec3) -> f64 {
        self.shares[bin(direction)] / BIN
    }
}

/// The bin of a direction: cylinders around a sphere have its areas.
fn bin(direction: DVec3) -> usize {
    let turn = (direction.y.atan2(direction.x) / TAU).rem_euclid(1.0);
    let index = |value: f64, count: usize| ((value * count as f64) as usize).min(count - 1);
    index(0.5 * (1.0 + direction.z), ROWS) * COLUMNS + index(turn, COLUMNS)
}

/// A direction in a bin; `u` and `v` are in [0, 1).
fn within(bin: usize, u: f64, v: f64) -> DVec3 {
    let z = 2.0 * ((bin / COLUMNS) as f64 + u) / ROWS as f64 - 1.0;
    let turn = ((bin % COLUMNS) as f64 + v) / COLUMNS as f64;
    let radius = (1.0 - z * z).max(0.0).sqrt();
    let (sine, cosine) = (turn * TAU).sin_cos();
    DVec3::new(radius * cosine, radius * sine, z)
}

#[cfg(test)]
#[path = "histogram_tests.rs"]
mod tests;
