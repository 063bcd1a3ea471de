//! The patches of every camera with more than one bounce.

use std::sync::Arc;

use bevy::light::NotShadowCaster;
use bevy::mesh::skinning::SkinnedMesh;
use bevy::platform::collections::{HashMap, HashSet};
use bevy::prelude::*;
use bevy::render::extract_resource::ExtractResource;

use super::choice::{Candidate, PATCHES, Patch, PatchFocus, choose, rank};
use super::points::{PatchInstance, PatchKey, PatchPoints, refine};
use crate::cut::{CameraCut, Jumps};
use crate::gi::surfaces::{
    MeshChanges, Reflectance, SurfaceAssets, SurfaceEvents, SurfaceMesh, SurfaceSet, area_matrix,
};
use crate::gi::view::{ActiveGi, GiCameras, LightPresence};

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

/// The inputs of the current [`GiPatches`].
#[derive(Resource, Default)]
pub(super) struct Surfaces {
    /// A value is `None` where a mesh has no readable triangles.
    points: SurfaceSet<PatchKey, (), Option<PatchPoints>>,
    focuses: Vec<PatchFocus>,
    numbers: Numbers,
}

/// A number for each surface, which it keeps until the next cut. Numbers of entities would not do:
/// they differ from one run of an app to the next.
#[derive(Default)]
struct Numbers {
    of: HashMap<Entity, u32>,
    next: u32,
}

impl Numbers {
    /// Numbers new surfaces by their places.
    fn update(
        &mut self,
        held: &HashMap<PatchKey, Option<PatchPoints>>,
        instances: &[PatchInstance],
    ) {
        let are_there: HashSet<Entity> = instances.iter().map(|instance| instance.entity).collect();
        self.of.retain(|entity, _| are_there.contains(entity));
        let mut new: Vec<([u32; 3], Entity)> = instances
            .iter()
            .filter(|instance| !self.of.contains_key(&instance.entity))
            .filter_map(|instance| {
                let place = held.get(&instance.key)?.as_ref()?.place();
                let place = instance.affine.transform_point3(place).to_array();
                Some((place.map(f32::to_bits), instance.entity))
            })
            .collect();
        // Stable: surfaces at one place stay in the order of their entities.
        new.sort_by_key(|(place, _)| *place);
        for (_, entity) in new {
            self.of.insert(entity, self.next);
            self.next = self.next.wrapping_add(1);
        }
    }

    /// Those with a number, in its order.
    fn sorted<'a>(&self, instances: &'a [PatchInstance]) -> Vec<(u32, &'a PatchInstance)> {
        let numbered = instances.iter().filter_map(|all| Some((*self.of.get(&all.entity)?, all)));
        let mut sorted: Vec<_> = numbered.collect();
        sorted.sort_unstable_by_key(|(number, _)| *number);
        sorted
    }
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
        &ActiveGi,
        &GlobalTransform,
        Has<EnvironmentMapLight>,
        Has<CameraCut>,
    )>,
    meshes: Query<SurfaceMesh, (Without<SkinnedMesh>, Without<NotShadowCaster>)>,
    gi_cameras: GiCameras,
    (changes, jumps): (Res<MeshChanges>, Res<Jumps>),
) {
    let Surfaces { points: surfaces, focuses: before, numbers } = &mut *surfaces;
    surfaces.cache.read(&mut events);
    let mut focuses: Vec<PatchFocus> = cameras
        .iter()
        .filter(|(_, camera, gi, _, has_map, _)| {
            camera.is_active && gi.reflects() && light.lights(gi, *has_map)
        })
        .map(|(entity, _, gi, transform, _, is_cut)| {
            let before = before.iter().find(|focus| focus.camera == entity && !is_cut);
            let shift = jumps.shifts.get(&entity).copied().unwrap_or_default();
            let before = before.map(|before| before.shifted(shift));
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
        |key| PatchPoints::new(key, &assets),
    );
    // What comes after a cut does not depend on what was before.
    let is_cut = cameras.iter().any(|(.., is_cut)| is_cut);
    if changed || is_cut || *before != focuses {
        let (values, instances) = (&mut surfaces.cache.values, &surfaces.instances);
        let are_refined = refine(values, instances, &focuses, is_cut, &assets);
        if is_cut {
            *numbers = Numbers::default();
        }
        numbers.update(values, instances);
        let sorted = numbers.sorted(instances);
        let set = |focus: &PatchFocus| {
            let camera = focus.camera;
            let chosen = chosen(values, &sorted, focus);
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

/// A camera's patches.
fn chosen(
    held: &HashMap<PatchKey, Option<PatchPoints>>,
    instances: &[(u32, &PatchInstance)],
    focus: &PatchFocus,
) -> Vec<Patch> {
    let mut candidates = Vec::new();
    for (number, instance) in instances {
        let Some(Some(held)) = held.get(&instance.key) else { continue };
        let points = held.in_use();
        let spread = area_matrix(&instance.affine);
        // A multiple of the golden ratio.
        let seed = number.wrapping_mul(2_654_435_769);
        for (index, point) in points.points.iter().enumerate() {
            let Some(sample) = point.sample else { continue };
            let facing = spread * point.normal;
            let position = instance.affine.transform_point3(point.position);
            let area = (points.area * f64::from(facing.length())) as f32;
            let normal = facing.normalize_or_zero();
            if !position.is_finite() || normal == Vec3::ZERO {
                continue;
            }
            let density = focus.density(position);
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
