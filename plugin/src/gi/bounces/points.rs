//! Points on surfaces, of which some become patches: as many on each as its importance asks for.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

use bevy::math::bounding::BoundingSphere;
use bevy::math::{Affine3A, Mat3A};
use bevy::platform::collections::{HashMap, HashSet};
use bevy::prelude::*;

use super::choice::{Candidate, PATCHES, PatchFocus, rank, ranked_up_to};
use crate::gi::surfaces::{
    MaterialSample, Reflectance, SurfaceAssets, SurfaceInstance, SurfaceKey, SurfacePoint,
    SurfacePoints, TrianglePoint, Triangles, area_matrix, triangles,
};

/// Approximate number of points on all surfaces, from which a camera's patches are selected: near
/// surfaces can have eight times the density of patches of others.
pub(super) const POINTS: usize = 8 * PATCHES;
/// Most points of one surface.
const MAX_POINTS: usize = 8192;
/// Between cuts a surface keeps up to so many times its target count of points.
const TOO_MANY: usize = 8;
/// Points that a surface's importance is estimated with.
const FIRST_POINTS: usize = 64;
/// Of those, one of so many where patches are about as dense everywhere on the surface.
const EVEN_STEP: usize = 8;
/// Material samples for each point of a textured or masked surface.
const SAMPLES_PER_POINT: usize = 8;

/// Identifies a surface's points.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct PatchKey {
    pub mesh: AssetId<Mesh>,
    pub reflectance: Reflectance,
}

impl SurfaceKey for PatchKey {
    fn mesh(&self) -> AssetId<Mesh> {
        self.mesh
    }

    fn reads(&self, images: &HashSet<AssetId<Image>>) -> bool {
        self.reflectance.reads(images)
    }
}

pub(super) type PatchInstance = SurfaceInstance<PatchKey, ()>;
/// Position and normal in world space, and the material there.
pub(super) type PatchCandidate = Candidate<(Vec3, Vec3, MaterialSample)>;

/// Points of a surface. A point in a hole has no material.
pub(super) type Points = SurfacePoints<Option<MaterialSample>>;

/// Points of a surface, and a sphere around them.
struct Bounded {
    points: Points,
    around: BoundingSphere,
}

impl Bounded {
    fn new(points: Points) -> Self {
        let places: Vec<Vec3> = points.points.iter().map(|point| point.position).collect();
        Self { points, around: BoundingSphere::from_point_cloud(Isometry3d::IDENTITY, &places) }
    }

    /// The sphere's centre in the world and its radius, metres.
    fn around(&self, affine: &Affine3A) -> (Vec3, f32) {
        let center = affine.transform_point3a(self.around.center);
        (center.into(), self.around.radius() * most_stretch(&affine.matrix3))
    }
}

/// No vector becomes longer by a greater factor: the Frobenius norm.
fn most_stretch(matrix: &Mat3A) -> f32 {
    let Mat3A { x_axis, y_axis, z_axis } = matrix;
    (x_axis.length_squared() + y_axis.length_squared() + z_axis.length_squared()).sqrt()
}

/// Points of a surface at every count that was asked for: they take longer to compute than patches.
pub(super) struct PatchPoints {
    by_count: BTreeMap<usize, Bounded>,
    /// Count of those in use.
    count: usize,
}

impl PatchPoints {
    /// `None` while the surface's assets are not loaded, and `Some(None)` where they cannot be read.
    pub(super) fn new(key: &PatchKey, assets: &SurfaceAssets) -> Option<Option<Self>> {
        let first = points(key, FIRST_POINTS, assets)?.map(Bounded::new);
        Some(first.map(|first| Self { by_count: [(FIRST_POINTS, first)].into(), count: 0 }))
    }

    /// Those in use; those of the estimate before [`refine`].
    fn in_use(&self) -> &Bounded {
        self.by_count.get(&self.count).unwrap_or(&self.by_count[&FIRST_POINTS])
    }

    /// A place on the surface, in the mesh's own space.
    pub(super) fn place(&self) -> Vec3 {
        let first = &self.by_count[&FIRST_POINTS].points;
        first.points.first().map_or(Vec3::ZERO, |point| point.position)
    }

