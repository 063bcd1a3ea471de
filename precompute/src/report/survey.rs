//! Statistics of an octree.

use std::collections::{BTreeMap, BTreeSet};

use frugal_core::frontier::{Corner, Octree};

/// Statistics of an octree. Tolerates a malformed one: invalid indices are counted as broken and
/// skipped.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Survey {
    /// Subdivided nodes on every level, the root's first.
    pub inner: Vec<usize>,
    /// Leaves on every level.
    pub leaves: Vec<usize>,
    /// Outlines of leaves seen from above, in lattice units: lowest x, lowest z, edge.
    pub squares: BTreeSet<(u32, u32, u32)>,
    /// Columns of corners seen from above, x and z in lattice units: views with a frontier, and all
    /// views.
    pub columns: BTreeMap<(u16, u16), (usize, usize)>,
    /// Views of corners with a frontier.
    pub known_views: usize,
    /// Empty views: views of corners without a frontier.
    pub empty_views: usize,
    /// Indices that point outside the octree, and nodes below the lattice's last level.
    pub broken: usize,
}

impl Survey {
    /// Counts `octree`.
    pub(crate) fn new(octree: &Octree) -> Self {
        let levels = octree.levels.min(15);
        let mut survey = Self::default();
        // Level, node, lowest x and z of every pending node.
        let mut open = vec![(0u8, 0usize, 0u32, 0u32)];
        // Guards against cycles: a valid tree visits no node twice.
        let mut left = octree.nodes.len();
        while let Some((level, node, x, z)) = open.pop() {
            let Some(&first) = octree.nodes.get(node).filter(|_| left > 0) else {
                survey.broken += usize::from(!octree.nodes.is_empty());
                continue;
            };
            left -= 1;
            let edge = 1u32 << (levels - level);
            if first == 0 {
                count(&mut survey.leaves, level);
                survey.squares.insert((x, z, edge));
            } else if level == levels {
                survey.broken += 1;
            } else {
                count(&mut survey.inner, level);
                let half = edge / 2;
                // Children lie in the order x + 2y + 4z.
                open.extend((0..8u32).map(|child| {
                    (
                        level + 1,
                        first as usize + child as usize,
                        x + half * (child & 1),
                        z + half * (child >> 2),
                    )
                }));
            }
        }
        for corner in &octree.corners {
            survey.add(corner, octree.frontiers.len());
        }
        let depth = survey.inner.len().max(survey.leaves.len());
        survey.inner.resize(depth, 0);
        survey.leaves.resize(depth, 0);
        survey
    }

    fn add(&mut self, corner: &Corner, frontiers: usize) {
        let known = corner.frontiers.iter().filter(|&&index| (index as usize) < frontiers).count();
        let empty = corner.frontiers.iter().filter(|&&index| index == Corner::UNKNOWN).count();
        self.known_views += known;
        self.empty_views += empty;
        self.broken += 6 - known - empty;
        let [x, _, z] = corner.at;
        let column = self.columns.entry((x, z)).or_default();
        column.0 += known;
        column.1 += 6;
    }
}

fn count(levels: &mut Vec<usize>, level: u8) {
    let level = usize::from(level);
    if levels.len() <= level {
        levels.resize(level + 1, 0);
    }
    levels[level] += 1;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_every_level() {
        // A root whose last child (upper x, y and z) is subdivided again.
        let mut nodes = vec![1, 0, 0, 0, 0, 0, 0, 0, 9];
        nodes.extend([0; 8]);
        let corner = |at, frontiers| Corner { at, frontiers };
        let unknown = Corner::UNKNOWN;
        let corners = vec![
            corner([0, 0, 0], [0; 6]),
            corner([0, 4, 0], [unknown; 6]),
            corner([4, 4, 4], [0, 0, 7, unknown, 0, 0]),
        ];
        let octree = Octree { levels: 2, nodes, corners, frontiers: vec![Default::default()] };
        let survey = Survey::new(&octree);
        assert_eq!((&survey.inner[..], &survey.leaves[..]), (&[1, 1, 0][..], &[0, 7, 8][..]));
        // From above: four large squares (there is a leaf below the subdivided child too), four
        // small ones.
        assert_eq!(survey.squares.len(), 8);
        assert!(survey.squares.contains(&(2, 3, 1)) && survey.squares.contains(&(2, 0, 2)));
        assert_eq!((survey.known_views, survey.empty_views, survey.broken), (10, 7, 1));
        assert_eq!(survey.columns[&(0, 0)], (6, 12));
    }

    #[test]
    fn a_malformed_octree_is_counted_not_followed() {
        assert_eq!(Survey::new(&Octree::default()), Survey::default());
        let looping = Octree { levels: 15, nodes: vec![0, 0, 0], ..Octree::default() };
        assert_eq!(Survey::new(&looping).leaves, [1]);
        for nodes in [vec![1], vec![1, 1, 1, 1, 1, 1, 1, 1, 1], vec![u32::MAX]] {
            assert!(Survey::new(&Octree { levels: 255, nodes, ..Octree::default() }).broken > 0);
        }
        // Subdivided below the lattice.
        let deep = Octree {
            levels: 0,
            nodes: [1].into_iter().chain([0; 8]).collect(),
            ..Octree::default()
        };
        assert_eq!(Survey::new(&deep).broken, 1);
    }
}
