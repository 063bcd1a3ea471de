//! The octree over camera positions: each corner of its leaves stores six frontiers.
//!
//! Wang et al. 2016, "Real-Time Rendering on a Power Budget", sections 3.5.3 (how it is built) and
//! 3.6 (how it is read).

use glam::Vec3;
use serde::{Deserialize, Serialize};

use super::{Frontier, ViewDirection};

/// A lattice position with its frontiers.
///
/// Serialised as nine integers: `at`, then `frontiers`. A map has hundreds of corners; field names
/// would make up most of its file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(from = "Numbers", into = "Numbers")]
pub struct Corner {
    /// Lattice coordinates: the root spans 0 to 2^`levels` on each axis.
    pub at: [u16; 3],
    /// Index into [`Octree::frontiers`] for each [`ViewDirection`], in index order.
    pub frontiers: [u32; 6],
}

type Numbers = (u16, u16, u16, u32, u32, u32, u32, u32, u32);

impl From<Numbers> for Corner {
    fn from((x, y, z, a, b, c, d, e, f): Numbers) -> Self {
        Self { at: [x, y, z], frontiers: [a, b, c, d, e, f] }
    }
}

impl From<Corner> for Numbers {
    fn from(Corner { at: [x, y, z], frontiers: [a, b, c, d, e, f] }: Corner) -> Self {
        (x, y, z, a, b, c, d, e, f)
    }
}

/// Octree over camera positions, subdivided where frontiers differ (Wang et al. 2016, section
/// 3.5.3).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Octree {
    /// Depth of the lattice, 0 to 15: a corner's coordinates range from 0 to 2^`levels`.
    pub levels: u8,
    /// `nodes[0]` is the root. 0 marks a leaf; any other value is the index of the first of eight
    /// consecutive children, in the order x + 2y + 4z (x = 1 is the upper half along X, and so on).
    pub nodes: Vec<u32>,
    /// Every corner of every leaf once, sorted by `at` (lexicographically, as the array compares).
    pub corners: Vec<Corner>,
    /// The frontiers, shared by corners through their indices.
    pub frontiers: Vec<Frontier>,
}

/// A leaf of an [`Octree`]: a cube of the lattice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Leaf {
    /// Lattice coordinates of the minimum corner.
    pub min: [u16; 3],
    /// Length of an edge, in lattice steps: a power of two, at least 1.
    pub size: u16,
}

impl Leaf {
    /// Lattice coordinates of one of the eight corners, numbered x + 2y + 4z like children. Bits of
    /// `number` above the third are ignored.
    pub fn corner(self, number: usize) -> [u16; 3] {
        std::array::from_fn(|axis| {
            if number >> axis & 1 == 1 {
                self.min[axis].saturating_add(self.size)
            } else {
                self.min[axis]
            }
        })
    }
}

impl Octree {
    /// Maximum number of levels, so that 2^levels fits a `u16` coordinate.
    pub const MAX_LEVELS: u8 = 15;

    /// The largest lattice coordinate: 2^`levels`, with `levels` limited to
    /// [`MAX_LEVELS`](Self::MAX_LEVELS).
    pub fn lattice(&self) -> u16 {
        1 << self.levels.min(Self::MAX_LEVELS)
    }

    /// The leaf that contains `position`, with the root spanning 0 to 1 on each axis. Positions
    /// outside are clamped to the root; NaN counts as 0.
    ///
    /// A position on the border of two leaves belongs to the upper one. Safe for invalid octrees:
    /// the descent stops at the first invalid node, and visits at most 15 nodes.
    pub fn leaf_at(&self, position: Vec3) -> Leaf {
        let size = self.lattice();
        // Float to integer conversion saturates and maps NaN to 0. Multiplication by a power of two
        // is exact, so borders are exact too.
        let coordinates =
            position.to_array().map(|unit| ((unit * f32::from(size)) as u16).min(size - 1));
        let mut leaf = Leaf { min: [0; 3], size };
        let mut node = 0;
        while leaf.size > 1 {
            let Some(&first) = self.nodes.get(node).filter(|first| **first != 0) else { break };
            leaf.size /= 2;
            let mut octant = 0;
            for (axis, coordinate) in coordinates.iter().enumerate() {
                if coordinate & leaf.size != 0 {
                    octant |= 1 << axis;
                    leaf.min[axis] += leaf.size;
                }
            }
            node = (first as usize).saturating_add(octant);
        }
        leaf
    }

