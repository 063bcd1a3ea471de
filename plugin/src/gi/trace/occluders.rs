//! Meshes that occlude indirect light, and their instances.

use std::collections::VecDeque;

use bevy::camera::visibility::RenderLayers;
use bevy::ecs::query::QueryData;
use bevy::light::NotShadowCaster;
use bevy::math::Affine3A;
use bevy::mesh::skinning::SkinnedMesh;
use bevy::platform::collections::{HashMap, HashSet};
use bevy::prelude::*;
use bevy::render::extract_resource::ExtractResource;
use bevy::render::renderer::RenderDevice;

use super::geometry::Geometry;
use super::mesh::{Instance, instance};
use super::skin::{InstanceKey, Skins};
use super::top::{Bounds, TopTree};
use super::trees::{self, TreeKey, Trees, ready, waiting};
use crate::gi::compute::{largest_storage_buffer, limits_of};
use crate::gi::surfaces::{Mask, MeshChanges, SurfaceAssets, occludes};
use crate::gi::view::{ActiveGi, GiCameras, LightPresence, MeshVisibility, VisibilityFilter};

/// The occluders of indirect light. Maintained while there is light and a camera with
/// [`GiVisibility`](crate::gi::GiVisibility), else empty.
///
/// These are all meshes that are visible and on a [render layer] of a GI camera; of the levels of
/// detail of a [`VisibilityRange`], the one at the camera's distance. Exceptions: transparent and
/// transmissive ones, those with [`NotShadowCaster`], and those whose asset is kept for the GPU alone
/// (with a warning). Of skinned meshes, each joint moves a rigid piece, slimmer where several joints
/// move it. Alpha masks of [`StandardMaterial`] have holes for rays too, at 64 micro-triangles per
/// triangle; a mask that the CPU cannot read is copied from the GPU first. Where a mask's image
/// changes in every frame, its meshes' trees are rebuilt in every frame. Morphs and shaders that move
/// vertices are ignored. Meshes of more than 4096 triangles, or 64 with a mask, are built in the
/// background and occlude nothing until then. Where fewer meshes come than are there, 256 a frame
/// become occluders, so that what a level streams in is spread over frames.
///
/// [render layer]: bevy::camera::visibility::RenderLayers
/// [`VisibilityRange`]: bevy::camera::visibility::VisibilityRange
#[derive(Resource, ExtractResource, Clone, Debug, Default, PartialEq)]
pub struct GiOccluders {
    waiting: usize,
    triangles: usize,
    instances: usize,
    is_kept: bool,
}

impl GiOccluders {
    /// Whether occluders are maintained: a camera traces rays, and there is light.
    pub(in crate::gi) fn is_kept(&self) -> bool {
        self.is_kept
    }

    /// Number of meshes that do not occlude light yet: those whose trees are still being built, and
    /// those for which earlier frames had no time.
    pub fn waiting(&self) -> usize {
        self.waiting
    }

    /// Number of triangles in all trees; each mesh counts once.
    pub fn triangle_count(&self) -> usize {
        self.triangles
    }

    /// Number of instances that occlude light.
    pub fn instance_count(&self) -> usize {
        self.instances
    }
}

/// Meshes that become occluders in one frame, at most, where fewer come than are there. Higher
/// values: they occlude earlier, and frames in which many come take longer.
const MAX_NEW: usize = 256;

/// What occludes light, and the trees of it.
#[derive(Resource, Default)]
pub(super) struct OccluderScene {
    trees: Trees,
    /// Each part's tree, and what maps that to the world.
    parts: HashMap<InstanceKey, (TreeKey, Affine3A)>,
    /// Numbers of joints of skinned meshes.
    joints: HashMap<Entity, u16>,
    /// Number of parts with each tree.
    uses: HashMap<TreeKey, usize>,
    /// The trees that are built.
    pub(super) geometry: Geometry,
    /// The instances of parts whose trees are built.
    pub(super) top: TopTree,
    /// Skinned meshes whose bind poses were not loaded yet.
    without_poses: Vec<Entity>,
    /// Meshes that came and are no occluders yet, in their order.
    new: VecDeque<Entity>,
    /// An asset was not loaded yet.
    lacks_assets: bool,
    /// Render layers of the GI cameras.
    layers: RenderLayers,
}

/// Parts whose tree or place is new, and parts that are gone.
#[derive(Default)]
struct Edit {
    set: Vec<InstanceKey>,
    removed: Vec<InstanceKey>,
}

