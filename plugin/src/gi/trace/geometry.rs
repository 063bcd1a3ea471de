//! The trees of all meshes in two arrays: nodes and triangles.
//!
//! A tree keeps its place for as long as it is used, so that it is uploaded once. The place of one
//! that goes is used for others.

use std::ops::Range;
use std::sync::Arc;

use bevy::platform::collections::HashMap;
use range_alloc::RangeAllocator;

use super::mesh::{MeshBvh, TriangleWords};
use super::mirror::{Mirrored, warn_of_full_buffer};
use super::trees::{JointBvhs, Tree, TreeKey, Trees};
use super::wide::WideNode;

/// Where a piece of a mesh lies.
#[derive(Debug)]
struct PlacedPiece {
    joint: u16,
    nodes: Range<usize>,
    triangles: Range<usize>,
}

/// A tree in the arrays.
#[derive(Debug)]
struct PlacedTree {
    /// To tell whether it was built anew.
    tree: Arc<JointBvhs>,
    /// By joint; without those for which there was no room.
    pieces: Vec<PlacedPiece>,
}

/// Which ranges of an array are in use.
#[derive(Debug)]
struct Ranges(RangeAllocator<usize>);

impl Default for Ranges {
    fn default() -> Self {
        Self(RangeAllocator::new(0..usize::MAX))
    }
}

impl Ranges {
    /// A range of `count` items that nothing uses; `None` where that would reach beyond `most` items.
    fn take(&mut self, count: usize, most: usize) -> Option<Range<usize>> {
        let range = self.0.allocate_range(count).ok()?;
        if range.end <= most {
            return Some(range);
        }
        self.0.free_range(range);
        None
    }
}

/// Trees of all meshes.
#[derive(Debug, Default)]
pub(super) struct Geometry {
    pub nodes: Mirrored<WideNode>,
    pub triangles: Mirrored<TriangleWords>,
    node_ranges: Ranges,
    triangle_ranges: Ranges,
    placed: HashMap<TreeKey, PlacedTree>,
    /// Number of triangles in all trees.
    pub triangle_count: usize,
}

impl Geometry {
    /// The root of what a joint moves.
    pub(super) fn root_of(&self, key: &TreeKey, joint: u16) -> Option<u32> {
        let pieces = &self.placed.get(key)?.pieces;
        let place = pieces.binary_search_by_key(&joint, |piece| piece.joint).ok()?;
        Some(pieces[place].nodes.start as u32)
    }

    /// Takes out trees that are gone or were built anew, and puts in those that are ready; buffers
    /// have at most `most` bytes. Returns the keys of all of them.
    pub(super) fn update(&mut self, trees: &Trees, most: usize) -> Vec<TreeKey> {
        let is_kept = |key: &TreeKey, placed: &PlacedTree| match trees.values.get(key) {
            Some(Tree::Ready(tree)) => Arc::ptr_eq(tree, &placed.tree),
            _ => false,
        };
        let gone = self.placed.iter().filter(|(key, placed)| !is_kept(key, placed));
        let mut changed: Vec<TreeKey> = gone.map(|(key, _)| *key).collect();
        for key in &changed {
            self.take_out(key);
        }
        let mut new: Vec<(TreeKey, Arc<JointBvhs>)> = trees
            .values
            .iter()
            .filter_map(|(key, tree)| match tree {
                Tree::Ready(tree) if !self.placed.contains_key(key) => {
                    Some((*key, Arc::clone(tree)))
                }
                _ => None,
            })
            .collect();
        // Hash order is arbitrary; sorting keeps the arrays the same in every run.
        new.sort_by_key(|(key, _)| *key);
        for (key, tree) in new {
            changed.push(key);
            let pieces = tree.iter().filter_map(|(joint, piece)| self.place(*joint, piece, most));
            let pieces = pieces.collect();
            self.placed.insert(key, PlacedTree { tree, pieces });
        }
        changed
    }

    fn take_out(&mut self, key: &TreeKey) {
        for piece in self.placed.remove(key).map(|tree| tree.pieces).unwrap_or_default() {
            self.triangle_count -= piece.triangles.len();
            self.node_ranges.0.free_range(piece.nodes);
            self.triangle_ranges.0.free_range(piece.triangles);
        }
    }

    /// Writes a piece; `None` if it is empty, or there is no room for it.
    fn place(&mut self, joint: u16, piece: &MeshBvh, most: usize) -> Option<PlacedPiece> {
        if piece.nodes.is_empty() {
            return None;
        }
        let room = |bytes: usize| most / bytes;
        let nodes = self.node_ranges.take(piece.nodes.len(), room(size_of::<WideNode>()));
        let triangles =
            self.triangle_ranges.take(piece.triangles.len(), room(size_of::<TriangleWords>()));
        let (Some(nodes), Some(triangles)) = (nodes.clone(), triangles.clone()) else {
            warn_of_full_buffer();
            nodes.into_iter().for_each(|range| self.node_ranges.0.free_range(range));
            triangles.into_iter().for_each(|range| self.triangle_ranges.0.free_range(range));
            return None;
        };
        let moved: Vec<WideNode> =
            piece.nodes.iter().map(|node| node.moved(nodes.start, triangles.start)).collect();
        self.nodes.write(nodes.start, &moved);
        self.triangles.write(triangles.start, &piece.triangles);
        self.triangle_count += triangles.len();
        Some(PlacedPiece { joint, nodes, triangles })
    }