    /// Index in [`corners`](Self::corners) of the corner with lattice coordinates `at`, by binary
    /// search; `None` where there is none.
    pub fn corner_index(&self, at: [u16; 3]) -> Option<usize> {
        self.corners.binary_search_by(|corner| corner.at.cmp(&at)).ok()
    }

    /// The frontier of one view of a corner: `None` where it is empty.
    pub fn frontier(&self, corner: &Corner, direction: ViewDirection) -> Option<&Frontier> {
        self.frontiers
            .get(corner.frontiers[direction.index()] as usize)
            .filter(|frontier| !frontier.is_empty())
    }

    /// Checks everything that look-ups rely on. Takes O(n log c) time for n nodes and c corners,
    /// whatever the data.
    ///
    /// # Errors
    /// The first fault found, in words.
    pub fn validate(&self) -> Result<(), String> {
        let (levels, max) = (self.levels, Self::MAX_LEVELS);
        if levels > max {
            return Err(format!("the octree has {levels} levels, where at most {max} are allowed"));
        }
        self.validate_corners()?;
        self.validate_nodes()
    }

    fn validate_corners(&self) -> Result<(), String> {
        let limit = self.lattice();
        let mut previous = None;
        for corner in &self.corners {
            let at = corner.at;
            if at.iter().any(|coordinate| *coordinate > limit) {
                return Err(format!(
                    "octree corner {at:?} lies outside the root, whose largest coordinate is {limit}"
                ));
            }
            if previous.is_some_and(|previous| previous >= at) {
                return Err(format!("octree corner {at:?} is out of order or appears twice"));
            }
            previous = Some(at);
            let count = self.frontiers.len();
            let missing = |index: &&u32| **index as usize >= count;
            if let Some(&index) = corner.frontiers.iter().find(missing) {
                return Err(format!(
                    "octree corner {at:?} uses frontier {index}, but there are only {count}"
                ));
            }
        }
        Ok(())
    }

    fn validate_nodes(&self) -> Result<(), String> {
        let count = self.nodes.len();
        if count == 0 {
            return Err("the octree has no nodes, not even a root".to_owned());
        }
        // Each node is marked before it is pushed and never pushed twice, so the loop ends on any
        // data.
        let mut reached = vec![false; count];
        reached[0] = true;
        let mut open = vec![(0_u32, Leaf { min: [0; 3], size: self.lattice() })];
        while let Some((node, cube)) = open.pop() {
            let first = self.nodes[node as usize];
            if first == 0 {
                let mut corners = (0..8).map(|number| cube.corner(number));
                if let Some(at) = corners.find(|at| self.corner_index(*at).is_none()) {
                    return Err(format!("octree corner {at:?}, which a leaf needs, is missing"));
                }
                continue;
            }
            if cube.size == 1 {
                return Err(format!("octree node {node} has children below the last level"));
            }
            if (first as usize).checked_add(8).is_none_or(|end| end > count) {
                return Err(format!(
                    "octree node {node} has children from {first} on, but there are only {count} nodes"
                ));
            }
            let half = Leaf { min: cube.min, size: cube.size / 2 };
            for octant in 0..8_u32 {
                let child = first + octant;
                if std::mem::replace(&mut reached[child as usize], true) {
                    return Err(format!(
                        "octree node {child} is reached twice: the nodes are not a tree"
                    ));
                }
                open.push((child, Leaf { min: half.corner(octant as usize), size: half.size }));
            }
        }
        match reached.iter().position(|reached| !reached) {
            Some(node) => Err(format!("octree node {node} has no parent")),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
#[path = "octree_tests.rs"]
mod tests;
