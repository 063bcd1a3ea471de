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
pub(super) const PATCHES: usize = 2048;

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
}

/// At most `count` of `candidates`, in their order, each with the area in m² that it represents.
/// Those of zero or non-finite weight are left out.
pub(super) fn choose<T: Copy>(mut candidates: Vec<Candidate<T>>, count: usize) -> Vec<(T, f32)> {
    candidates.retain(|candidate| {
        candidate.priority() > 0.0 && candidate.priority().is_finite() && candidate.density > 0.0
    });
    if candidates.len() <= count {
        return candidates.into_iter().map(|candidate| (candidate.point, candidate.area)).collect();
    }
    let mut priorities: Vec<f32> = candidates.iter().map(Candidate::priority).collect();
    let (_, threshold, _) = priorities.select_nth_unstable_by(count, |a, b| b.total_cmp(a));
    let threshold = *threshold;
    let above = candidates.into_iter().filter(|candidate| candidate.priority() > threshold);
    above
        .map(|candidate| (candidate.point, candidate.area.max(threshold / candidate.density)))
        .collect()
}

/// Ranks of the points of one surface, which lie along a space-filling curve: any run of them is
/// evenly distributed over 0 to 1 (van der Corput 1935). `seed` shifts the ranks of different
/// surfaces against each other.
pub(super) fn rank(index: usize, seed: u32) -> f32 {
    let bits = (index as u32).reverse_bits().wrapping_add(seed);
    // Never 0, and never above 1: floats have 24 bits.
    ((bits >> 8) + 1) as f32 / 16_777_216.0
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
}

#[cfg(test)]
#[path = "choice_tests.rs"]
mod tests;