    /// Area × density for the nearest camera, m². Always by the same points, so that it does not depend on
    /// earlier views.
    pub(super) fn importance(&self, affine: &Affine3A, focuses: &[PatchFocus]) -> f64 {
        let first = &self.by_count[&FIRST_POINTS];
        let around = first.around(affine);
        let is_even = focuses.iter().all(|focus| focus.is_even(around));
        let step = if is_even { EVEN_STEP } else { 1 };
        let spread = area_matrix(affine);
        let parts = first.points.points.iter().step_by(step).map(|point| {
            let position = affine.transform_point3(point.position);
            let densest = focuses.iter().map(|focus| focus.density(position)).fold(0.0, f32::max);
            first.points.area * f64::from((spread * point.normal).length() * densest)
        });
        parts.sum::<f64>() * step as f64
    }

    /// Adds the points whose priority exceeds `floor` to `found`, in their order. Most others are not
    /// looked at. `seed`: of the surface's ranks.
    pub(super) fn candidates_above(
        &self,
        floor: f32,
        (instance, seed): (&PatchInstance, u32),
        focus: &PatchFocus,
        found: &mut Vec<PatchCandidate>,
    ) {
        let points = self.in_use();
        let affine = &instance.affine;
        let (center, radius) = points.around(affine);
        let spread = area_matrix(affine);
        let most_area = points.points.area as f32 * most_stretch(&spread);
        // Rounding must not leave a point out.
        let most = 1.001 * most_area * focus.most_density(center, radius) / floor;
        let sides = instance.key.reflectance.sides.signs();
        let mut ranked = Vec::new();
        for side in 0..sides.len() as u32 {
            let seed = seed.wrapping_add(side << 31);
            let indices = ranked_up_to(most, points.points.points.len(), seed);
            ranked.extend(indices.map(|index| (index, side)));
        }
        ranked.sort_unstable();
        found.extend(ranked.into_iter().filter_map(|(index, side)| {
            let point = &points.points.points[index];
            let sample = point.sample?;
            let facing = spread * point.normal;
            let position = affine.transform_point3(point.position);
            let area = (points.points.area * f64::from(facing.length())) as f32;
            let normal = facing.normalize_or_zero() * sides[side as usize];
            let candidate = Candidate {
                area,
                density: focus.density(position),
                rank: rank(index, seed.wrapping_add(side << 31)),
                point: (position, normal, sample),
            };
            let is_one = position.is_finite() && normal != Vec3::ZERO;
            (is_one && candidate.is_above(floor)).then_some(candidate)
        }));
    }

    /// Uses `target` points, or some more where `is_kept`. Returns whether no texture must be waited
    /// for.
    fn resize(
        &mut self,
        key: &PatchKey,
        target: usize,
        is_kept: bool,
        assets: &SurfaceAssets,
    ) -> bool {
        if is_kept && (target..=TOO_MANY * target).contains(&self.count) {
            return true;
        }
        if let Entry::Vacant(vacant) = self.by_count.entry(target) {
            match points(key, target, assets) {
                Some(Some(list)) => drop(vacant.insert(Bounded::new(list))),
                Some(None) => return true,
                // Its texture went to the GPU since the first points were read.
                None => return false,
            }
        }
        self.count = target;
        true
    }
}

/// Gives every surface points in proportion to its importance, in powers of two. Between cuts, those with
/// some more keep them: patches stay. Returns whether no texture must be waited for.
pub(super) fn refine(
    held: &mut HashMap<PatchKey, Option<PatchPoints>>,
    instances: &[PatchInstance],
    importances: &[f64],
    is_cut: bool,
    assets: &SurfaceAssets,
) -> bool {
    let mut importance: HashMap<PatchKey, f64> = HashMap::default();
    for (instance, own) in instances.iter().zip(importances).filter(|(_, own)| **own > 0.0) {
        let most = importance.entry(instance.key).or_default();
        *most = most.max(*own);
    }
    let total: f64 = importances.iter().sum();
    let mut are_refined = true;
    for (key, importance) in importance {
        let target =
            (POINTS as f64 * importance / total).ceil().clamp(1.0, MAX_POINTS as f64) as usize;
        if let Some(Some(points)) = held.get_mut(&key) {
            are_refined &= points.resize(&key, target.next_power_of_two(), !is_cut, assets);
        }
    }
    are_refined
}

