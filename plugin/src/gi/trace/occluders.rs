//! Meshes that occlude indirect light, and their instances.

use std::sync::Arc;

use bevy::camera::Camera;
use bevy::camera::visibility::{InheritedVisibility, RenderLayers};
use bevy::ecs::prelude::*;
use bevy::light::{EnvironmentMapLight, NotShadowCaster};
use bevy::math::{Affine3A, Vec3A};
use bevy::mesh::Mesh3d;
use bevy::mesh::skinning::SkinnedMesh;
use bevy::pbr::{MeshMaterial3d, StandardMaterial};
use bevy::platform::collections::HashMap;
use bevy::render::extract_resource::ExtractResource;
use bevy::render::renderer::RenderDevice;
use bevy::transform::components::GlobalTransform;

use super::bvh::{FlatBvh, Node, refit};
use super::data::{Instance, InstanceData, MeshData, fits, instance};
use super::micromap::SOLID;
use super::skin::{Part, Skins};
use super::trees::{self, Tree, TreeKey, Trees, ready, waiting};
use crate::gi::compute::{largest_storage_buffer, limits_of};
use crate::gi::settings::FrugalGi;
use crate::gi::surfaces::{Mask, MeshDelta, SurfaceAssets, SurfaceEvents, occludes};
use crate::gi::view::{GiCameras, LightPresence, Showing};

/// The occluders of indirect light. Maintained while there is light and a camera with
/// [`GiVisibility`](crate::gi::GiVisibility), else empty.
///
/// These are all meshes that are visible and on a [render layer] of a GI camera; of the levels of
/// detail of a [`VisibilityRange`], the one at the camera's distance. Exceptions: transparent and
/// transmissive ones, those with [`NotShadowCaster`], and those whose asset is kept for the GPU alone
/// (with a warning). Of skinned meshes, each joint moves a rigid piece, slimmer where several joints
/// move it. Alpha masks
/// of [`StandardMaterial`] have holes for rays too, at 64 micro-triangles per triangle, where the CPU has the mask's image in an
/// uncompressed format (else no holes, with a warning). Where the image of
/// a mask changes in every frame, its meshes' trees are rebuilt in every frame. Morphs and shaders that move vertices are ignored. Meshes of
/// more than 4096 triangles, or 64 with a mask, are built in the background and occlude nothing
/// until then.
///
/// [render layer]: bevy::camera::visibility::RenderLayers
/// [`VisibilityRange`]: bevy::camera::visibility::VisibilityRange
#[derive(Resource, ExtractResource, Clone, Debug, Default)]
pub struct GiOccluders {
    pub(super) meshes: Arc<MeshData>,
    pub(super) instances: Arc<InstanceData>,
    waiting: usize,
    is_kept: bool,
}

impl GiOccluders {
    /// Whether occluders are maintained: a camera traces rays, and there is light.
    pub(in crate::gi) fn is_kept(&self) -> bool {
        self.is_kept
    }

    /// Number of meshes whose trees are still being built.
    pub fn waiting(&self) -> usize {
        self.waiting
    }

    /// Number of triangles in all trees; each mesh counts once.
    pub fn triangle_count(&self) -> usize {
        self.meshes.triangles.len()
    }

    /// Number of instances that occlude light.
    pub fn instance_count(&self) -> usize {
        self.instances.instances.len()
    }
}

/// A tree per mesh and mask, and the inputs of the current [`GiOccluders`].
#[derive(Resource, Default)]
pub(super) struct MeshTrees {
    trees: Trees,
    instances: Vec<(Part, TreeKey, Affine3A)>,
    /// Places of instances in the current data, and their boxes in its order.
    slots: HashMap<Part, usize>,
    bounds: Vec<(Vec3A, Vec3A)>,
    /// Sum of the half areas of the tree over instances when it was built.
    area: f32,
    /// Render layers of the GI cameras.
    layers: RenderLayers,
    /// The tree over instances no longer fits.
    must_build: bool,
    /// An asset was not loaded yet.
    lacks_assets: bool,
    /// First node and the one after the last of each tree in the current data.
    ranges: HashMap<(TreeKey, u16), [u32; 2]>,
}

