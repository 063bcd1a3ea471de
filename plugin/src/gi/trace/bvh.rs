//! A bounding volume hierarchy laid out for a GPU without ray-tracing hardware: plain Rust, no
//! renderer.
//!
//! obvhs builds a binary tree (PLOC with reinsertion, Meister and Bittner 2018); we lay it out in
//! depth-first order with skip links, so that a ray needs no stack: it goes to the next node where
//! it meets a box, and to the node's skip link where it does not (Smits 1998, "Efficiency Issues
//! for Ray Tracing"). Occlusion between two points does not depend on the order of visits, so a
//! fixed one loses nothing, and a stack in private memory would keep small GPUs from having enough
//! rays in flight.

use std::time::Duration;

use bevy::math::{Affine3A, Vec3, Vec3A};
use bytemuck::{Pod, Zeroable};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;

use crate::gi::surfaces::{MAX_COORDINATE, is_in_range};

/// Low bits of a leaf that store its count of primitives.
const COUNT_BITS: u32 = 3;
/// Most primitives of a leaf.
const MAX_IN_LEAF: u32 = (1 << COUNT_BITS) - 1;
/// Triangles whose area, relative to their box's greatest side squared, is smaller than this are
/// left out: they occlude nothing, and their determinant vanishes.
const MIN_AREA: f32 = 1e-12;

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

/// `trace/trace.wgsl`'s `Triangle`: a corner and two edges, and an opacity micromap (see
/// `micromap`).
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct TriangleWords {
    /// The first corner.
    pub corner: [f32; 3],
    padding: u32,
    /// From there to the second.
    pub edge_1: [f32; 3],
    /// The micromap's lower half.
    map_low: u32,
    /// From the first corner to the third.
    pub edge_2: [f32; 3],
    /// Its upper half.
    map_high: u32,
}

impl TriangleWords {
    fn new([a, b, c]: [Vec3; 3], map: u64) -> Self {
        let [corner, edge_1, edge_2] = [a, b - a, c - a].map(|v| v.to_array());
        Self {
            corner,
            padding: 0,
            edge_1,
            map_low: map as u32,
            edge_2,
            map_high: (map >> 32) as u32,
        }
    }

    /// Its micromap.
    pub(crate) fn map(&self) -> u64 {
        u64::from(self.map_high) << 32 | u64::from(self.map_low)
    }
}

/// How long a tree may take to build.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Effort {
    /// It is traversed in many frames.
    ForLong,
    /// It is built anew soon.
    ForNow,
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
    /// A tree over boxes of (lower, upper) corners, all finite.
    pub(crate) fn new(boxes: &[(Vec3A, Vec3A)], effort: Effort) -> Self {
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
                let params = match effort {
                    Effort::ForLong => BvhBuildParams::medium_build(),
                    Effort::ForNow => BvhBuildParams::very_fast_build(),
                };
                let params = BvhBuildParams { max_prims_per_leaf: 4, ..params };
                flatten(&obvhs::bvh2::builder::build_bvh2(&boxes, params, &mut Duration::default()))
            }
        }
    }
}

/// Fits a tree's boxes to primitives that moved. `bounds`: their boxes in the order in which leaves
/// name them. Returns the sum of the boxes' half areas, by which trees can be compared: it grows as
/// primitives leave their neighbours.
pub(super) fn refit(nodes: &mut [Node], bounds: &[(Vec3A, Vec3A)]) -> f32 {
    let mut areas = 0.0;
    // Children lie behind their parents.
    for index in (0..nodes.len()).rev() {
        let (min, max) = fitted(nodes, index, bounds);
        areas += half_area(max - min);
        (nodes[index].min, nodes[index].max) = (min.to_array(), max.to_array());
    }
    areas
}

/// The box around a node's primitives or children.
pub(super) fn fitted(nodes: &[Node], index: usize, bounds: &[(Vec3A, Vec3A)]) -> (Vec3A, Vec3A) {
    let node = nodes[index];
    let (mut min, mut max) = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
    if node.leaf != 0 {
        for (low, high) in &bounds[node.primitives()] {
            (min, max) = (min.min(*low), max.max(*high));
        }
    } else {
        let mut child = index + 1;
        while child < node.skip as usize {
            (min, max) = (min.min(nodes[child].min.into()), max.max(nodes[child].max.into()));
            child = nodes[child].skip as usize;
        }
    }
    (min, max)
}

fn half_area(side: Vec3A) -> f32 {
    side.x * side.y + side.y * side.z + side.z * side.x
}

fn boxed(aabb: &Aabb) -> Node {
    Node {
        min: [aabb.min.x, aabb.min.y, aabb.min.z],
        skip: 0,
        max: [aabb.max.x, aabb.max.y, aabb.max.z],
        leaf: 0,
    }
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

/// One mesh's triangles in a tree, in the mesh's own space.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct MeshBvh {
    /// The tree's nodes.
    pub nodes: Vec<Node>,
    /// Triangles in the order in which leaves name them.
    pub triangles: Vec<TriangleWords>,
}

impl MeshBvh {
    /// A tree of triangles, each with its micromap. Triangles that are all hole, degenerate, not
    /// finite or too far away are left out.
    pub(crate) fn new(triangles: impl IntoIterator<Item = ([Vec3; 3], u64)>) -> Self {
        let triangles: Vec<_> = triangles
            .into_iter()
            .filter(|(triangle, map)| *map != 0 && is_usable(triangle))
            .collect();
        let boxes: Vec<_> = triangles
            .iter()
            .map(|([a, b, c], _)| (a.min(*b).min(*c).into(), a.max(*b).max(*c).into()))
            .collect();
        let FlatBvh { nodes, order } = FlatBvh::new(&boxes, Effort::ForLong);
        let words = |index: &u32| {
            let (triangle, map) = triangles[*index as usize];
            TriangleWords::new(triangle, map)
        };
        Self { triangles: order.iter().map(words).collect(), nodes }
    }

    /// The box around it in a space that `affine` maps its own to; `None` where that is not finite
    /// or there is nothing.
    pub(crate) fn bounds(&self, affine: &Affine3A) -> Option<(Vec3A, Vec3A)> {
        let root = self.nodes.first()?;
        let (min, max) = (Vec3A::from(root.min), Vec3A::from(root.max));
        let center = affine.transform_point3a((min + max) * 0.5);
        let half = affine.matrix3.abs() * ((max - min) * 0.5);
        let (min, max) = (center - half, center + half);
        (min.is_finite()
            && max.is_finite()
            && max.abs().max(min.abs()).max_element() < MAX_COORDINATE)
            .then_some((min, max))
    }
}

fn is_usable(triangle: &[Vec3; 3]) -> bool {
    let [a, b, c] = *triangle;
    let side = (b - a).abs().max((c - a).abs()).max_element();
    // In units of its own size, so that neither tiny nor huge triangles leave the range of a float.
    is_in_range(triangle)
        && side > 0.0
        && ((b - a) / side).cross((c - a) / side).length() > MIN_AREA
}

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

/// An instance of a mesh's tree, and its box; `None` where it is scaled to nothing or out of the
/// range of floats, and occludes nothing.
pub(super) fn instance(
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

#[cfg(test)]
#[path = "bvh_tests.rs"]
mod tests;
