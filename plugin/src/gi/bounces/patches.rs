//! The patches of every camera with more than one bounce.

use std::sync::Arc;

use bevy::asset::AssetId;
use bevy::camera::Camera;
use bevy::ecs::prelude::*;
use bevy::image::Image;
use bevy::light::{EnvironmentMapLight, NotShadowCaster};
use bevy::log::warn_once;
use bevy::math::Vec3;
use bevy::mesh::Mesh;
use bevy::mesh::skinning::SkinnedMesh;
use bevy::platform::collections::HashMap;
use bevy::render::extract_resource::ExtractResource;
use bevy::transform::components::GlobalTransform;

use super::choice::{Candidate, Patch, choose, density, rank};
use crate::cut::{CameraCut, Jumps};
use crate::gi::settings::FrugalGi;
use crate::gi::surfaces::{
    MaterialSample, MeshChanges, Reflectance, SurfaceAssets, SurfaceEvents, SurfaceInstance,
    SurfaceKey, SurfaceMesh, SurfacePoint, SurfacePoints, SurfaceSet, TrianglePoint, Triangles,
    area_matrix, triangles,
};
use crate::gi::view::{GiCameras, LightPresence};

/// Patches of a camera. Fewer: blotchier second bounces. More: proportionally more rays, eight per
/// patch.
pub(super) const PATCHES: usize = 2048;
/// Approximate number of points on all surfaces, from which a camera's patches are selected: near
/// surfaces can have eight times the density of patches of others.
const POINTS: usize = 8 * PATCHES;
/// Most points of one surface.
const MAX_POINTS: usize = 8192;
/// A surface keeps up to so many times its target count of points.
const TOO_MANY: usize = 8;
/// Points of a surface before its importance is known.
const FIRST_POINTS: usize = 64;
/// Material samples for each point of a textured or masked surface.
const SAMPLES_PER_POINT: usize = 8;
/// Distance from the camera at which patches are half as dense, as a share of the range.
const NEAR_SHARE: f32 = 0.1;
/// Step in which the centre of density follows the camera, as a share of that distance: patches
/// stay while the camera moves within a step.
const STEP_SHARE: f32 = 0.25;

/// A camera's patches.
#[derive(Clone, Debug)]
struct PatchSet {
    camera: Entity,
    /// [`PATCHES`] of them, padded with patches without area.
    patches: Arc<Vec<Patch>>,
}

/// Patches of each camera with more than one bounce. Maintained while there are such cameras and
/// light.
///
/// Every visible mesh with a lit, opaque or masked `StandardMaterial` reflects. Exceptions:
/// unlit, transparent and transmissive ones, those with [`NotShadowCaster`], forward-rendered ones,
/// and skinned ones, whose triangles here are those of the bind pose. Morphs, shaders that move
/// vertices, other kinds of material and ranges of visibility are ignored: all levels of
/// detail of a mesh reflect, unless one occludes another. Textures of base colour, metallic
/// and roughness are read where the CPU has their images in uncompressed formats; else grey
/// replaces them, with a warning.
#[derive(Resource, ExtractResource, Clone, Debug, Default)]
pub struct GiPatches {
    sets: Vec<PatchSet>,
}

impl GiPatches {
    /// Number of patches of all cameras, without padding.
    pub fn patch_count(&self) -> usize {
        self.sets.iter().flat_map(|set| set.patches.iter()).filter(|patch| patch.area > 0.0).count()
    }

    /// Number of texels of all cameras' patches in the store.
    pub(in crate::gi) fn texel_count(&self) -> usize {
        self.sets.len() * PATCHES
    }

    /// A camera's patches, and the number of other cameras' texels before theirs.
    pub(super) fn of(&self, camera: Entity) -> Option<(&Arc<Vec<Patch>>, u32)> {
        let index = self.sets.iter().position(|set| set.camera == camera)?;
        Some((&self.sets[index].patches, (index * PATCHES) as u32))
    }
}

/// Identifies a surface's points.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct PatchKey {
    mesh: AssetId<Mesh>,
    reflectance: Reflectance,
}

impl SurfaceKey for PatchKey {
    fn mesh(&self) -> AssetId<Mesh> {
        self.mesh
    }

    fn reads(&self, image: AssetId<Image>) -> bool {
        self.reflectance.reads(image)
    }
}

