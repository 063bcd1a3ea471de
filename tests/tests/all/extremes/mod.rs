//! The shipped passes where numbers get extreme, against 64-bit floats where these are finite.

pub mod counts;
pub mod energy;
pub mod filter;
pub mod gather;
pub mod history;
pub mod lights;
pub mod maps;
pub mod rays;
pub mod scenes;
pub mod shading;
pub mod views;

use bevy::math::{DVec3, Vec3};
use frugal::stage::{Component, Stage};
use frugal_tests::gpu::Point;
use frugal_tests::set;

/// Where the gather cuts light off: what is brighter is white anyway, and half floats end at
/// 65,504.
const WHITE: f64 = 65_000.0;

/// An empty stage, for its device.
fn stage() -> Stage {
    set::bare(vec![], set::radiance_options(32, 18, Component::Indirect))
}

/// A virtual point light that faces down and stands for a disk.
fn facing_down(position: Vec3, flux: f32, radius_squared: f32) -> Point {
    Point {
        position: position.to_array(),
        normal: [0.0, -1.0, 0.0],
        flux: [flux; 3],
        extent: 1.0 / radius_squared,
    }
}

/// What 32-bit floats may lose of the light of a VPL at a point, each channel's flux being `flux`:
/// a cosine is a sum of products of either sign, which they know to 3e-7, not to a share of itself.
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
    /// Takes note of a half float that should be `expected`. `slack` is how much 32-bit floats may
    /// lose of it.
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
            "{label}: {} values say nothing",
            self.count
        );
    }
}

/// Numbers in [0, 1) that look random and are the same in every run.
struct Random(u32);

impl Random {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
        (self.0 >> 8) as f32 / (1 << 24) as f32
    }

    /// Between two corners.
    fn inside(&mut self, least: Vec3, most: Vec3) -> Vec3 {
        least + (most - least) * Vec3::new(self.next(), self.next(), self.next())
    }

    /// Unit length, all directions alike.
    fn direction(&mut self) -> Vec3 {
        let (z, turn) = (2.0 * self.next() - 1.0, std::f32::consts::TAU * self.next());
        let across = (1.0 - z * z).max(0.0).sqrt();
        Vec3::new(across * turn.cos(), across * turn.sin(), z)
    }
}
