//! The patches of every camera with more than one bounce.

use std::sync::Arc;

use bevy::light::NotShadowCaster;
use bevy::mesh::skinning::SkinnedMesh;
use bevy::platform::collections::{HashMap, HashSet};
use bevy::prelude::*;
use bevy::render::extract_resource::ExtractResource;

use super::choice::{PATCHES, Patch, PatchFocus};
use super::chosen::{Chosen, Places};
use super::points::{POINTS, PatchInstance, PatchKey, PatchPoints, refine};
use crate::cut::{CameraCut, Jumps};
use crate::gi::surfaces::{
    MeshChanges, Reflectance, SurfaceAssets, SurfaceChange, SurfaceMesh, SurfaceSet,
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
/// and skinned ones, whose triangles here are those of the bind pose. Of the levels of detail of a
/// `VisibilityRange`, the one at the camera's distance reflects. Morphs, shaders that move vertices and
/// other kinds of material are ignored. Textures of base colour, metallic and roughness that the CPU
/// cannot read are copied from the GPU first.
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
    /// Number of each instance, and the indices of those with one, in its order.
    numbered: (Vec<Option<u32>>, Vec<usize>),
    /// Importance of each instance when points were last refined.
    importances: Vec<f64>,
    /// For each focus.
    chosen: Vec<Chosen>,
}

/// Change of a surface's importance, as a factor, from which points are refined anew.
const OTHER_IMPORTANCE: f64 = 2.0;

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
}

pub(super) fn update(
    mut surfaces: ResMut<Surfaces>,
    mut patches: ResMut<GiPatches>,
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
    let Surfaces { points: surfaces, focuses: before, numbers, numbered, importances, chosen } =
        &mut *surfaces;
    surfaces.cache.read(&changes);
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
            chosen.clear();
            *patches = GiPatches::default();
        }
        return;
    }
    // Query order is arbitrary; sorting keeps patches the same in every run.
    focuses.sort_unstable_by_key(|focus| focus.camera);
    let materials = assets.materials.as_deref();
    let change = surfaces.update(
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
    let is_as_before = !is_cut && *before == focuses;
    let (values, instances) = (&mut surfaces.cache.values, &surfaces.instances);
    let importance = |values: &HashMap<PatchKey, Option<PatchPoints>>, instance: &PatchInstance| {
        let points = values.get(&instance.key).and_then(Option::as_ref);
        let found = points.map_or(0.0, |points| points.importance(&instance.affine, &focuses));
        if found.is_finite() { found } else { 0.0 }
    };
    let moved = match change {
        SurfaceChange::Nothing if is_as_before => return,
        SurfaceChange::Moved(moved) if is_as_before => {
            let least = importances.iter().sum::<f64>() / POINTS as f64;
            let is_alike = |index: &usize| {
                let [old, now] = [importances[*index], importance(values, &instances[*index])];
                let [low, high] = [old.min(now), old.max(now)];
                high <= least || high < OTHER_IMPORTANCE * low
            };
            moved.iter().all(is_alike).then_some(moved)
        }
        _ => None,
    };
    if moved.is_none() {
        *importances = instances.iter().map(|instance| importance(values, instance)).collect();
        surfaces.cache.changed = !refine(values, instances, importances, is_cut, &assets);
        if is_cut {
            *numbers = Numbers::default();
        }
        numbers.update(values, instances);
        let number = |instance: &PatchInstance| numbers.of.get(&instance.entity).copied();
        let of: Vec<Option<u32>> = instances.iter().map(number).collect();
        let mut order: Vec<usize> = (0..of.len()).filter(|index| of[*index].is_some()).collect();
        order.sort_unstable_by_key(|index| of[*index]);
        *numbered = (of, order);
        *chosen = focuses.iter().map(|focus| Chosen::new(*focus)).collect();
        *before = focuses;
    }
    let places = Places { held: values, instances, numbers: &numbered.0, order: &numbered.1 };
    let importance = importances.iter().sum();
    let sets = chosen.iter_mut().map(|chosen| {
        let camera = chosen.focus.camera;
        let now = chosen.patches(&places, moved.as_deref(), importance);
        // Keeps the old patches where another camera moved or a change was far away.
        let same = patches.sets.iter().find(|set| set.camera == camera && *set.patches == now);
        PatchSet {
            camera,
            patches: same.map_or_else(|| Arc::new(now), |set| Arc::clone(&set.patches)),
        }
    });
    let sets = sets.collect();
    *patches = GiPatches { sets };
}
