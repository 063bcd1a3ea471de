//! The shipped passes at extreme values, against 64-bit floats where these are finite.

pub(crate) mod counts;
pub(crate) mod energy;
pub(crate) mod filter;
pub(crate) mod gather;
pub(crate) mod history;
pub(crate) mod lights;
pub(crate) mod maps;
pub(crate) mod rays;
pub(crate) mod scenes;
pub(crate) mod shading;
pub(crate) mod views;

use bevy::math::{DVec3, Vec3};
use frugal::stage::{Component, Stage};
use frugal_tests::gpu::Point;
use frugal_tests::set;

/// Upper bound at which the gather clamps: brighter light is displayed as white anyway, and half
/// floats end at 65,504.
const WHITE: f64 = 65_000.0;

/// An empty stage, needed for its device.
fn stage() -> Stage {
    set::bare(vec![], set::radiance_options(32, 18, Component::Indirect))
}

/// A virtual point light that faces down and represents a disk.
fn facing_down(position: Vec3, flux: f32, radius_squared: f32) -> Point {
    Point {
        position: position.to_array(),
        normal: [0.0, -1.0, 0.0],
        flux: [flux; 3],
        extent: 1.0 / radius_squared,
    }
}

/// Largest error of 32-bit floats in the light of a VPL at a point, with `flux` in each channel: a
/// cosine is a sum of products of either sign, so its absolute error is 3e-7, whatever its value.
fn cosine_slack(vpl: &Point, position: DVec3, normal: DVec3, flux: f32, exposure: f32) -> f64 {
    let [from, facing] =
        [vpl.position, vpl.normal].map(|vector| DVec3::from_array(vector.map(f64::from)));
    let to_light = from - position;
    let square = to_light.length_squared().max(1e-18);
    let [receiver, emitter] =
        [normal, -facing].map(|normal| (normal.dot(to_light) / square.sqrt()).max(0.0));
    let lost = (receiver + 3e-7) * (emitter + 3e-7) - receiver * emitter;
    (lost / square).min(f64::from(vpl.extent)) * f64::from(flux) * f64::from(exposure)
        / std::f64::consts::PI
}

/// The largest of many deviations.
#[derive(Default)]
struct Worst {
    relative: f64,
    count: usize,
}

impl Worst {
    /// Compares a half float with its expected value. `slack` is the absolute error allowed for
    /// 32-bit floats.
    #[track_caller]
    fn check(&mut self, label: &str, found: f64, expected: f64, slack: f64) {
        assert!(found.is_finite() && found >= 0.0, "{label}: {found}, {expected} expected");
        let expected = expected.min(WHITE);
        // Half floats are rounded to 2⁻¹¹ of their value, or down by up to 2⁻¹⁰, and below 6e-5 to
        // multiples of 6e-8.
        let off = (found - expected).abs() - slack - 6e-8;
        assert!(off < 1e-3 * expected, "{label}: {found}, {expected} expected");
        if expected > 1e-4 && slack < 1e-3 * expected {
            self.relative = self.relative.max((found / expected - 1.0).abs());
            self.count += 1;
        }
    }

    #[track_caller]
    fn report(&self, label: &str, least: usize) {
        println!("    {label}: off by at most {:.1e} over {} values", self.relative, self.count);
        assert!(
            self.relative < 1e-3 && self.count >= least,
            "{label}: {} values are too few, or the error is too large",
            self.count
        );
    }
}

/// Pseudo-random numbers in [0, 1), the same in every run.
struct Random(u32);

impl Random {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
        (self.0 >> 8) as f32 / (1 << 24) as f32
    }

    /// A point in the box between two corners.
    fn inside(&mut self, least: Vec3, most: Vec3) -> Vec3 {
        least + (most - least) * Vec3::new(self.next(), self.next(), self.next())
    }

    /// A unit vector, uniformly distributed.
    fn direction(&mut self) -> Vec3 {
        let (z, turn) = (2.0 * self.next() - 1.0, std::f32::consts::TAU * self.next());
        let across = (1.0 - z * z).max(0.0).sqrt();
        Vec3::new(across * turn.cos(), across * turn.sin(), z)
    }
}