/// `count` points of a surface; `None` while its assets are not loaded, and `Some(None)` where they
/// cannot be read.
fn points(key: &PatchKey, count: usize, assets: &SurfaceAssets) -> Option<Option<Points>> {
    let mesh = assets.meshes.get(key.mesh)?;
    let material = key.reflectance.on(mesh, assets)?;
    let Some(Triangles { corners, positions }) = triangles(mesh) else {
        warn_once!(
            "a mesh is kept for the GPU alone or is no triangle list: it does not reflect light a second time (RenderAssetUsages::MAIN_WORLD keeps it readable)"
        );
        return Some(None);
    };
    let samples = if key.reflectance.is_patterned() { SAMPLES_PER_POINT } else { 1 };
    let sample = |TrianglePoint { triangle, weights }| material.at(corners[triangle], weights);
    Some(SurfacePoints::new(&positions, count * samples, sample).map(|fine| coarse(&fine, samples)))
}

/// Merges every run of `samples` points into the one in its middle, with their mean material; a
/// hole where the middle one is in a hole.
fn coarse(fine: &Points, samples: usize) -> Points {
    if samples == 1 {
        return fine.clone();
    }
    let points = fine.points.chunks(samples).map(|run| {
        let middle = &run[run.len() / 2];
        let there: Vec<MaterialSample> = run.iter().filter_map(|point| point.sample).collect();
        let mean = |value: fn(&MaterialSample) -> f32| {
            there.iter().map(value).sum::<f32>() / there.len() as f32
        };
        // The share of holes stays the same.
        let sample = middle.sample.map(|_| MaterialSample {
            color: there.iter().map(|sample| sample.color).sum::<Vec3>() / there.len() as f32,
            roughness: mean(|sample| sample.roughness),
            metallic: mean(|sample| sample.metallic),
            reflectance: mean(|sample| sample.reflectance),
        });
        SurfacePoint { sample, ..*middle }
    });
    Points { points: points.collect(), area: fine.area * samples as f64 }
}

#[cfg(test)]
impl PatchPoints {
    /// Of a surface that needs no assets.
    pub(super) fn of(points: Points) -> Self {
        Self { by_count: [(FIRST_POINTS, Bounded::new(points))].into(), count: 0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SQUARE: [[Vec3; 3]; 2] = [
        [Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0)],
        [Vec3::ZERO, Vec3::new(1.0, 1.0, 0.0), Vec3::Y],
    ];

    fn grey(color: f32) -> MaterialSample {
        MaterialSample {
            color: Vec3::splat(color),
            roughness: 1.0,
            metallic: 0.0,
            reflectance: 0.5,
        }
    }

    #[test]
    fn coarse_points_are_as_many_and_as_bright_as_the_fine_ones_and_keep_the_area() {
        // A chequered square: of each two samples, one is white.
        let number = std::cell::Cell::new(0);
        let next = || number.replace(number.get() + 1);
        let fine = SurfacePoints::new(&SQUARE, 64 * SAMPLES_PER_POINT, |_| {
            Some(grey((next() % 2) as f32))
        })
        .unwrap();
        let coarse = coarse(&fine, SAMPLES_PER_POINT);
        assert_eq!(coarse.points.len(), 64);
        assert!((coarse.area * 64.0 - 1.0).abs() < 1e-9);
        let mean =
            coarse.points.iter().map(|point| point.sample.unwrap().color.x).sum::<f32>() / 64.0;
        assert!((mean - 0.5).abs() < 1e-6, "{mean}");
    }

    #[test]
    fn the_share_of_points_in_holes_is_the_share_of_holes() {
        // Its left third is cut out.
        let sample = |point: TrianglePoint| {
            let [second, third] = point.weights;
            let x = if point.triangle == 0 { second + third } else { second };
            (x > 1.0 / 3.0).then(|| grey(0.5))
        };
        let fine = SurfacePoints::new(&SQUARE, 256 * SAMPLES_PER_POINT, sample).unwrap();
        let there = coarse(&fine, SAMPLES_PER_POINT)
            .points
            .iter()
            .filter(|point| point.sample.is_some())
            .count();
        assert!((there as f32 / 256.0 - 2.0 / 3.0).abs() < 0.04, "{there} of 256");
    }
}
