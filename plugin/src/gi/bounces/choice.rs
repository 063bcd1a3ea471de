//! A patch, where a camera's patches are dense, and the selection of the points of the scene's
//! surfaces that become patches: plain Rust, no renderer.
//!
//! Priority sampling (Duffield, Lund and Thorup 2007, "Priority sampling for estimation of
//! arbitrary subset sums"): every point has a weight and a permanent rank, and its priority is
//! weight ÷ rank. The `count` points of the highest priorities are selected; each counts for the
//! larger of its own weight and the threshold, the highest priority that was not selected. The
//! expectation of the sum over the selection is the sum over all points (up to one part in 2 ×
//! count, since ranks here are stratified and not independent). Where something moves, appears or
//! disappears, all other points keep their patches, except a few at the threshold.

use bevy::ecs::entity::Entity;
use bevy::math::Vec3;
use bytemuck::{Pod, Zeroable};

use crate::gi::surfaces::MaterialSample;
use crate::gi::texels::pack_normal;

/// Patches of a camera. Fewer: blotchier second bounces. More: proportionally more rays, eight per
/// patch.
pub(in crate::gi) const PATCHES: usize = 2048;

/// Distance from the camera at which patches are half as dense, as a share of the range.
const NEAR_SHARE: f32 = 0.1;
/// Step in which the centre of density follows the camera, as a share of that distance: patches
/// stay while the camera moves within a step.
const STEP_SHARE: f32 = 0.25;

/// A piece of surface that reflects incident light: `bounces/reflect.wgsl`'s `Patch`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(in crate::gi) struct Patch {
    /// World space, metres.
    pub position: [f32; 3],
    /// m².
    pub area: f32,
    /// Colour and roughness, and further properties, as Bevy's G-buffer packs them.
    color: u32,
    properties: u32,
    packed_normal: u32,
    padding: u32,
}

impl Patch {
    /// A patch; `normal` is a unit vector in world space.
    pub(crate) fn new(position: Vec3, area: f32, normal: Vec3, material: &MaterialSample) -> Self {
        let byte = |value: f32| (value * 255.0).round() as u8;
        let pack = |values: [f32; 4]| u32::from_le_bytes(values.map(byte));
        let [red, green, blue] = material.color.to_array().map(|linear| linear.powf(1.0 / 2.2));
        Self {
            position: position.to_array(),
            area,
            color: pack([red, green, blue, material.roughness]),
            properties: pack([material.reflectance, material.metallic, 0.0, 0.0]),
            packed_normal: pack_normal(normal),
            padding: 0,
        }
    }
}

/// A point that may become a patch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Candidate<T> {
    /// m².
    pub area: f32,
    /// Relative density of patches per m². Above 0.
    pub density: f32,
    /// In (0, 1]: evenly distributed among any neighbouring points.
    pub rank: f32,
    pub point: T,
}

impl<T> Candidate<T> {
    fn priority(&self) -> f32 {
        self.area * self.density / self.rank
    }

    /// Whether its priority is finite and above `floor`.
    pub(super) fn is_above(&self, floor: f32) -> bool {
        let priority = self.priority();
        priority > floor && priority.is_finite() && self.density > 0.0
    }
}

/// The highest priority of those that are not among the `count` highest; `None` where there is none.
pub(super) fn threshold<T>(candidates: &[Candidate<T>], count: usize) -> Option<f32> {
    let mut priorities: Vec<f32> = candidates.iter().map(Candidate::priority).collect();
    (priorities.len() > count)
        .then(|| *priorities.select_nth_unstable_by(count, |a, b| b.total_cmp(a)).1)
}

/// Those of `candidates` whose priority exceeds the `threshold`, in their order, each with the area in m²
/// that it represents. All of them without a threshold.
pub(super) fn choose<T: Copy>(
    candidates: &[Candidate<T>],
    threshold: Option<f32>,
) -> impl Iterator<Item = (T, f32)> {
    let threshold = threshold.unwrap_or(0.0);
    let above = candidates.iter().filter(move |candidate| candidate.is_above(threshold));
    above.map(move |candidate| (candidate.point, candidate.area.max(threshold / candidate.density)))
}