type PatchInstance = SurfaceInstance<PatchKey, ()>;

/// A camera's density of patches: its centre, which follows the camera in steps, and the distance
/// at which the density is a half, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
struct PatchFocus {
    camera: Entity,
    center: Vec3,
    near: f32,
}

impl PatchFocus {
    /// `before`: the last one of this camera.
    fn new(camera: Entity, position: Vec3, range: f32, before: Option<&Self>) -> Self {
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
}

/// Points of a surface. A point in a hole has no material.
type Points = SurfacePoints<Option<MaterialSample>>;

/// The inputs of the current [`GiPatches`].
#[derive(Resource, Default)]
pub(super) struct Surfaces {
    /// A value is `None` where a mesh has no readable triangles.
    points: SurfaceSet<PatchKey, (), Option<Points>>,
    focuses: Vec<PatchFocus>,
}

pub(super) fn update(
    mut surfaces: ResMut<Surfaces>,
    mut patches: ResMut<GiPatches>,
    mut events: SurfaceEvents,
    assets: SurfaceAssets,
    light: Res<LightPresence>,
    cameras: Query<(
        Entity,
        &Camera,
        &FrugalGi,
        &GlobalTransform,
        Has<EnvironmentMapLight>,
        Has<CameraCut>,
    )>,
    meshes: Query<SurfaceMesh, (Without<SkinnedMesh>, Without<NotShadowCaster>)>,
    gi_cameras: GiCameras,
    (changes, jumps): (Res<MeshChanges>, Res<Jumps>),
) {
    let Surfaces { points: surfaces, focuses: before } = &mut *surfaces;
    surfaces.cache.read(&mut events);
    let mut focuses: Vec<PatchFocus> = cameras
        .iter()
        .filter(|(_, camera, gi, _, has_map, _)| {
            camera.is_active && gi.reflects() && light.lights(gi, *has_map)
        })
        .map(|(entity, _, gi, transform, _, is_cut)| {
            // What comes after a cut does not depend on what was before.
            let before = before.iter().find(|focus| focus.camera == entity && !is_cut);
            let shift = jumps.shifts.get(&entity).copied().unwrap_or_default();
            let before =
                before.map(|before| PatchFocus { center: before.center + shift, ..*before });
            PatchFocus::new(entity, transform.translation(), gi.range, before.as_ref())
        })
        .collect();
    if focuses.is_empty() {
        if !before.is_empty() {
            // Points stay, since they take longer to compute than patches.
            surfaces.clear();
            before.clear();
            *patches = GiPatches::default();
        }
        return;
    }
    // Query order is arbitrary; sorting keeps patches the same in every run.
    focuses.sort_unstable_by_key(|focus| focus.camera);
    let materials = assets.materials.as_deref();
    let changed = surfaces.update(
        &meshes,
        (&gi_cameras.shown(), &changes),
        |mesh, material| {
            let reflectance = Reflectance::new(materials?.get(material)?)?;
            Some((PatchKey { mesh, reflectance }, ()))
        },
        |key| points(key, FIRST_POINTS, &assets),
    );
    if changed || *before != focuses {
        let (values, instances) = (&mut surfaces.cache.values, &surfaces.instances);
        let are_refined = refine(values, instances, &focuses, &assets);
        let set = |focus: &PatchFocus| {
            let camera = focus.camera;
            let chosen = chosen(values, instances, focus);
            // Keeps the old patches where another camera moved or a change was far away.
            let same =
                patches.sets.iter().find(|set| set.camera == camera && *set.patches == chosen);
            PatchSet {
                camera,
                patches: same.map_or_else(|| Arc::new(chosen), |set| Arc::clone(&set.patches)),
            }
        };
        let sets = focuses.iter().map(set).collect();
        *patches = GiPatches { sets };
        *before = focuses;
        surfaces.cache.changed = !are_refined;
    }
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

/// Gives every surface points in proportion to its importance (area × density for the nearest
/// camera), in powers of two: more where it has too few, fewer where it has far too many. Returns
/// whether no texture must be waited for.
fn refine(
    held: &mut HashMap<PatchKey, Option<Points>>,
    instances: &[PatchInstance],
    focuses: &[PatchFocus],
    assets: &SurfaceAssets,
) -> bool {
    let mut importance: HashMap<PatchKey, f64> = HashMap::default();
    let mut total = 0.0;
    for instance in instances {
        let Some(Some(points)) = held.get(&instance.key) else { continue };
        let spread = area_matrix(&instance.affine);
        let own: f64 = points
            .points
            .iter()
            .map(|point| {
                let position = instance.affine.transform_point3(point.position);
                let densest = focuses
                    .iter()
                    .map(|focus| density(position, focus.center, focus.near))
                    .fold(0.0, f32::max);
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
        let target = target.next_power_of_two();
        let Some(Some(points)) = held.get_mut(&key) else { continue };
        let count = points.points.len();
        if count > TOO_MANY * target {
            points.thin(count / target);
        } else if count < target {
            match self::points(&key, target, assets) {
                Some(Some(finer)) => *points = finer,
                Some(None) => {}
                // Its texture went to the GPU since the first points were read.
                None => are_refined = false,
            }
        }
    }
    are_refined
}

/// A camera's patches.
fn chosen(
    held: &HashMap<PatchKey, Option<Points>>,
    instances: &[PatchInstance],
    focus: &PatchFocus,
) -> Vec<Patch> {
    let mut candidates = Vec::new();
    for instance in instances {
        let Some(Some(points)) = held.get(&instance.key) else { continue };
        let spread = area_matrix(&instance.affine);
        // Permanent for an entity: a multiple of the golden ratio.
        let seed = instance.entity.index_u32().wrapping_mul(2_654_435_769);
        for (index, point) in points.points.iter().enumerate() {
            let Some(sample) = point.sample else { continue };
            let facing = spread * point.normal;
            let position = instance.affine.transform_point3(point.position);
            let area = (points.area * f64::from(facing.length())) as f32;
            let normal = facing.normalize_or_zero();
            if !position.is_finite() || normal == Vec3::ZERO {
                continue;
            }
            let density = density(position, focus.center, focus.near);
            for (side, sign) in (0..).zip(instance.key.reflectance.sides.signs()) {
                let rank = rank(index, seed.wrapping_add(side << 31));
                candidates.push(Candidate {
                    area,
                    density,
                    rank,
                    point: (position, normal * *sign, sample),
                });
            }
        }
    }
    let mut patches: Vec<Patch> = choose(candidates, PATCHES)
        .into_iter()
        .map(|((position, normal, sample), area)| Patch::new(position, area, normal, &sample))
        .collect();
    patches.resize(PATCHES, Patch::default());
    patches
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
        let area = |points: &Points| points.area * points.points.len() as f64;
        let mut thin = fine.clone();
        thin.thin(16);
        assert!((area(&thin) - area(&fine)).abs() < 1e-9);
        let there = coarse(&fine, SAMPLES_PER_POINT)
            .points
            .iter()
            .filter(|point| point.sample.is_some())
            .count();
        assert!((there as f32 / 256.0 - 2.0 / 3.0).abs() < 0.04, "{there} of 256");
    }

    #[test]
    fn patches_stay_while_a_camera_moves_within_a_step() {
        let from = |x: f32, range: f32, before: Option<&PatchFocus>| {
            PatchFocus::new(Entity::PLACEHOLDER, Vec3::new(x, 2.0, -3.0), range, before)
        };
        let at = |x: f32, range: f32| from(x, range, None);
        assert_eq!(at(0.1, 40.0), at(0.4, 40.0));
        assert_ne!(at(0.1, 40.0), at(1.4, 40.0));
        // Steps are of 1 m: over the border and back, and then beyond.
        let before = at(0.45, 40.0);
        assert_ne!(at(0.55, 40.0), before);
        assert_eq!(from(0.55, 40.0, Some(&before)), before);
        assert_ne!(from(0.8, 40.0, Some(&before)), before);
        assert_ne!(from(0.45, 80.0, Some(&before)), before, "another range");
        for (position, range) in [
            (f32::NAN, 40.0),
            (1e30, 40.0),
            (f32::INFINITY, 0.0),
            (1.0, f32::NAN),
            (1.0, f32::INFINITY),
            (1.0, -1.0),
        ] {
            let around = at(position, range);
            assert!(
                around.center.is_finite() && around.near.is_finite() && around.near > 0.0,
                "{around:?}"
            );
        }
    }
}
