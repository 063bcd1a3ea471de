//! Radii that shrink with the number of photons, one for each pixel.

use std::f64::consts::PI;

use glam::DVec3;

use super::gather::{Gathered, Point};
use super::map::PhotonMap;
use super::split::{Caustics, Density};

/// Radius of the estimate of curvature, in radii of the first pass: second derivatives are noisier
/// than values.
const PILOT: f64 = 2.0;
/// Greatest and least adaptive radius, in radii of the first pass.
const GREATEST: f64 = 1.5;
const LEAST: f64 = 0.05;

/// A pixel's radius and sums.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Progress {
    /// Sum of the passes, nits.
    sum: DVec3,
    passes: u32,
    /// Radius of the first pass, metres, and of the next one; 0 before the first.
    first: f64,
    radius: f64,
    /// Photons that count so far, for `Counted`.
    count: f64,
    /// Sums of squared contributions per area and of the Laplacian, for `Adaptive`.
    squares: f64,
    laplacian: f64,
}

impl Progress {
    /// Adds one pass: the light of `points`, from a map of `count` photons that left lights.
    pub(super) fn add(
        &mut self,
        caustics: &Caustics,
        map: &PhotonMap,
        count: f64,
        points: &[Point],
        reach: f64,
    ) {
        self.passes += 1;
        let first = match caustics.density {
            Density::Nearest { count: nearest } => {
                for point in points {
                    self.sum += point.nearest(caustics, map, nearest, reach).radiance / count;
                }
                return;
            }
            Density::Progressive { first, .. }
            | Density::Counted { first, .. }
            | Density::Adaptive { first, .. } => first,
        };
        if self.first == 0.0 {
            let Some(point) = points.first() else { return };
            self.first = point.nearest(caustics, map, first, reach).radius;
            self.radius = self.first;
        }
        let mut all = Gathered::default();
        for point in points {
            let gathered = point.within(caustics, map, self.radius, |_, _| ());
            self.sum += gathered.radiance / count;
            all.count += gathered.count;
        }
        self.shrink(caustics, map, count, points, &all);
    }

    /// The mean of the passes, nits.
    pub(super) fn mean(&self) -> DVec3 {
        self.sum / f64::from(self.passes.max(1))
    }

    fn shrink(
        &mut self,
        caustics: &Caustics,
        map: &PhotonMap,
        count: f64,
        points: &[Point],
        all: &Gathered,
    ) {
        let passes = f64::from(self.passes);
        match caustics.density {
            Density::Nearest { .. } => (),
            Density::Progressive { alpha, .. } => {
                let alpha = f64::from(alpha).clamp(0.0, 1.0);
                self.radius *= ((passes + alpha) / (passes + 1.0)).sqrt();
            }
            Density::Counted { alpha, .. } => {
                let (found, alpha) = (f64::from(all.count), f64::from(alpha).clamp(0.0, 1.0));
                if found > 0.0 {
                    let kept = self.count + alpha * found;
                    self.radius *= (kept / (self.count + found)).sqrt();
                    self.count = kept;
                }
            }
            Density::Adaptive { .. } => {
                // The best radius of the pilot falls with the tenth root of the photons.
                let pilot = self.first * PILOT * passes.powf(-0.1);
                for point in points {
                    let mut laplacian = 0.0;
                    let near = point.within(caustics, map, pilot, |s, light| {
                        // Of the kernel 4/(π h²) (1 − s)³, with s = distance²/h².
                        laplacian += 48.0 * (1.0 - s) * (3.0 * s - 1.0) * light;
                    });
                    self.squares += near.squares / count;
                    self.laplacian += laplacian / (PI * pilot.powi(4) * count);
                }
                let (squares, laplacian) = (self.squares / passes, self.laplacian / passes);
                self.radius = balanced(squares, laplacian, count, passes + 1.0)
                    .clamp(self.first * LEAST, self.first * GREATEST)
                    .min(self.first * GREATEST);
            }
        }
    }
}

/// The radius of pass number `pass`, of `count` photons each, that makes the error of the mean of
/// all passes least.
///
/// With a constant kernel a pass has the variance `squares` / (π r² count) and the bias r² Δ / 8.
/// Of the mean over n passes with r ∝ n^(−1/6), these are 3/4 and 3/2 of what n passes with the last
/// radius would have: error² = 3/4 A/r² + 9/4 B r⁴ is least at r⁶ = A/(6 B).
fn balanced(squares: f64, laplacian: f64, count: f64, pass: f64) -> f64 {
    let noise = squares / (PI * count * pass);
    let blur = (laplacian / 8.0).powi(2);
    let radius = (noise / (6.0 * blur)).powf(1.0 / 6.0);
    // No photons, or no curvature.
    if radius.is_nan() { f64::INFINITY } else { radius }
}