/// Ranks of the points of one surface, which lie along a space-filling curve: any run of them is
/// evenly distributed over 0 to 1 (van der Corput 1935). `seed` shifts the ranks of different
/// surfaces against each other.
pub(super) fn rank(index: usize, seed: u32) -> f32 {
    let bits = (index as u32).reverse_bits().wrapping_add(seed);
    // Never 0, and never above 1: floats have 24 bits.
    ((bits >> 8) + 1) as f32 / 16_777_216.0
}

/// Those of `count` points whose [`rank`] is at most `most`, in any order; perhaps a few more. Takes time
/// in proportion to their number.
pub(super) fn ranked_up_to(most: f32, count: usize, seed: u32) -> impl Iterator<Item = usize> {
    // Of a power of two, the reversed bits of all indices are multiples of a step.
    let places = count.next_power_of_two() as u64;
    let step = (1 << 32) / places;
    let first = u64::from(seed.wrapping_neg()).div_ceil(step);
    // NaN and infinity reach all. Ranks are rounded up to 2⁻²⁴.
    let reached =
        if most < 1.0 { (f64::from(most) * 2_f64.powi(32)) as u64 + 256 } else { 1 << 32 };
    let number = (reached / step + 1).min(places);
    (first..first + number)
        .map(move |place| ((place % places * step) as u32).reverse_bits() as usize)
        .filter(move |index| *index < count)
}

/// Relative density of patches: 1 at the camera, a half at a distance of `near`, and beyond that
/// falling with the squared distance, so that distant surfaces are as finely divided in the image
/// as nearer ones.
fn density(position: Vec3, center: Vec3, near: f32) -> f32 {
    let steps = (position - center) / near;
    1.0 / (1.0 + steps.length_squared())
}

/// A camera's density of patches: its centre, which follows the camera in steps, and the distance
/// at which the density is a half, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PatchFocus {
    pub camera: Entity,
    center: Vec3,
    near: f32,
}

impl PatchFocus {
    /// `before`: the last one of this camera.
    pub(super) fn new(camera: Entity, position: Vec3, range: f32, before: Option<&Self>) -> Self {
        // NaN compares false.
        let near = if range * NEAR_SHARE > 0.1 { (range * NEAR_SHARE).min(1e6) } else { 0.1 };
        let step = near * STEP_SHARE;
        // Hysteresis: a camera that moves to and fro over the border of a step changes nothing.
        let is_near = |before: &&Self| {
            before.near == near && (position - before.center).abs().max_element() <= 0.75 * step
        };
        if let Some(before) = before.filter(is_near) {
            return *before;
        }
        let center = (position / step).round() * step;
        Self { camera, center: if center.is_finite() { center } else { Vec3::ZERO }, near }
    }

    /// The same in a world that is shifted.
    pub(super) fn shifted(self, shift: Vec3) -> Self {
        Self { center: self.center + shift, ..self }
    }

    /// Relative density at a position.
    pub(super) fn density(&self, position: Vec3) -> f32 {
        density(position, self.center, self.near)
    }

    /// No density in a sphere is greater.
    pub(super) fn most_density(&self, center: Vec3, radius: f32) -> f32 {
        let distance = (center.distance(self.center) - radius).max(0.0);
        density(Vec3::X * distance, Vec3::ZERO, self.near)
    }

    /// Whether densities in a sphere differ by a quarter at most.
    pub(super) fn is_even(&self, (center, radius): (Vec3, f32)) -> bool {
        radius <= 0.125 * self.near.max(center.distance(self.center))
    }
}

#[cfg(test)]
#[path = "choice_tests.rs"]
mod tests;