pub(super) fn update(
    mut trees: ResMut<MeshTrees>,
    mut occluders: ResMut<GiOccluders>,
    mut events: SurfaceEvents,
    assets: SurfaceAssets,
    light: Res<LightPresence>,
    device: Option<Res<RenderDevice>>,
    cameras: Query<(&Camera, &FrugalGi, Has<EnvironmentMapLight>)>,
    gi_cameras: GiCameras,
    delta: Res<MeshDelta>,
    meshes: Query<
        (
            Entity,
            &Mesh3d,
            &GlobalTransform,
            &InheritedVisibility,
            Option<&MeshMaterial3d<StandardMaterial>>,
            Option<&SkinnedMesh>,
            Showing,
        ),
        Without<NotShadowCaster>,
    >,
    skins: Skins,
) {
    let trees = &mut *trees;
    trees.trees.read(&mut events);
    if !cameras
        .iter()
        .any(|(camera, gi, has_map)| camera.is_active && gi.traces() && light.lights(gi, has_map))
    {
        // The trees stay: rebuilt in the background, they would be missing in the first frames
        // after rays are switched on again. The assembled data and its buffers are dropped.
        if occluders.is_kept {
            *occluders = GiOccluders::default();
            trees.instances.clear();
            trees.slots.clear();
            trees.trees.changed = true;
        }
        return;
    }
    let shown = gi_cameras.shown();
    let is_same = !delta.altered
        && !trees.trees.changed
        && !trees.lacks_assets
        && occluders.waiting == 0
        && occluders.is_kept
        && trees.layers == *shown.layers();
    if is_same {
        let whole = delta.moved.iter().map(|(entity, affine)| (Part::whole(*entity), *affine));
        let moved: Vec<_> = whole.chain(skins.moved()).collect();
        if moved.is_empty() {
            return;
        }
        if let Some(instances) = move_instances(trees, &moved, &occluders.instances) {
            if !Arc::ptr_eq(&instances, &occluders.instances) {
                occluders.instances = instances;
            }
            return;
        }
        trees.must_build = true;
    }
    trees.layers = shown.layers().clone();
    let (mut now, mut lack_poses) = (Vec::new(), false);
    for (entity, mesh, transform, visible, material, skin, showing) in &meshes {
        if !visible.get() || !shown.has(&showing, transform) {
            continue;
        }
        // A material of another kind counts as solid.
        let material =
            material.zip(assets.materials.as_ref()).and_then(|(handle, all)| all.get(handle));
        if !material.is_none_or(occludes) {
            continue;
        }
        let mask = material.and_then(Mask::new);
        let key = TreeKey { mesh: mesh.id(), mask, is_skinned: skin.is_some() };
        let Some(skin) = skin else {
            now.push((Part::whole(entity), key, transform.affine()));
            continue;
        };
        match skins.places(skin) {
            Some(places) => {
                now.extend(places.map(|(joint, affine)| (Part { entity, joint }, key, affine)))
            }
            None => lack_poses = true,
        }
    }
    // Query order is arbitrary; sorting keeps the tree the same in every run.
    now.sort_unstable_by_key(|(part, ..)| *part);
    let are_loaded = trees::build(&mut trees.trees, now.iter().map(|(_, key, _)| *key), &assets);
    trees.lacks_assets = !are_loaded || lack_poses;
    let waiting = waiting(&trees.trees);
    if trees.trees.changed || trees.must_build || trees.instances != now || !occluders.is_kept {
        let most = largest_storage_buffer(&limits_of(device.as_deref())) as usize;
        *occluders = assemble(trees, &now, &occluders, most);
        trees.instances = now;
        (trees.trees.changed, trees.must_build) = (false, false);
    }
    if occluders.waiting != waiting {
        occluders.waiting = waiting;
    }
}

/// A tree over instances is built anew when its boxes have grown by this factor.
const MOST_GROWTH: f32 = 2.0;

