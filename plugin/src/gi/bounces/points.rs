//! Points on surfaces, of which some become patches: as many on each as its importance asks for.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

use bevy::platform::collections::HashMap;
use bevy::prelude::*;

use super::choice::{PATCHES, PatchFocus};
use crate::gi::surfaces::{
    MaterialSample, Reflectance, SurfaceAssets, SurfaceInstance, SurfaceKey, SurfacePoint,
    SurfacePoints, TrianglePoint, Triangles, area_matrix, triangles,
};

/// Approximate number of points on all surfaces, from which a camera's patches are selected: near
/// surfaces can have eight times the density of patches of others.
const POINTS: usize = 8 * PATCHES;
/// Most points of one surface.
const MAX_POINTS: usize = 8192;
/// Between cuts a surface keeps up to so many times its target count of points.
const TOO_MANY: usize = 8;
/// Points that a surface's importance is estimated with.
const FIRST_POINTS: usize = 64;
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

    fn reads(&self, image: AssetId<Image>) -> bool {
        self.reflectance.reads(image)
    }
}

pub(super) type PatchInstance = SurfaceInstance<PatchKey, ()>;

/// Points of a surface. A point in a hole has no material.
pub(super) type Points = SurfacePoints<Option<MaterialSample>>;

/// Points of a surface at every count that was asked for: they take longer to compute than patches.
pub(super) struct PatchPoints {
    by_count: BTreeMap<usize, Points>,
    /// Count of those in use.
    count: usize,
}

impl PatchPoints {
    /// `None` while the surface's assets are not loaded, and `Some(None)` where they cannot be read.
    pub(super) fn new(key: &PatchKey, assets: &SurfaceAssets) -> Option<Option<Self>> {
        let first = points(key, FIRST_POINTS, assets)?;
        Some(first.map(|first| Self { by_count: [(FIRST_POINTS, first)].into(), count: 0 }))
    }

    /// Those in use; those of the estimate before [`refine`].
    pub(super) fn in_use(&self) -> &Points {
        self.by_count.get(&self.count).unwrap_or_else(|| self.first())
    }

    fn first(&self) -> &Points {
        &self.by_count[&FIRST_POINTS]
    }

    /// A place on the surface, in the mesh's own space.
    pub(super) fn place(&self) -> Vec3 {
        self.first().points.first().map_or(Vec3::ZERO, |point| point.position)
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
                Some(Some(list)) => drop(vacant.insert(list)),
                Some(None) => return true,
                // Its texture went to the GPU since the first points were read.
                None => return false,
            }
        }
        self.count = target;
        true
    }
}

/// Gives every surface points in proportion to its importance (area × density for the nearest
/// camera), in powers of two. Between cuts, those with some more keep them: patches stay. Returns
/// whether no texture must be waited for.
pub(super) fn refine(
    held: &mut HashMap<PatchKey, Option<PatchPoints>>,
    instances: &[PatchInstance],
    focuses: &[PatchFocus],
    is_cut: bool,
    assets: &SurfaceAssets,
) -> bool {
    let mut importance: HashMap<PatchKey, f64> = HashMap::default();
    let mut total = 0.0;
    for instance in instances {
        let Some(Some(points)) = held.get(&instance.key) else { continue };
        // Always the same points, so that importance does not depend on earlier views.
        let points = points.first();
        let spread = area_matrix(&instance.affine);
        let own: f64 = points
            .points
            .iter()
            .map(|point| {
                let position = instance.affine.transform_point3(point.position);
                let densest =
                    focuses.iter().map(|focus| focus.density(position)).fold(0.0, f32::max);
                points.area * f64::from((spread * point.normal).length() * densest)
            })
            .sum();
        if own > 0.0 && own.is_finite() {
            total += own;
            let most = importance.entry(instance.key).or_default();
            *most = most.max(own);
        }
    }
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
