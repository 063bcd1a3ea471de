//! Meshes that occlude indirect light, and their instances.

use std::sync::Arc;

use bevy::asset::AssetId;
use bevy::camera::Camera;
use bevy::camera::visibility::{InheritedVisibility, RenderLayers};
use bevy::ecs::prelude::*;
use bevy::image::Image;
use bevy::light::{EnvironmentMapLight, NotShadowCaster};
use bevy::log::warn_once;
use bevy::math::{Affine3A, Vec3A};
use bevy::mesh::skinning::SkinnedMesh;
use bevy::mesh::{Mesh, Mesh3d};
use bevy::pbr::{MeshMaterial3d, StandardMaterial};
use bevy::platform::collections::HashMap;
use bevy::render::extract_resource::ExtractResource;
use bevy::render::renderer::RenderDevice;
use bevy::tasks::futures::check_ready;
use bevy::tasks::{AsyncComputeTaskPool, Task};
use bevy::transform::components::GlobalTransform;
use bytemuck::{Pod, Zeroable};

use super::bvh::{FlatBvh, MeshBvh, Node, TriangleWords, refit};
use super::changes::MeshChanges;
use super::micromap::{SOLID, micromap};
use crate::gi::compute::{largest_storage_buffer, limits_of};
use crate::gi::settings::FrugalGi;
use crate::gi::surfaces::{
    Cutout, Mask, SurfaceAssets, SurfaceCache, SurfaceEvents, SurfaceKey, Triangles, occludes,
    triangles,
};
use crate::gi::view::{GiCameras, LightPresence, Showing};

/// Trees of meshes of up to so many triangles are built at once, in about a millisecond; larger
/// ones in the background.
const TRIANGLES_AT_ONCE: usize = 4096;
/// Weight of a triangle with an alpha mask in that count: its mask is sampled 512 times.
const MASKED_TRIANGLE: usize = 64;

/// `trace/trace.wgsl`'s `Instance`.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Instance {
    /// Rows of the matrix from the world to the mesh.
    pub local_from_world: [[f32; 4]; 3],
    /// The mesh's first node and the one after its last.
    pub nodes: [u32; 2],
    pub padding: [u32; 2],
}

/// Trees of all meshes, one after another.
#[derive(Debug, Default)]
pub(super) struct MeshData {
    pub nodes: Vec<Node>,
    pub triangles: Vec<TriangleWords>,
    /// Whether any triangle has holes.
    pub is_masked: bool,
}

/// Instances of meshes, and the tree over them.
#[derive(Clone, Debug, Default)]
pub(super) struct InstanceData {
    pub nodes: Vec<Node>,
    pub instances: Vec<Instance>,
}

/// The occluders of indirect light. Maintained while there is light and a camera with
/// [`GiVisibility`](crate::gi::GiVisibility), else empty.
///
/// These are all meshes that are visible and on a [render layer] of a GI camera; of the levels of
/// detail of a [`VisibilityRange`], the one at the camera's distance. Exceptions: transparent and
/// transmissive ones, those with [`NotShadowCaster`], skinned ones (their triangles here are those
/// of the bind pose), and those whose asset is kept for the GPU alone (with a warning). Alpha masks
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

enum Tree {
    Building(Task<MeshBvh>),
    Ready(Arc<MeshBvh>),
    /// Its triangles cannot be read.
    Unreadable,
}

/// A mesh and its alpha mask.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct TreeKey {
    mesh: AssetId<Mesh>,
    mask: Option<Mask>,
}

impl SurfaceKey for TreeKey {
    fn mesh(&self) -> AssetId<Mesh> {
        self.mesh
    }

    fn reads(&self, image: AssetId<Image>) -> bool {
        self.mask.is_some_and(|mask| mask.reads(image))
    }
}

