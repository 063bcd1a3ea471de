//! The patches of every camera whose light is reflected more than once.

use std::sync::Arc;

use bevy::asset::{AssetEvent, AssetId};
use bevy::camera::Camera;
use bevy::camera::visibility::InheritedVisibility;
use bevy::ecs::prelude::*;
use bevy::image::Image;
use bevy::light::{EnvironmentMapLight, NotShadowCaster};
use bevy::log::warn_once;
use bevy::math::{Affine3A, Vec3};
use bevy::mesh::skinning::SkinnedMesh;
use bevy::mesh::{Mesh, Mesh3d};
use bevy::pbr::{MeshMaterial3d, StandardMaterial};
use bevy::platform::collections::{HashMap, HashSet};
use bevy::render::extract_resource::ExtractResource;
use bevy::transform::components::GlobalTransform;

use super::PATCHES;
use super::choice::{Candidate, choose, density, rank};
use super::patch::Patch;
use crate::gi::settings::FrugalGi;
use crate::gi::surfaces::{
    MaterialSample, Reflectance, SurfaceAssets, SurfacePoint, SurfacePoints, TrianglePoint,
    Triangles, area_matrix, triangles,
};
use crate::gi::view::LightPresence;

/// Points of all surfaces, more or less, of which a camera's patches are chosen: what lies near it
/// can have eight times as many patches as the rest.
const POINTS: usize = 8 * PATCHES;
/// Most of one surface.
const MOST_POINTS: usize = 8192;
/// How many times as many points as it should have a surface keeps.
const TOO_MANY: usize = 8;
/// Points of a surface before its size is known.
const FIRST_POINTS: usize = 64;
/// Places of a patterned surface that are looked at for each point.
const SAMPLES_PER_POINT: usize = 8;
/// How far from the camera patches are half as dense as at it, as a share of how far light bounces.
const NEAR_SHARE: f32 = 0.1;
/// Steps in which that place moves with the camera, as a share of the radius: patches stay while
/// the camera moves within one.
const STEP_SHARE: f32 = 0.25;

/// A camera's patches.
#[derive(Clone, Debug)]
struct PatchSet {
    camera: Entity,
    /// [`PATCHES`], filled up with such as reflect nothing.
    patches: Arc<Vec<Patch>>,
}

/// Patches of each camera whose light is reflected more than once, kept while there is one and
/// light for it.
///
/// Every visible mesh with a [`StandardMaterial`] reflects that hides light and is lit: not unlit,
/// transparent and transmissive ones, those with [`NotShadowCaster`], those rendered forward, and
/// skinned ones, whose triangles here are those of the bind pose. Morphs, shaders that move
/// vertices, other kinds of material and ranges of visibility are not looked at: of a mesh in
/// several levels of detail all reflect that are not hidden by each other. Textures of base colour,
/// metal and roughness are read where their images are there for the processor in formats without
/// compression; a warning says where they are not, and something grey takes their place.
#[derive(Resource, ExtractResource, Clone, Debug, Default)]
pub struct GiPatches {
    sets: Vec<PatchSet>,
}

impl GiPatches {
    /// Patches of all cameras that reflect anything.
    pub fn patch_count(&self) -> usize {
        self.sets.iter().flat_map(|set| set.patches.iter()).filter(|patch| patch.area > 0.0).count()
    }

    /// Texels that all cameras' patches take in the store.
    pub(in crate::gi) fn texel_count(&self) -> usize {
        self.sets.len() * PATCHES
    }

    /// A camera's patches, and how many texels of other cameras' lie before theirs.
    pub(super) fn of(&self, camera: Entity) -> Option<(&Arc<Vec<Patch>>, u32)> {
        let index = self.sets.iter().position(|set| set.camera == camera)?;
        Some((&self.sets[index].patches, (index * PATCHES) as u32))
    }
}

/// Whose points are whose.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct SurfaceKey {
    mesh: AssetId<Mesh>,
    reflectance: Reflectance,
}

