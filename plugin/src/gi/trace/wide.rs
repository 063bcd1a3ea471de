//! A mesh's tree as the GPU reads it: nodes of four children with quantised boxes, in 64 bytes.
//!
//! In a binary tree, each box costs a ray a load that depends on the one before. Here a load tests
//! four boxes (Dammertz et al. 2008, "Shallow Bounding Volume Hierarchies"), quantised to bytes on
//! the node's own grid (Ylitie et al. 2017, "Efficient Incoherent Ray Traversal on GPUs Through
//! Compressed Wide BVHs"). Quantised boxes only grow, so that no hit is lost. Inner children lie
//! side by side, and so do the triangles of all leaves of a node: a base and a few bits tell what a
//! ray has still to visit.

use std::ops::Range;

use bevy::math::Vec3A;
use bytemuck::{Pod, Zeroable};
use obvhs::BvhBuildParams;

use super::bvh::{FlatBvh, half_area};

/// Children of a node.
const WIDTH: usize = 4;
/// Most triangles of a leaf: a node's leaves name theirs with 8 bits.
const MAX_IN_LEAF: usize = 2;
const _: () = assert!(WIDTH * MAX_IN_LEAF <= 8);
/// Trees of meshes of up to so many triangles are built at once, in about a millisecond; larger
/// ones in the background.
pub(super) const TRIANGLES_AT_ONCE: usize = 4096;
/// Most triangles of a tree that is built with the greatest effort, in about 2 s.
const SLOWLY_BUILT: usize = 1 << 18;
/// Most levels of a tree. `trace.wgsl` has a stack for so many (`STACK`).
pub(crate) const MAX_LEVELS: u32 = 16;
/// Growth of the boxes of a node before they are quantised, as a share of its extent: more than a ray's
/// rounding errors against them.
const MARGIN: f32 = 1.0 / (1 << 20) as f32;

/// `trace/trace.wgsl`'s `WideNode`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct WideNode {
    /// Where the grid of the children's boxes begins.
    origin: [f32; 3],
    /// From the lowest byte: exponents of the grid's steps along x, y, z, as those of a float.
    grid: u32,
    /// A byte for each child, along x, y, z.
    lower: [u32; 3],
    /// The first inner child; the others follow.
    first_child: u32,
    upper: [u32; 3],
    /// The first triangle of all leaves.
    first_triangle: u32,
    /// 16 bits for each child: from the lowest, which of the node's triangles it holds (8), and which of the
    /// inner children it is (4).
    held: [u32; 2],
    padding: [u32; 2],
}

impl WideNode {
    /// The node of a tree that is put behind `nodes` nodes and `triangles` triangles.
    pub(super) fn moved(self, nodes: usize, triangles: usize) -> Self {
        Self {
            first_child: self.first_child + nodes as u32,
            first_triangle: self.first_triangle + triangles as u32,
            ..self
        }
    }

    fn new(boxes: &[(Vec3A, Vec3A)]) -> Self {
        let mut node = Self::default();
        for axis in 0..3 {
            let low = boxes.iter().map(|(min, _)| min[axis]).fold(f32::INFINITY, f32::min);
            let high = boxes.iter().map(|(_, max)| max[axis]).fold(f32::NEG_INFINITY, f32::max);
            let margin = (high - low) * MARGIN;
            let (origin, exponent) = grid(low - margin, high + margin);
            node.origin[axis] = origin;
            node.grid |= exponent << (8 * axis);
            let steps = |coordinate: f32| (coordinate - origin) / f32::from_bits(exponent << 23);
            let byte = |steps: f32| steps.clamp(0.0, 255.0) as u32;
            for (child, (min, max)) in boxes.iter().enumerate() {
                node.lower[axis] |= byte(steps(min[axis] - margin).floor()) << (8 * child);
                node.upper[axis] |= byte(steps(max[axis] + margin).ceil()) << (8 * child);
            }
        }
        node
    }
}

/// Steps of a power of two that cover a range with a byte: where they begin, a multiple of the step,
/// so that each step's place is a float; and the step's exponent, as a float has it.
fn grid(low: f32, high: f32) -> (f32, u32) {
    let largest = low.abs().max(high.abs());
    // The step is no finer than the coordinates are.
    let finest = (largest.to_bits() >> 23).saturating_sub(23);
    let needed = ((high - low) / 255.0).to_bits() >> 23;
    let mut exponent = finest.max(needed).max(1);
    loop {
        let step = f32::from_bits(exponent << 23);
        let origin = (low / step).floor() * step;
        if origin + 255.0 * step >= high {
            return (origin, exponent);
        }
        exponent += 1;
    }
}

/// Effort for a tree of so many triangles. By `BENCH=rays` the greatest spares rays to VPLs 7 to 18 % of
/// their loads in levels of one mesh. It takes four times as long: half a second for 70,000 triangles.
fn effort(triangles: usize) -> BvhBuildParams {
    // Small trees are built within a frame, and nothing occludes until a large one is built.
    if (TRIANGLES_AT_ONCE + 1..=SLOWLY_BUILT).contains(&triangles) {
        BvhBuildParams::very_slow_build()
    } else {
        BvhBuildParams::medium_build()
    }
}

/// Nodes and the order of the triangles in their leaves.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct WideBvh {
    /// The root first; empty without triangles.
    pub nodes: Vec<WideNode>,
    /// Order of the leaves → index as given.
    pub order: Vec<u32>,
}

/// A part of the binary tree that becomes a child.
#[derive(Clone, Debug)]
enum Part {
    /// A node with all below it.
    Node(usize),
    /// Primitives by their place in the binary tree's order.
    Leaf(Range<usize>),
}

