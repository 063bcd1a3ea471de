//! Trees over the triangles of meshes, built once for each mesh and alpha mask.

use std::sync::Arc;

use bevy::platform::collections::HashSet;
use bevy::prelude::*;
use bevy::tasks::futures::check_ready;
use bevy::tasks::{AsyncComputeTaskPool, Task};

use super::mesh::{MeshBvh, SOLID, micromap};
use super::skin::{Influences, split};
use super::wide::TRIANGLES_AT_ONCE;
use crate::gi::surfaces::{
    Cutout, Mask, SurfaceAssets, SurfaceCache, SurfaceKey, Triangles, triangles,
};

/// Meshes are built at once in a frame up to so many triangles together, so that a level that is
/// streamed in stalls no frame; the rest of them in the background.
const TRIANGLES_PER_FRAME: usize = 4 * TRIANGLES_AT_ONCE;
/// Weight of a triangle with an alpha mask in these counts: its mask is sampled 512 times.
const MASKED_TRIANGLE: usize = 64;

/// A tree for each joint that moves any triangles, in the order of joints. A mesh without a skin
/// has one, for joint 0.
pub(super) type JointBvhs = Vec<(u16, MeshBvh)>;

/// A mesh's tree.
pub(super) enum Tree {
    Building(Task<JointBvhs>),
    Ready(Arc<JointBvhs>),
    /// Its triangles cannot be read.
    Unreadable,
}

/// A mesh, its alpha mask, and whether joints move it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) struct TreeKey {
    pub mesh: AssetId<Mesh>,
    pub mask: Option<Mask>,
    pub is_skinned: bool,
}

impl SurfaceKey for TreeKey {
    fn mesh(&self) -> AssetId<Mesh> {
        self.mesh
    }

    fn reads(&self, images: &HashSet<AssetId<Image>>) -> bool {
        self.mask.is_some_and(|mask| mask.reads(images))
    }
}

/// All trees in use.
pub(super) type Trees = SurfaceCache<TreeKey, Tree>;

/// What a joint moves of a mesh, once its tree is built.
pub(super) fn ready<'a>(trees: &'a Trees, key: &TreeKey, joint: u16) -> Option<&'a MeshBvh> {
    let Some(Tree::Ready(pieces)) = trees.values.get(key) else { return None };
    let place = pieces.binary_search_by_key(&joint, |(joint, _)| *joint).ok()?;
    Some(&pieces[place].1)
}

/// Number of trees that are still being built.
pub(super) fn waiting(trees: &Trees) -> usize {
    trees.values.values().filter(|tree| matches!(tree, Tree::Building(_))).count()
}

/// Collects finished trees, drops those of removed meshes, and starts building those of new ones.
/// Returns whether all assets were loaded.
pub(super) fn build(
    trees: &mut Trees,
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
    let mut left = TRIANGLES_PER_FRAME;
    trees.fill(used, |key| start(key, assets, &mut left))
}

/// Builds a mesh's tree, at once or in the background; `None` while its assets are not loaded.
/// `left`: triangles that may still be built at once in this frame.
fn start(key: &TreeKey, assets: &SurfaceAssets, left: &mut usize) -> Option<Tree> {
    let mesh = assets.meshes.get(key.mesh)?;
    let cutout = Cutout::new(key.mask.as_ref(), mesh, assets.textures())?.map(Cutout::into_owned);
    let Some(triangles) = triangles(mesh) else {
        warn_once!(
            "a mesh is kept for the GPU alone or is no triangle list: it occludes no indirect light (RenderAssetUsages::MAIN_WORLD keeps it readable)"
        );
        return Some(Tree::Unreadable);
    };
    let work = triangles.corners.len() * if cutout.is_some() { MASKED_TRIANGLE } else { 1 };
    let influences = if key.is_skinned { Influences::new(mesh) } else { None };
    if key.is_skinned && influences.is_none() {
        warn_once!(
            "a skinned mesh has no joints and weights as 16-bit integers and 32-bit floats: it occludes no indirect light"
        );
        return Some(Tree::Unreadable);
    }
    let build = move || {
        let pieces = match influences {
            Some(influences) => split(&influences, triangles),
            None => vec![(0, triangles)],
        };
        let build = |(joint, piece)| (joint, tree(piece, cutout.as_ref()));
        pieces.into_iter().map(build).collect::<JointBvhs>()
    };
    Some(if work <= TRIANGLES_AT_ONCE.min(*left) {
        *left -= work;
        Tree::Ready(Arc::new(build()))
    } else {
        Tree::Building(AsyncComputeTaskPool::get().spawn(async move { build() }))
    })
}

fn tree(Triangles { corners, positions }: Triangles, cutout: Option<&Cutout>) -> MeshBvh {
    let micromap = |corners: [usize; 3]| match cutout {
        Some(cutout) if cutout.may_pierce(corners) => {
            micromap(|weights| cutout.is_opaque(corners, weights))
        }
        _ => SOLID,
    };
    MeshBvh::new(positions.into_iter().zip(corners.into_iter().map(micromap)))
}
