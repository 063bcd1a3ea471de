//! A patch, and the selection of the points of the scene's surfaces that become patches: plain
//! Rust, no renderer.
//!
//! Priority sampling (Duffield, Lund and Thorup 2007, "Priority sampling for estimation of
//! arbitrary subset sums"): every point has a weight and a permanent rank, and its priority is
//! weight ÷ rank. The `count` points of the highest priorities are selected; each counts for the
//! larger of its own weight and the threshold, the highest priority that was not selected. The
//! expectation of the sum over the selection is the sum over all points (up to one part in 2 ×
//! count, since ranks here are stratified and not independent). Where something moves, appears or
//! disappears, all other points keep their patches, except a few at the threshold.

use bevy::math::Vec3;
use bytemuck::{Pod, Zeroable};

use crate::gi::surfaces::MaterialSample;
use crate::gi::texels::pack_normal;

/// Patches of a camera. Fewer: blotchier second bounces. More: proportionally more rays, eight per
/// patch.
pub(super) const PATCHES: usize = 2048;

/// A piece of surface that reflects incident light: `bounces/patch.wgsl`'s `Patch`.
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
        let byte = |value: f32| (value * 255.0).round() as u32;
        let pack = |values: [f32; 4]| {
            values.into_iter().rev().fold(0, |packed, value| packed << 8 | byte(value))
        };
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
pub(super) fn density(position: Vec3, center: Vec3, near: f32) -> f32 {
    let steps = (position - center) / near;
    1.0 / (1.0 + steps.length_squared())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `count` points of 1 m² on a line, 1 m apart.
    fn line(count: usize, seed: u32) -> Vec<Candidate<usize>> {
        let density = |index: usize| density(Vec3::X * index as f32, Vec3::ZERO, 30.0);
        (0..count)
            .map(|point| Candidate {
                area: 1.0,
                density: density(point),
                rank: rank(point, seed),
                point,
            })
            .collect()
    }

    #[test]
    fn the_selection_represents_all_points() {
        for (points, count) in [(100, 10), (1000, 64), (1000, 999), (5000, 512)] {
            let mut ratios = Vec::new();
            for seed in 0..256u32 {
                let chosen = choose(line(points, seed.wrapping_mul(2_654_435_769)), count);
                assert_eq!(chosen.len(), count);
                ratios.push(
                    chosen.iter().map(|(_, area)| f64::from(*area)).sum::<f64>() / points as f64,
                );
            }
            let mean = ratios.iter().sum::<f64>() / 256.0;
            // Exact for independent ranks; stratified ones err by up to half a point.
            assert!(
                (mean - 1.0).abs() < 0.5 / count as f64 + 0.005,
                "{mean} of {points} by {count}"
            );
        }
    }

    #[test]
    fn with_room_for_all_each_point_represents_itself() {
        for (points, count) in [(0, 0), (0, 8), (1, 1), (8, 8), (8, 100)] {
            let chosen = choose(line(points, 0), count);
            assert_eq!(chosen, (0..points).map(|point| (point, 1.0)).collect::<Vec<_>>());
        }
        assert_eq!(choose(line(5, 0), 0), []);
    }

    #[test]
    fn near_surfaces_have_more_patches() {
        let candidates = (0..4096).map(|point| {
            let density = density(Vec3::X * point as f32, Vec3::ZERO, 300.0);
            Candidate { area: 1.0, density, rank: rank(point, 0), point }
        });
        let chosen = choose(candidates.collect(), 128);
        let near = chosen.iter().filter(|(point, _)| *point < 600).count();
        // ∫ 1/(1 + (x/300)²) from 0 to 600, as a share of that to 4096.
        let share = 2f64.atan() / (4096.0f64 / 300.0).atan();
        assert!((near as f64 / 128.0 / share - 1.0).abs() < 0.1, "{near}");
    }

    #[test]
    fn other_points_keep_their_patches_when_a_surface_appears() {
        let before = choose(line(4000, 0), 512);
        let mut more = line(4000, 0);
        more.extend((0..40).map(|point| Candidate {
            area: 1.0,
            density: 1.0,
            rank: rank(point, 77),
            point: 10_000 + point,
        }));
        let after = choose(more, 512);
        let kept = before
            .iter()
            .filter(|(point, _)| after.iter().any(|(other, _)| other == point))
            .count();
        let came = after.iter().filter(|(point, _)| *point >= 10_000).count();
        assert!(came > 0 && kept == 512 - came, "{kept} of 512, {came} came");
    }

    #[test]
    fn zero_and_non_finite_weights_are_left_out() {
        let odd = |area: f32, density: f32| Candidate { area, density, rank: 0.5, point: 0 };
        let candidates = vec![
            odd(f32::NAN, 1.0),
            odd(f32::INFINITY, 1.0),
            odd(0.0, 1.0),
            odd(-1.0, -1.0),
            odd(1.0, 0.0),
            odd(1.0, f32::NAN),
        ];
        assert_eq!(choose(candidates, 8), []);
        assert_eq!(choose(vec![odd(1e-30, 1.0), odd(1e30, 1.0)], 8).len(), 2);
        assert_eq!(density(Vec3::splat(f32::INFINITY), Vec3::ZERO, 1.0), 0.0);
    }

    #[test]
    fn ranks_of_any_run_are_evenly_distributed() {
        for (first, seed) in [(0, 0), (64, 12345), (640, u32::MAX)] {
            let mut ranks: Vec<f32> = (first..first + 64).map(|index| rank(index, seed)).collect();
            ranks.sort_by(f32::total_cmp);
            assert!(
                ranks
                    .iter()
                    .enumerate()
                    .all(|(i, rank)| (rank - (i as f32 + 0.5) / 64.0).abs() < 1.0 / 64.0),
                "{ranks:?}"
            );
            assert!(ranks[0] > 0.0 && ranks[63] <= 1.0);
        }
    }

    #[test]
    fn the_first_value_lies_in_the_lowest_byte() {
        let material = MaterialSample {
            color: Vec3::new(1.0, 0.0, 0.5),
            roughness: 0.2,
            metallic: 1.0,
            reflectance: 0.5,
        };
        let patch = Patch::new(Vec3::ZERO, 1.0, Vec3::Y, &material);
        assert_eq!(patch.color.to_le_bytes(), [255, 0, 186, 51]);
        assert_eq!(patch.properties.to_le_bytes(), [128, 255, 0, 0]);
    }
}