/// A mesh that may occlude light.
type Mesh<'a> = (
    Entity,
    &'a Mesh3d,
    &'a GlobalTransform,
    &'a InheritedVisibility,
    Option<&'a MeshMaterial3d<StandardMaterial>>,
    Option<&'a SkinnedMesh>,
    MeshVisibility,
);

pub(super) fn update(
    mut scene: ResMut<OccluderScene>,
    mut occluders: ResMut<GiOccluders>,
    assets: SurfaceAssets,
    light: Res<LightPresence>,
    device: Option<Res<RenderDevice>>,
    cameras: Query<(&Camera, &ActiveGi, Has<EnvironmentMapLight>)>,
    gi_cameras: GiCameras,
    changes: Res<MeshChanges>,
    meshes: Query<Mesh<'static>, Without<NotShadowCaster>>,
    skins: Skins,
) {
    let scene = &mut *scene;
    scene.geometry.end_version();
    scene.top.end_version();
    scene.trees.read(&changes);
    if !cameras
        .iter()
        .any(|(camera, gi, has_map)| camera.is_active && gi.traces() && light.lights(gi, has_map))
    {
        // The trees stay: rebuilt in the background, they would be missing in the first frames
        // after rays are switched on again. The arrays and their buffers are dropped.
        if occluders.is_kept {
            *occluders = GiOccluders::default();
            scene.clear();
            scene.geometry.clear();
            scene.top.clear();
        }
        return;
    }
    let shown = gi_cameras.shown();
    let is_whole = changes.unknown || !occluders.is_kept || scene.layers != *shown.layers();
    let mut edit = Edit::default();
    let read = |mesh| scene_parts(mesh, &shown, &assets, &skins);
    if is_whole {
        scene.layers = shown.layers().clone();
        scene.clear();
        for mesh in &meshes {
            scene.put(mesh.0, read(mesh), &mut edit);
        }
    } else {
        let (known, mut new): (Vec<_>, Vec<_>) =
            changes.altered.iter().copied().partition(|entity| scene.holds(*entity));
        if !new.is_empty() {
            // Those that went in the same frame, or that wait already, do not come. Some are named twice.
            let mut queued: HashSet<Entity> = scene.new.iter().copied().collect();
            // Nor do those that occlude nothing, such as hidden levels of detail.
            let occludes = |entity: Entity| {
                meshes
                    .get(entity)
                    .is_ok_and(|mesh| read(mesh).is_none_or(|parts| !parts.is_empty()))
            };
            new.retain(|entity| queued.insert(*entity) && occludes(*entity));
        }
        // A scene that arrives is no stream: it is there at once, in one long frame.
        let most = if new.len() > scene.parts.len() { usize::MAX } else { MAX_NEW };
        if !changes.gone.is_empty() {
            scene.new.retain(|entity| meshes.contains(*entity));
        }
        scene.new.extend(new);
        let mut due = known;
        due.append(&mut scene.without_poses);
        due.extend(scene.new.drain(..most.min(scene.new.len())));
        for entity in due {
            let parts = meshes.get(entity).map_or(Some(Vec::new()), read);
            scene.put(entity, parts, &mut edit);
        }
        let whole =
            changes.moved.iter().map(|(entity, affine)| (InstanceKey::whole(*entity), *affine));
        for (part, affine) in whole.chain(skins.moved()) {
            // Others occlude nothing, wherever they are.
            if let Some((_, before)) = scene.parts.get_mut(&part)
                && *before != affine
            {
                *before = affine;
                edit.set.push(part);
            }
        }
    }
    if is_whole
        || !edit.set.is_empty()
        || !edit.removed.is_empty()
        || scene.trees.changed
        || scene.lacks_assets
        || occluders.waiting > 0
    {
        scene.lacks_assets = !trees::build(&mut scene.trees, scene.uses.keys().copied(), &assets);
    } else if !scene.top.is_rebuilt() {
        return;
    }
    let most = largest_storage_buffer(&limits_of(device.as_deref())) as usize;
    if scene.trees.changed || is_whole {
        let changed: HashSet<TreeKey> =
            scene.geometry.update(&scene.trees, most).into_iter().collect();
        scene.trees.changed = false;
        let parts = scene.parts.iter().filter(|(_, (key, _))| changed.contains(key));
        edit.set.extend(parts.map(|(part, _)| *part));
    }
    // Hash order is arbitrary; sorting keeps the tree the same in every run.
    edit.set.sort_unstable();
    edit.set.dedup();
    let (mut placed, mut removed) = (Vec::with_capacity(edit.set.len()), edit.removed);
    for part in edit.set {
        match scene.place(&part) {
            Some((instance, bounds)) => placed.push((part, instance, bounds)),
            None => removed.push(part),
        }
    }
    removed.retain(|part| scene.top.holds(part));
    if is_whole {
        scene.top.build(&placed, most);
    } else if !placed.is_empty() || !removed.is_empty() || scene.top.is_rebuilt() {
        scene.top.edit(placed, &removed, most);
    }
    occluders.set_if_neq(GiOccluders {
        waiting: waiting(&scene.trees) + scene.new.len(),
        triangles: scene.geometry.triangle_count,
        instances: scene.top.len(),
        is_kept: true,
    });
}

