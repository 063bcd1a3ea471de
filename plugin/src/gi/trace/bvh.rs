//! A binary bounding volume hierarchy: over instances for the GPU, over a mesh's triangles to make
//! the wide one. Plain Rust, no renderer.
//!
//! obvhs builds a binary tree (PLOC with reinsertion, Meister and Bittner 2018); we lay it out in
//! depth-first order with skip links, so that a ray needs no stack: it goes to the next node where
//! it meets a box, and to the node's skip link where it does not (Smits 1998, "Efficiency Issues
//! for Ray Tracing"). Occlusion between two points does not depend on the order of visits, so a
//! fixed one loses nothing.

use std::time::Duration;

use bevy::math::Vec3A;
use bytemuck::{Pod, Zeroable};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;

/// Low bits of a leaf that store its count of primitives.
const COUNT_BITS: u32 = 3;
/// Most primitives of a leaf.
const MAX_IN_LEAF: u32 = (1 << COUNT_BITS) - 1;
/// `trace/trace.wgsl`'s `Node`.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Node {
    /// Lower corner of the box.
    pub min: [f32; 3],
    /// Index of the node to go on with when the box is missed, or its leaf is done.
    pub skip: u32,
    /// Upper corner.
    pub max: [f32; 3],
    /// 0 for an inner node, whose first child is the next node; else index of the first primitive ×
    /// 8 + their number (1 to 7).
    pub leaf: u32,
}

impl Node {
    /// A node that no ray intersects, since buffers must not be empty.
    pub(crate) const NOTHING: Self = Self { min: [1.0; 3], skip: 1, max: [-1.0; 3], leaf: 0 };

    /// The node of a tree that is put behind `nodes` nodes and `primitives` primitives.
    pub(super) fn moved(self, nodes: usize, primitives: usize) -> Self {
        let leaf = if self.leaf == 0 { 0 } else { self.leaf + ((primitives as u32) << COUNT_BITS) };
        Self { skip: self.skip + nodes as u32, leaf, ..self }
    }

    /// Half the surface area of the box.
    pub(super) fn half_area(&self) -> f32 {
        half_area(Vec3A::from(self.max) - Vec3A::from(self.min))
    }

    /// The primitives of a leaf.
    pub(crate) fn primitives(&self) -> std::ops::Range<usize> {
        let first = (self.leaf >> COUNT_BITS) as usize;
        first..first + (self.leaf & MAX_IN_LEAF) as usize
    }
}

/// Nodes in depth-first order, and the primitives in the order in which leaves name them.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct FlatBvh {
    /// The root first; empty without primitives.
    pub nodes: Vec<Node>,
    /// Leaf order → index as given.
    pub order: Vec<u32>,
}

impl FlatBvh {
    /// A tree over boxes of (lower, upper) corners, all finite. `effort`: more for one that is
    /// traversed in many frames.
    pub(crate) fn new(boxes: &[(Vec3A, Vec3A)], effort: BvhBuildParams) -> Self {
        let boxes: Vec<Aabb> = boxes
            .iter()
            .map(|(min, max)| Aabb { min: min.to_array().into(), max: max.to_array().into() })
            .collect();
        match boxes.len() {
            0 => Self::default(),
            // The builder needs at least two boxes.
            1 => {
                Self { nodes: vec![Node { leaf: 1, skip: 1, ..boxed(&boxes[0]) }], order: vec![0] }
            }
            _ => {
                let params = BvhBuildParams { max_prims_per_leaf: 4, ..effort };
                flatten(&obvhs::bvh2::builder::build_bvh2(&boxes, params, &mut Duration::default()))
            }
        }
    }
}

pub(super) fn half_area(side: Vec3A) -> f32 {
    side.x * side.y + side.y * side.z + side.z * side.x
}

fn boxed(aabb: &Aabb) -> Node {
    Node { min: aabb.min.to_array(), skip: 0, max: aabb.max.to_array(), leaf: 0 }
}

fn flatten(tree: &Bvh2) -> FlatBvh {
    let mut flat = FlatBvh::default();
    // Nodes to enter, and inner nodes (as `Err` of their index) to close after all nodes below
    // them.
    let mut work: Vec<Result<usize, usize>> = vec![Ok(0)];
    while let Some(next) = work.pop() {
        match next {
            Err(index) => flat.nodes[index].skip = flat.nodes.len() as u32,
            Ok(index) => {
                let node = &tree.nodes[index];
                let first = node.first_index as usize;
                if node.prim_count == 0 {
                    work.extend([Err(flat.nodes.len()), Ok(first + 1), Ok(first)]);
                    flat.nodes.push(boxed(&node.aabb));
                    continue;
                }
                let primitives = &tree.primitive_indices[first..first + node.prim_count as usize];
                for some in primitives.chunks(MAX_IN_LEAF as usize) {
                    let leaf = (flat.order.len() as u32) << COUNT_BITS | some.len() as u32;
                    flat.nodes.push(Node {
                        leaf,
                        skip: flat.nodes.len() as u32 + 1,
                        ..boxed(&node.aabb)
                    });
                    flat.order.extend(some);
                }
            }
        }
    }
    flat
}

#[cfg(test)]
#[path = "bvh_tests.rs"]
mod tests;