    /// Ends a version of both arrays.
    pub(super) fn end_version(&mut self) {
        self.nodes.end_version();
        self.triangles.end_version();
    }

    /// Takes all out.
    pub(super) fn clear(&mut self) {
        self.nodes.take();
        self.triangles.take();
        (self.node_ranges, self.triangle_ranges) = Default::default();
        self.placed.clear();
        self.triangle_count = 0;
    }
}

#[cfg(test)]
mod tests {
    use bevy::asset::AssetId;
    use bevy::asset::uuid::Uuid;
    use bevy::math::Vec3;

    use super::super::mesh::SOLID;
    use super::super::wide::below;
    use super::*;

    fn key(number: u128) -> TreeKey {
        TreeKey {
            mesh: AssetId::Uuid { uuid: Uuid::from_u128(number) },
            mask: None,
            is_skinned: false,
        }
    }

    /// A tree of `count` triangles.
    fn tree(count: usize) -> Tree {
        let triangle = |index: usize| {
            let at = Vec3::X * index as f32;
            ([at, at + Vec3::X, at + Vec3::Y], SOLID)
        };
        Tree::Ready(Arc::new(vec![(0, MeshBvh::new((0..count).map(triangle)))]))
    }

    fn update(geometry: &mut Geometry, trees: &Trees, most: usize) -> usize {
        geometry.end_version();
        geometry.update(trees, most).len()
    }

    #[test]
    fn a_tree_keeps_its_place_while_others_come_and_go() {
        let (mut geometry, mut trees) = (Geometry::default(), Trees::default());
        for (number, count) in [(1, 5), (2, 9), (3, 5)] {
            trees.values.insert(key(number), tree(count));
        }
        assert_eq!(update(&mut geometry, &trees, usize::MAX), 3);
        assert_eq!(geometry.triangle_count, 19);
        let place = geometry.root_of(&key(3), 0).expect("placed");
        assert_eq!(update(&mut geometry, &trees, usize::MAX), 0, "nothing changed");

        trees.values.remove(&key(2));
        trees.values.insert(key(4), tree(7));
        assert_eq!(update(&mut geometry, &trees, usize::MAX), 2);
        assert_eq!(geometry.root_of(&key(3), 0), Some(place));
        assert_eq!(geometry.root_of(&key(2), 0), None);
        assert_eq!(geometry.triangles.len(), 19, "in the place of what went");
        let uploaded = geometry.triangles.missing(1, 19).expect("a new version");
        let bytes: usize = uploaded.pieces.iter().map(|(_, bytes)| bytes.len()).sum();
        assert_eq!(bytes, 7 * size_of::<TriangleWords>(), "only the new one");
        // Each node's triangles are the tree's own.
        for number in [1, 3, 4] {
            let root = geometry.root_of(&key(number), 0).expect("placed");
            let triangles = below(&geometry.nodes, root as usize);
            let corners =
                triangles.iter().map(|index| geometry.triangles[*index].corner[0] as usize);
            let mut corners: Vec<usize> = corners.collect();
            corners.sort_unstable();
            let count = if number == 4 { 7 } else { 5 };
            assert_eq!(corners, (0..count).collect::<Vec<_>>(), "tree {number}");
        }
    }

    #[test]
    fn a_tree_that_was_built_anew_takes_the_place_of_the_old_one() {
        let (mut geometry, mut trees) = (Geometry::default(), Trees::default());
        trees.values.insert(key(1), tree(5));
        update(&mut geometry, &trees, usize::MAX);
        trees.values.insert(key(1), tree(3));
        assert_eq!(update(&mut geometry, &trees, usize::MAX), 2, "taken out, and put in");
        assert_eq!(geometry.triangle_count, 3);
        geometry.clear();
        assert_eq!((geometry.triangle_count, geometry.triangles.len()), (0, 0));
        assert_eq!(update(&mut geometry, &trees, usize::MAX), 1);
    }

    #[test]
    fn what_exceeds_the_largest_buffer_is_left_out() {
        let (mut geometry, mut trees) = (Geometry::default(), Trees::default());
        for number in 1..=3 {
            trees.values.insert(key(number), tree(50));
        }
        let most = 110 * size_of::<TriangleWords>();
        update(&mut geometry, &trees, most);
        let placed = (1..=3).filter(|number| geometry.root_of(&key(*number), 0).is_some());
        assert_eq!((placed.count(), geometry.triangle_count), (2, 100));
    }
}