/// The parts of a mesh that occlude light, each with its tree and what maps that to the world;
/// `None` while its bind poses are not loaded.
fn scene_parts(
    (entity, mesh, transform, visible, material, skin, showing): <Mesh<'static> as QueryData>::Item<
        '_,
        '_,
    >,
    shown: &VisibilityFilter,
    assets: &SurfaceAssets,
    skins: &Skins,
) -> Option<Vec<(InstanceKey, TreeKey, Affine3A)>> {
    if !visible.get() || !shown.has(&showing, transform) {
        return Some(Vec::new());
    }
    // A material of another kind counts as solid.
    let material =
        material.zip(assets.materials.as_ref()).and_then(|(handle, all)| all.get(handle));
    if !material.is_none_or(occludes) {
        return Some(Vec::new());
    }
    let mask = material.and_then(Mask::new);
    let key = TreeKey { mesh: mesh.id(), mask, is_skinned: skin.is_some() };
    let Some(skin) = skin else {
        return Some(vec![(InstanceKey::whole(entity), key, transform.affine())]);
    };
    let places = skins.places(skin)?;
    Some(places.map(|(joint, affine)| (InstanceKey { entity, joint }, key, affine)).collect())
}

impl OccluderScene {
    fn clear(&mut self) {
        self.parts.clear();
        self.joints.clear();
        self.uses.clear();
        self.without_poses.clear();
        self.new.clear();
    }

    /// Whether a mesh has parts.
    fn holds(&self, entity: Entity) -> bool {
        self.parts.contains_key(&InstanceKey::whole(entity)) || self.joints.contains_key(&entity)
    }

    /// Replaces the parts of a mesh; `None`: its bind poses are not loaded yet.
    fn put(
        &mut self,
        entity: Entity,
        parts: Option<Vec<(InstanceKey, TreeKey, Affine3A)>>,
        edit: &mut Edit,
    ) {
        if parts.is_none() {
            self.without_poses.push(entity);
        }
        let parts = parts.unwrap_or_default();
        // The joints that a skinned mesh had, or the mesh itself.
        let joints = self.joints.remove(&entity).unwrap_or(1);
        let before = (0..joints).map(|joint| InstanceKey { entity, joint });
        for part in before.filter(|part| !parts.iter().any(|(now, ..)| now == part)) {
            if let Some((key, _)) = self.parts.remove(&part) {
                self.release(&key);
                edit.removed.push(part);
            }
        }
        if let Some((last, ..)) = parts.last().filter(|(_, key, _)| key.is_skinned) {
            self.joints.insert(entity, last.joint + 1);
        }
        for (part, key, affine) in parts {
            let before = self.parts.insert(part, (key, affine));
            if before == Some((key, affine)) {
                continue;
            }
            *self.uses.entry(key).or_default() += 1;
            if let Some((key, _)) = before {
                self.release(&key);
            }
            edit.set.push(part);
        }
    }

    fn release(&mut self, key: &TreeKey) {
        if let Some(count) = self.uses.get_mut(key) {
            *count -= 1;
            if *count == 0 {
                self.uses.remove(key);
            }
        }
    }

    /// A part's instance; `None` where nothing of it occludes light.
    fn place(&self, part: &InstanceKey) -> Option<(Instance, Bounds)> {
        let (key, affine) = self.parts.get(part)?;
        let root = self.geometry.root_of(key, part.joint)?;
        instance(ready(&self.trees, key, part.joint)?, root, affine)
    }
}