/// A tree per mesh and mask, and the inputs of the current [`GiOccluders`].
#[derive(Resource, Default)]
pub(super) struct MeshTrees {
    trees: SurfaceCache<TreeKey, Tree>,
    instances: Vec<(Entity, TreeKey, Affine3A)>,
    /// Places of instances in the current data, by entity, and their boxes in its order.
    slots: HashMap<Entity, usize>,
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
    ranges: HashMap<TreeKey, [u32; 2]>,
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
    mut changes: MeshChanges,
    meshes: Query<
        (
            Entity,
            &Mesh3d,
            &GlobalTransform,
            &InheritedVisibility,
            Option<&MeshMaterial3d<StandardMaterial>>,
            Showing,
        ),
        (Without<NotShadowCaster>, Without<SkinnedMesh>),
    >,
) {
    let trees = &mut *trees;
    let are_altered = changes.are_altered();
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
    let is_same = !are_altered
        && !trees.trees.changed
        && !trees.lacks_assets
        && occluders.waiting == 0
        && occluders.is_kept
        && trees.layers == *shown.layers();
    if is_same {
        let moved: Vec<_> = changes.moved().collect();
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
    let mut now: Vec<_> = meshes
        .iter()
        .filter(|(_, _, transform, visible, _, showing)| {
            visible.get() && shown.has(showing, transform)
        })
        .filter_map(|(entity, mesh, transform, _, material, _)| {
            // A material of another kind counts as solid.
            let material =
                material.zip(assets.materials.as_ref()).and_then(|(handle, all)| all.get(handle));
            let mask = material.and_then(Mask::new);
            material
                .is_none_or(occludes)
                .then(|| (entity, TreeKey { mesh: mesh.id(), mask }, transform.affine()))
        })
        .collect();
    // Query order is arbitrary; sorting keeps the tree the same in every run.
    now.sort_unstable_by_key(|(entity, ..)| *entity);
    trees.lacks_assets =
        !build_trees(&mut trees.trees, now.iter().map(|(_, key, _)| *key), &assets);
    let waiting =
        trees.trees.values.values().filter(|tree| matches!(tree, Tree::Building(_))).count();
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

/// Collects finished trees, drops those of removed meshes, and starts building those of new ones.
/// Returns whether all assets were loaded.
fn build_trees(
    trees: &mut SurfaceCache<TreeKey, Tree>,
    used: impl Iterator<Item = TreeKey>,
    assets: &SurfaceAssets,
) -> bool {
    for tree in trees.values.values_mut() {
        if let Tree::Building(task) = tree
            && let Some(built) = check_ready(task)
        {
            *tree = Tree::Ready(Arc::new(built));
            trees.changed = true;
        }
    }
    let mut are_loaded = true;
    trees.fill(used, |key| {
        let tree = start(key, assets);
        are_loaded &= tree.is_some();
        tree
    });
    are_loaded
}

/// Builds a mesh's tree, at once or in the background; `None` while its assets are not loaded.
fn start(key: &TreeKey, assets: &SurfaceAssets) -> Option<Tree> {
    let mesh = assets.meshes.get(key.mesh)?;
    let cutout =
        Cutout::new(key.mask.as_ref(), mesh, assets.images.as_deref())?.map(Cutout::into_owned);
    let Some(Triangles { corners, positions }) = triangles(mesh) else {
        warn_once!(
            "a mesh is kept for the GPU alone or is no triangle list: it occludes no indirect light (RenderAssetUsages::MAIN_WORLD keeps it readable)"
        );
        return Some(Tree::Unreadable);
    };
    let work = corners.len() * if cutout.is_some() { MASKED_TRIANGLE } else { 1 };
    let build = move || {
        MeshBvh::new(
            positions
                .into_iter()
                .zip(corners.into_iter().map(|corners| holes(cutout.as_ref(), corners))),
        )
    };
    Some(if work <= TRIANGLES_AT_ONCE {
        Tree::Ready(Arc::new(build()))
    } else {
        Tree::Building(AsyncComputeTaskPool::get().spawn(async move { build() }))
    })
}

/// A triangle's micromap.
fn holes(cutout: Option<&Cutout>, corners: [usize; 3]) -> u64 {
    match cutout {
        Some(cutout) if cutout.may_pierce(corners) => {
            micromap(|weights| cutout.is_opaque(corners, weights))
        }
        _ => SOLID,
    }
}

/// An instance of a mesh's tree, and its box; `None` where it is scaled to nothing or out of the
/// range of floats, and occludes nothing.
fn instance(
    tree: &MeshBvh,
    nodes: [u32; 2],
    affine: &Affine3A,
) -> Option<(Instance, (Vec3A, Vec3A))> {
    let inverse = affine.inverse();
    let bounds = tree.bounds(affine).filter(|_| inverse.is_finite())?;
    let [x, y, z] = [inverse.matrix3.x_axis, inverse.matrix3.y_axis, inverse.matrix3.z_axis]
        .map(|axis| axis.to_array());
    let offset = inverse.translation.to_array();
    let local_from_world = std::array::from_fn(|row| [x[row], y[row], z[row], offset[row]]);
    Some((Instance { local_from_world, nodes, padding: [0; 2] }, bounds))
}

/// A tree over instances is built anew when its boxes have grown by this factor.
const MOST_GROWTH: f32 = 2.0;

/// The instances after some meshes moved: the same tree with other boxes. `None` where it must be
/// built anew.
fn move_instances(
    trees: &mut MeshTrees,
    moved: &[(Entity, &GlobalTransform)],
    before: &Arc<InstanceData>,
) -> Option<Arc<InstanceData>> {
    let mut after: Option<InstanceData> = None;
    for (entity, transform) in moved {
        // Others occlude nothing, wherever they are.
        let Ok(index) = trees.instances.binary_search_by_key(entity, |(entity, ..)| *entity) else {
            continue;
        };
        let (_, key, affine) = &mut trees.instances[index];
        if *affine == transform.affine() {
            continue;
        }
        *affine = transform.affine();
        let slot = *trees.slots.get(entity)?;
        let Some(Tree::Ready(tree)) = trees.trees.values.get(key) else { return None };
        let (instance, bounds) = instance(tree, *trees.ranges.get(key)?, affine)?;
        after.get_or_insert_with(|| InstanceData::clone(before)).instances[slot] = instance;
        trees.bounds[slot] = bounds;
    }
    let Some(mut after) = after else { return Some(Arc::clone(before)) };
    let area = refit(&mut after.nodes, &trees.bounds);
    (area <= MOST_GROWTH * trees.area).then(|| Arc::new(after))
}

/// Whether `count` more items fit behind those of `items` in a buffer of `most` bytes; warns once
/// if not.
fn fits<T>(items: &[T], count: usize, most: usize) -> bool {
    let fits = (items.len() + count) * size_of::<T>() <= most;
    if !fits {
        warn_once!(
            "the scene's meshes exceed this GPU's largest storage buffer: those that are left out occlude no indirect light"
        );
    }
    fits
}

/// Assembles the occluders in buffers of at most `most` bytes. The meshes' data is rebuilt only
/// when a tree changed.
fn assemble(
    trees: &mut MeshTrees,
    mesh_instances: &[(Entity, TreeKey, Affine3A)],
    before: &GiOccluders,
    most: usize,
) -> GiOccluders {
    let mut meshes = Arc::clone(&before.meshes);
    if trees.trees.changed {
        let mut data = MeshData::default();
        trees.ranges.clear();
        for (_, key, _) in mesh_instances {
            let Some(Tree::Ready(tree)) = trees.trees.values.get(key) else { continue };
            if trees.ranges.contains_key(key)
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
            trees.ranges.insert(*key, [first, data.nodes.len() as u32]);
        }
        meshes = Arc::new(data);
    }
    let (mut boxes, mut instances) = (Vec::new(), Vec::<Instance>::new());
    let mut entities = Vec::new();
    for (entity, key, affine) in mesh_instances {
        let (Some(Tree::Ready(tree)), Some(nodes)) =
            (trees.trees.values.get(key), trees.ranges.get(key))
        else {
            continue;
        };
        if !fits(&instances, 1, most) {
            break;
        }
        let Some((instance, bounds)) = instance(tree, *nodes, affine) else { continue };
        boxes.push(bounds);
        instances.push(instance);
        entities.push(*entity);
    }
    let FlatBvh { mut nodes, order } = FlatBvh::new(&boxes);
    let instances = order.iter().map(|index| instances[*index as usize]).collect();
    trees.bounds = order.iter().map(|index| boxes[*index as usize]).collect();
    trees.slots =
        order.iter().enumerate().map(|(slot, index)| (entities[*index as usize], slot)).collect();
    trees.area = refit(&mut nodes, &trees.bounds);
    GiOccluders {
        meshes,
        instances: Arc::new(InstanceData { nodes, instances }),
        waiting: before.waiting,
        is_kept: true,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_exceeds_the_largest_buffer_is_left_out() {
        assert!(fits(&[0u32; 3], 1, 16) && !fits(&[0u32; 3], 2, 16) && fits::<u32>(&[], 0, 0));
    }
}
