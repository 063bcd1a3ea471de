//! Which meshes hide indirect light, and where they stand.

use std::sync::Arc;

use bevy::asset::{AssetEvent, AssetId, Assets};
use bevy::camera::Camera;
use bevy::camera::visibility::InheritedVisibility;
use bevy::ecs::prelude::*;
use bevy::light::NotShadowCaster;
use bevy::log::warn_once;
use bevy::material::AlphaMode;
use bevy::math::{Affine3A, Vec3};
use bevy::mesh::skinning::SkinnedMesh;
use bevy::mesh::{Mesh, Mesh3d};
use bevy::pbr::{MeshMaterial3d, StandardMaterial};
use bevy::platform::collections::{HashMap, HashSet};
use bevy::render::extract_resource::ExtractResource;
use bevy::tasks::futures::check_ready;
use bevy::tasks::{AsyncComputeTaskPool, Task};
use bevy::transform::components::GlobalTransform;
use bytemuck::{Pod, Zeroable};

use super::bvh::{FlatBvh, MeshBvh, Node, TriangleWords};
use crate::gi::settings::FrugalGi;

/// Meshes of up to so many triangles get their tree at once, in about a millisecond; larger ones in the background.
const TRIANGLES_AT_ONCE: usize = 4096;

/// `visibility/trace.wgsl`'s `Instance`.
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
}

/// Meshes in their places, and the tree over them.
#[derive(Debug, Default)]
pub(super) struct InstanceData {
    pub nodes: Vec<Node>,
    pub instances: Vec<Instance>,
}

/// What hides indirect light, kept while a camera asks for [`GiVisibility`](crate::gi::GiVisibility) and empty else.
///
/// Every visible mesh does but: transparent and transmissive ones, those with [`NotShadowCaster`], skinned ones (their triangles here are those of
/// the bind pose), and those whose asset is kept for the GPU alone (a warning says so). Alpha-masked meshes hide as if they were solid; morphs
/// and shaders that move vertices are not followed. Meshes of more than 4096 triangles are prepared in the background and hide nothing
/// until then.
#[derive(Resource, ExtractResource, Clone, Debug, Default)]
pub struct GiOccluders {
    pub(super) meshes: Arc<MeshData>,
    pub(super) instances: Arc<InstanceData>,
    waiting: usize,
}

impl GiOccluders {
    /// Meshes that are still being prepared.
    pub fn waiting(&self) -> usize {
        self.waiting
    }

    /// Triangles in all trees, each mesh counted once.
    pub fn triangle_count(&self) -> usize {
        self.meshes.triangles.len()
    }

    /// Meshes in the scene that hide light.
    pub fn instance_count(&self) -> usize {
        self.instances.instances.len()
    }
}

enum Tree {
    Building(Task<MeshBvh>),
    Ready(Arc<MeshBvh>),
    /// Its triangles are out of reach.
    Unreadable,
}

/// A tree per mesh, and what the present [`GiOccluders`] was made of.
#[derive(Resource, Default)]
pub(super) struct MeshTrees {
    trees: HashMap<AssetId<Mesh>, Tree>,
    placed: Vec<(Entity, AssetId<Mesh>, Affine3A)>,
    /// First node and number of nodes of each mesh in the present data.
    ranges: HashMap<AssetId<Mesh>, [u32; 2]>,
    /// Set when a tree was added, changed or dropped.
    changed: bool,
}

pub(super) fn update(
    mut trees: ResMut<MeshTrees>,
    mut occluders: ResMut<GiOccluders>,
    mut events: MessageReader<AssetEvent<Mesh>>,
    meshes: Res<Assets<Mesh>>,
    materials: Option<Res<Assets<StandardMaterial>>>,
    cameras: Query<(&Camera, &FrugalGi)>,
    placed: Query<
        (Entity, &Mesh3d, &GlobalTransform, &InheritedVisibility, Option<&MeshMaterial3d<StandardMaterial>>),
        (Without<NotShadowCaster>, Without<SkinnedMesh>),
    >,
) {
    for event in events.read() {
        if let AssetEvent::Modified { id } | AssetEvent::Removed { id } = event {
            trees.changed |= trees.trees.remove(id).is_some();
        }
    }
    if !cameras.iter().any(|(camera, gi)| camera.is_active && gi.traces()) {
        // The trees stay: made again in the background, they would be missing in the frames after rays are back. What was made of them goes, and with
        // it the buffers.
        if !trees.placed.is_empty() || occluders.waiting > 0 {
            *occluders = GiOccluders::default();
            trees.placed.clear();
            trees.changed = true;
        }
        return;
    }
    let is_solid = |material: Option<&MeshMaterial3d<StandardMaterial>>| {
        // A material of another kind is taken for solid: nothing is known of it.
        let Some(material) = material.zip(materials.as_ref()).and_then(|(handle, all)| all.get(handle)) else { return true };
        matches!(material.alpha_mode, AlphaMode::Opaque | AlphaMode::Mask(_) | AlphaMode::AlphaToCoverage)
            && material.specular_transmission <= 0.0
            && material.diffuse_transmission <= 0.0
    };
    let mut now: Vec<_> = placed
        .iter()
        .filter(|(_, _, _, visible, material)| visible.get() && is_solid(*material))
        .map(|(entity, mesh, transform, ..)| (entity, mesh.id(), transform.affine()))
        .collect();
    // Entities come in no particular order, and the tree over them should be the same in every run.
    now.sort_unstable_by_key(|(entity, ..)| *entity);
    let trees = &mut *trees;
    build_trees(trees, now.iter().map(|(_, mesh, _)| *mesh), &meshes);
    let waiting = trees.trees.values().filter(|tree| matches!(tree, Tree::Building(_))).count();
    if trees.changed || trees.placed != now {
        *occluders = assemble(trees, &now, &occluders);
        trees.placed = now;
        trees.changed = false;
    }
    if occluders.waiting != waiting {
        occluders.waiting = waiting;
    }
}