/// The instances after some meshes moved: the same tree with other boxes. `None` where it must be
/// built anew.
fn move_instances(
    trees: &mut MeshTrees,
    moved: &[(Part, Affine3A)],
    before: &Arc<InstanceData>,
) -> Option<Arc<InstanceData>> {
    let mut after: Option<InstanceData> = None;
    for (part, place) in moved {
        // Others occlude nothing, wherever they are.
        let Ok(index) = trees.instances.binary_search_by_key(part, |(part, ..)| *part) else {
            continue;
        };
        let (_, key, affine) = &mut trees.instances[index];
        if affine == place {
            continue;
        }
        *affine = *place;
        let Some(Tree::Ready(pieces)) = trees.trees.values.get(key) else { return None };
        // Joints that move no triangles have no piece.
        let Some(tree) = pieces.of(part.joint) else { continue };
        let slot = *trees.slots.get(part)?;
        let nodes = *trees.ranges.get(&(*key, part.joint))?;
        let (instance, bounds) = instance(tree, nodes, affine)?;
        after.get_or_insert_with(|| InstanceData::clone(before)).instances[slot] = instance;
        trees.bounds[slot] = bounds;
    }
    let Some(mut after) = after else { return Some(Arc::clone(before)) };
    let area = refit(&mut after.nodes, &trees.bounds);
    (area <= MOST_GROWTH * trees.area).then(|| Arc::new(after))
}

/// Assembles the occluders in buffers of at most `most` bytes. The meshes' data is rebuilt only
/// when a tree changed.
fn assemble(
    trees: &mut MeshTrees,
    mesh_instances: &[(Part, TreeKey, Affine3A)],
    before: &GiOccluders,
    most: usize,
) -> GiOccluders {
    let mut meshes = Arc::clone(&before.meshes);
    if trees.trees.changed {
        let mut data = MeshData::default();
        trees.ranges.clear();
        for (part, key, _) in mesh_instances {
            let Some(tree) = ready(&trees.trees, key, part.joint) else { continue };
            if trees.ranges.contains_key(&(*key, part.joint))
                || !fits(&data.nodes, tree.nodes.len(), most)
                || !fits(&data.triangles, tree.triangles.len(), most)
            {
                continue;
            }
            let (first, first_triangle) = (data.nodes.len() as u32, data.triangles.len() as u32);
            let moved = |node: &Node| {
                let leaf = if node.leaf == 0 { 0 } else { node.leaf + (first_triangle << 3) };
                Node { skip: node.skip + first, leaf, ..*node }
            };
            data.nodes.extend(tree.nodes.iter().map(moved));
            data.triangles.extend(&tree.triangles);
            data.is_masked |= tree.triangles.iter().any(|triangle| triangle.map() != SOLID);
            trees.ranges.insert((*key, part.joint), [first, data.nodes.len() as u32]);
        }
        meshes = Arc::new(data);
    }
    let (mut boxes, mut instances) = (Vec::new(), Vec::<Instance>::new());
    let mut parts = Vec::new();
    for (part, key, affine) in mesh_instances {
        let (Some(tree), Some(nodes)) =
            (ready(&trees.trees, key, part.joint), trees.ranges.get(&(*key, part.joint)))
        else {
            continue;
        };
        if !fits(&instances, 1, most) {
            break;
        }
        let Some((instance, bounds)) = instance(tree, *nodes, affine) else { continue };
        boxes.push(bounds);
        instances.push(instance);
        parts.push(*part);
    }
    let FlatBvh { mut nodes, order } = FlatBvh::new(&boxes);
    let instances = order.iter().map(|index| instances[*index as usize]).collect();
    trees.bounds = order.iter().map(|index| boxes[*index as usize]).collect();
    trees.slots =
        order.iter().enumerate().map(|(slot, index)| (parts[*index as usize], slot)).collect();
    trees.area = refit(&mut nodes, &trees.bounds);
    GiOccluders {
        meshes,
        instances: Arc::new(InstanceData { nodes, instances }),
        waiting: before.waiting,
        is_kept: true,
    }
}