/// A surface in its place.
#[derive(Clone, Copy, Debug, PartialEq)]
struct SurfaceInstance {
    entity: Entity,
    key: SurfaceKey,
    affine: Affine3A,
}

/// What a camera's patches are chosen by: where it is, in steps, and how far from there they are
/// dense, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Around {
    camera: Entity,
    center: Vec3,
    near: f32,
}

impl Around {
    /// `before`: where it was the last time.
    fn new(camera: Entity, position: Vec3, range: f32, before: Option<&Self>) -> Self {
        // What is no number compares false.
        let near = if range * NEAR_SHARE > 0.1 { (range * NEAR_SHARE).min(1e6) } else { 0.1 };
        let step = near * STEP_SHARE;
        // A camera that goes to and fro over the border of a step changes nothing.
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

/// Points of a surface. A hole is a point without paint.
type Points = SurfacePoints<Option<MaterialSample>>;

/// What the present [`GiPatches`] was made of.
#[derive(Resource, Default)]
pub(super) struct Surfaces {
    /// None where a mesh has no triangles that can be read.
    points: HashMap<SurfaceKey, Option<Points>>,
    instances: Vec<SurfaceInstance>,
    around: Vec<Around>,
    /// Set when a mesh or a texture came or changed.
    stale: bool,
}

impl Surfaces {
    fn forget(&mut self, is_gone: impl Fn(&SurfaceKey) -> bool) {
        let before = self.points.len();
        self.points.retain(|key, _| !is_gone(key));
        self.stale |= self.points.len() != before;
    }
}

pub(super) fn update(
    mut surfaces: ResMut<Surfaces>,
    mut patches: ResMut<GiPatches>,
    (mut mesh_events, mut image_events): (
        Option<MessageReader<AssetEvent<Mesh>>>,
        Option<MessageReader<AssetEvent<Image>>>,
    ),
    assets: SurfaceAssets,
    light: Res<LightPresence>,
    cameras: Query<(Entity, &Camera, &FrugalGi, &GlobalTransform, Has<EnvironmentMapLight>)>,
    meshes: Query<
        (
            Entity,
            &Mesh3d,
            &MeshMaterial3d<StandardMaterial>,
            &GlobalTransform,
            &InheritedVisibility,
        ),
        (Without<SkinnedMesh>, Without<NotShadowCaster>),
    >,
) {
    let surfaces = &mut *surfaces;
    for event in mesh_events.iter_mut().flat_map(MessageReader::read) {
        let (AssetEvent::Modified { id } | AssetEvent::Removed { id }) = event else { continue };
        surfaces.forget(|key| key.mesh == *id);
    }
    for event in image_events.iter_mut().flat_map(MessageReader::read) {
        let (AssetEvent::Modified { id } | AssetEvent::Removed { id }) = event else { continue };
        surfaces.forget(|key| key.reflectance.reads(*id));
    }
    let mut around: Vec<Around> = cameras
        .iter()
        .filter(|(_, camera, gi, _, has_map)| {
            camera.is_active && gi.reflects() && light.lights(gi, *has_map)
        })
        .map(|(entity, _, gi, transform, _)| {
            let before = surfaces.around.iter().find(|around| around.camera == entity);
            Around::new(entity, transform.translation(), gi.range, before)
        })
        .collect();
    if around.is_empty() {
        if !surfaces.around.is_empty() {
            // Points stay: they take longer to make than patches.
            surfaces.instances.clear();
            surfaces.around.clear();
            *patches = GiPatches::default();
        }
        return;
    }
    // Entities come in no particular order, and patches should lie the same in every run.
    around.sort_unstable_by_key(|around| around.camera);
    let materials = assets.materials.as_deref();
    let mut now: Vec<SurfaceInstance> = meshes
        .iter()
        .filter(|(.., transform, visible)| visible.get() && transform.affine().is_finite())
        .filter_map(|(entity, mesh, material, transform, _)| {
            let reflectance = Reflectance::new(materials?.get(material.id())?)?;
            Some(SurfaceInstance {
                entity,
                key: SurfaceKey { mesh: mesh.id(), reflectance },
                affine: transform.affine(),
            })
        })
        .collect();
    now.sort_unstable_by_key(|instance| instance.entity);
    let used: HashSet<SurfaceKey> = now.iter().map(|instance| instance.key).collect();
    surfaces.points.retain(|key, _| used.contains(key));
    for key in used {
        if !surfaces.points.contains_key(&key)
            && let Some(points) = points(&key, FIRST_POINTS, &assets)
        {
            surfaces.points.insert(key, points);
            surfaces.stale = true;
        }
    }
    if surfaces.stale || surfaces.instances != now || surfaces.around != around {
        refine(&mut surfaces.points, &now, &around, &assets);
        let set = |around: &Around| {
            let camera = around.camera;
            let chosen = chosen(&surfaces.points, &now, around);
            // Another camera's step, or what happened far away: these reflect what they did.
            let same =
                patches.sets.iter().find(|set| set.camera == camera && *set.patches == chosen);
            PatchSet {
                camera,
                patches: same.map_or_else(|| Arc::new(chosen), |set| Arc::clone(&set.patches)),
            }
        };
        let sets = around.iter().map(set).collect();
        *patches = GiPatches { sets };
        (surfaces.instances, surfaces.around, surfaces.stale) = (now, around, false);
    }
}

/// So many points of a surface; `None` while its assets are not there, and `Some(None)` where they
/// cannot be read.
fn points(key: &SurfaceKey, count: usize, assets: &SurfaceAssets) -> Option<Option<Points>> {
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

/// Every run of so many points as one in its middle, with the mean of what they are like; a hole
/// where the middle is one.
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
        // As many points stay as places are there.
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

/// Gives every surface as many points as its share of all that matters to some camera, in powers of
/// two: more where it has too few, fewer where it has far too many.
fn refine(
    held: &mut HashMap<SurfaceKey, Option<Points>>,
    instances: &[SurfaceInstance],
    around: &[Around],
    assets: &SurfaceAssets,
) {
    let mut importance: HashMap<SurfaceKey, f64> = HashMap::default();
    let mut total = 0.0;
    for instance in instances {
        let Some(Some(points)) = held.get(&instance.key) else { continue };
        let spread = area_matrix(&instance.affine);
        let own: f64 = points
            .points
            .iter()
            .map(|point| {
                let position = instance.affine.transform_point3(point.position);
                let densest = around
                    .iter()
                    .map(|around| density(position, around.center, around.near))
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
    for (key, importance) in importance {
        let target =
            (POINTS as f64 * importance / total).ceil().clamp(1.0, MOST_POINTS as f64) as usize;
        let target = target.next_power_of_two();
        let Some(Some(points)) = held.get_mut(&key) else { continue };
        let count = points.points.len();
        if count > TOO_MANY * target {
            points.thin(count / target);
        } else if count < target
            && let Some(Some(finer)) = self::points(&key, target, assets)
        {
            *points = finer;
        }
    }
}

/// A camera's patches.
fn chosen(
    held: &HashMap<SurfaceKey, Option<Points>>,
    instances: &[SurfaceInstance],
    around: &Around,
) -> Vec<Patch> {
    let mut candidates = Vec::new();
    for instance in instances {
        let Some(Some(points)) = held.get(&instance.key) else { continue };
        let spread = area_matrix(&instance.affine);
        // Its own, as long as it lives: a golden step for each entity.
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
            let density = density(position, around.center, around.near);
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
        // A chequered square: of each two looks, one is white.
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
    fn as_many_points_are_holes_as_places_are() {
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
        let from = |x: f32, range: f32, before: Option<&Around>| {
            Around::new(Entity::PLACEHOLDER, Vec3::new(x, 2.0, -3.0), range, before)
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