/// Starts trees for new meshes, takes those that are done, and drops those of meshes that are gone.
fn build_trees(trees: &mut MeshTrees, used: impl Iterator<Item = AssetId<Mesh>>, meshes: &Assets<Mesh>) {
    let used: HashSet<_> = used.collect();
    let before = trees.trees.len();
    trees.trees.retain(|mesh, _| used.contains(mesh));
    trees.changed |= trees.trees.len() != before;
    for mesh in used {
        match trees.trees.get_mut(&mesh) {
            Some(Tree::Building(task)) => {
                if let Some(tree) = check_ready(task) {
                    trees.trees.insert(mesh, Tree::Ready(Arc::new(tree)));
                    trees.changed = true;
                }
            }
            Some(_) => {}
            // An asset that is still loading is asked for again.
            None => {
                let Some(asset) = meshes.get(mesh) else { continue };
                let tree = match triangles(asset) {
                    None => {
                        warn_once!(
                            "a mesh is kept for the GPU alone or is no triangle list: it hides no indirect light (RenderAssetUsages::MAIN_WORLD keeps it readable)"
                        );
                        Tree::Unreadable
                    }
                    Some(triangles) if triangles.len() <= TRIANGLES_AT_ONCE => Tree::Ready(Arc::new(MeshBvh::new(triangles))),
                    Some(triangles) => Tree::Building(AsyncComputeTaskPool::get().spawn(async move { MeshBvh::new(triangles) })),
                };
                trees.trees.insert(mesh, tree);
                trees.changed = true;
            }
        }
    }
}

/// Every triangle in the mesh's own space; `None` where they cannot be read.
fn triangles(mesh: &Mesh) -> Option<Vec<[Vec3; 3]>> {
    let (positions, corners) = crate::gi::triangles::read(mesh)?;
    Some(corners.into_iter().map(|triangle| triangle.map(|corner| Vec3::from(positions[corner]))).collect())
}

/// Everything in its place. The meshes' data is made anew only when a tree changed.
fn assemble(trees: &mut MeshTrees, placed: &[(Entity, AssetId<Mesh>, Affine3A)], before: &GiOccluders) -> GiOccluders {
    let mut meshes = Arc::clone(&before.meshes);
    if trees.changed {
        let mut data = MeshData::default();
        trees.ranges.clear();
        for (_, mesh, _) in placed {
            let Some(Tree::Ready(tree)) = trees.trees.get(mesh) else { continue };
            trees.ranges.entry(*mesh).or_insert_with(|| {
                let (first, first_triangle) = (data.nodes.len() as u32, data.triangles.len() as u32);
                let moved = |node: &Node| {
                    let leaf = if node.leaf == 0 { 0 } else { node.leaf + (first_triangle << 3) };
                    Node { skip: node.skip + first, leaf, ..*node }
                };
                data.nodes.extend(tree.nodes.iter().map(moved));
                data.triangles.extend(&tree.triangles);
                [first, data.nodes.len() as u32]
            });
        }
        meshes = Arc::new(data);
    }
    let (mut boxes, mut instances) = (Vec::new(), Vec::new());
    for (_, mesh, affine) in placed {
        let (Some(Tree::Ready(tree)), Some(nodes)) = (trees.trees.get(mesh), trees.ranges.get(mesh)) else { continue };
        let inverse = affine.inverse();
        // Scaled to nothing, or so far away that nothing can be told: it hides nothing.
        let Some(bounds) = tree.bounds(affine).filter(|_| inverse.is_finite()) else { continue };
        boxes.push(bounds);
        let [x, y, z] = [inverse.matrix3.x_axis, inverse.matrix3.y_axis, inverse.matrix3.z_axis].map(|axis| axis.to_array());
        let offset = inverse.translation.to_array();
        let local_from_world = std::array::from_fn(|row| [x[row], y[row], z[row], offset[row]]);
        instances.push(Instance { local_from_world, nodes: *nodes, padding: [0; 2] });
    }
    let FlatBvh { nodes, order } = FlatBvh::new(&boxes);
    let instances = order.iter().map(|index| instances[*index as usize]).collect();
    GiOccluders { meshes, instances: Arc::new(InstanceData { nodes, instances }), waiting: before.waiting }
}
