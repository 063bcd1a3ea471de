//! The octree over camera positions: its leaves' corners carry six frontiers each.

use bevy::reflect::Reflect;
use serde::{Deserialize, Serialize};

use super::Frontier;

/// One position at which frontiers are known.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Reflect, Serialize, Deserialize)]
pub struct Corner {
    /// Lattice coordinates: the root spans 0 to 2^`levels` on each axis.
    pub at: [u16; 3],
    /// Index into [`Octree::frontiers`] for each [`ViewDirection`](super::ViewDirection); [`Corner::UNKNOWN`] where the view shows nothing.
    pub frontiers: [u32; 6],
}

impl Corner {
    /// A view without a frontier: it sees nothing, or sits inside geometry.
    pub const UNKNOWN: u32 = u32::MAX;
}

/// Camera space, subdivided where frontiers differ.
#[derive(Clone, Debug, Default, PartialEq, Reflect, Serialize, Deserialize)]
pub struct Octree {
    /// Depth of the lattice: a corner's coordinates go from 0 to 2^`levels`. At most 15.
    pub levels: u8,
    /// `nodes[0]` is the root. 0 marks a leaf; anything else is the index of the first of eight children, which lie in a row in the order
    /// x + 2y + 4z (x = 1 is the upper half along X, and so on).
    pub nodes: Vec<u32>,
    /// Every corner of every leaf once, sorted by `at` (lexicographically, as the array compares).
    pub corners: Vec<Corner>,
    /// The frontiers that corners share.
    pub frontiers: Vec<Frontier>,
}