impl WideBvh {
    /// A tree over boxes of (lower, upper) corners, all finite.
    pub(super) fn new(boxes: &[(Vec3A, Vec3A)]) -> Self {
        let binary = FlatBvh::new(boxes, effort(boxes.len()));
        let mut wide = Self::default();
        if boxes.is_empty() {
            return wide;
        }
        let source = Source { boxes, binary: &binary };
        wide.nodes.push(WideNode::default());
        let mut work = vec![(0, Part::Node(0), MAX_LEVELS)];
        while let Some((index, part, levels)) = work.pop() {
            let parts = source.children(part, levels);
            let is_leaf =
                |part: &Part| matches!(part, Part::Leaf(range) if range.len() <= MAX_IN_LEAF);
            let (leaves, inner): (Vec<_>, Vec<_>) = parts.into_iter().partition(is_leaf);
            let children = || inner.iter().chain(&leaves);
            let boxes: Vec<_> = children().map(|part| source.bounds(part)).collect();
            let mut node = WideNode::new(&boxes);
            node.first_child = wide.nodes.len() as u32;
            node.first_triangle = wide.order.len() as u32;
            let mut hold = |child: usize, bits: u32| {
                node.held[child / 2] |= bits << (16 * (child % 2));
            };
            (0..inner.len()).for_each(|child| hold(child, 1 << (8 + child)));
            for (child, leaf) in (inner.len()..).zip(&leaves) {
                let range = source.range(leaf);
                let first = wide.order.len() - node.first_triangle as usize;
                hold(child, ((1 << range.len()) - 1) << first);
                wide.order.extend(&binary.order[range]);
            }
            wide.nodes[index] = node;
            let first = wide.nodes.len();
            wide.nodes.resize(first + inner.len(), WideNode::default());
            work.extend((first..).zip(inner).map(|(index, part)| (index, part, levels - 1)));
        }
        wide
    }
}

/// What the wide tree is made of.
struct Source<'a> {
    boxes: &'a [(Vec3A, Vec3A)],
    binary: &'a FlatBvh,
}

impl Source<'_> {
    fn range(&self, part: &Part) -> Range<usize> {
        match part {
            Part::Leaf(range) => range.clone(),
            Part::Node(index) => {
                // The first leaf below it, and the last.
                let nodes = &self.binary.nodes[*index..self.binary.nodes[*index].skip as usize];
                let first = nodes.iter().find(|node| node.leaf != 0).map(|node| node.primitives());
                let last = nodes.last().map(|node| node.primitives());
                first.map_or(0, |range| range.start)..last.map_or(0, |range| range.end)
            }
        }
    }

    fn bounds(&self, part: &Part) -> (Vec3A, Vec3A) {
        match part {
            Part::Node(index) => {
                let node = &self.binary.nodes[*index];
                (node.min.into(), node.max.into())
            }
            Part::Leaf(range) => {
                let boxes = self.binary.order[range.clone()].iter();
                let boxes = boxes.map(|index| self.boxes[*index as usize]);
                boxes.fold((Vec3A::INFINITY, Vec3A::NEG_INFINITY), |all, one| {
                    (all.0.min(one.0), all.1.max(one.1))
                })
            }
        }
    }

    /// Two parts, or more, of one that is no leaf of the wide tree; else nothing.
    fn split(&self, part: &Part) -> Vec<Part> {
        match part {
            Part::Node(index) if self.binary.nodes[*index].leaf == 0 => {
                let end = self.binary.nodes[*index].skip as usize;
                let next = |child: &usize| Some(self.binary.nodes.get(*child)?.skip as usize);
                let children = std::iter::successors(Some(*index + 1), next);
                children.take_while(|child| *child < end).map(Part::Node).collect()
            }
            part => {
                let range = self.range(part);
                if range.len() <= MAX_IN_LEAF {
                    Vec::new()
                } else {
                    halves(range).map(Part::Leaf).to_vec()
                }
            }
        }
    }

    /// The children of the node of a part: the largest parts are split first.
    fn children(&self, part: Part, levels: u32) -> Vec<Part> {
        let mut parts = vec![part];
        while parts.len() < WIDTH {
            let area = |part: &Part| {
                let (min, max) = self.bounds(part);
                half_area(max - min)
            };
            let splits = parts.iter().enumerate().map(|(index, part)| (index, self.split(part)));
            let largest = splits
                .filter(|(_, split)| !split.is_empty() && split.len() + parts.len() <= WIDTH + 1)
                .max_by(|(a, _), (b, _)| area(&parts[*a]).total_cmp(&area(&parts[*b])));
            let Some((index, split)) = largest else { break };
            parts.splice(index..=index, split);
        }
        // A tree that is deeper than the stack is balanced below here.
        let most = MAX_IN_LEAF << (2 * (levels - 1)).min(40);
        if parts.iter().any(|part| self.range(part).len() > most) {
            let ends = parts.iter().map(|part| self.range(part)).reduce(|a, b| a.start..b.end);
            parts = halves(ends.unwrap_or_default())
                .into_iter()
                .flat_map(halves)
                .map(Part::Leaf)
                .collect();
        }
        // A small node is a leaf.
        let as_leaf = |part| {
            let range = self.range(&part);
            if range.len() <= MAX_IN_LEAF { Part::Leaf(range) } else { part }
        };
        parts.into_iter().map(as_leaf).collect()
    }
}

fn halves(range: Range<usize>) -> [Range<usize>; 2] {
    let middle = range.start.midpoint(range.end);
    [range.start..middle, middle..range.end]
}

#[cfg(test)]
#[path = "wide_tests.rs"]
mod tests;
#[cfg(test)]
pub(super) use tests::{below, soup, walk};
