//! Nodes and corners on the lattice of the deepest level.

use bevy::math::Vec3;

use super::CameraSpace;
use super::config::MAX_LEVELS;

/// Lattice coordinates.
pub(super) type At = [u16; 3];

/// A cube of the octree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Node {
    /// Its lower corner.
    pub(super) at: At,
    /// Its edge, in lattice steps: a power of two.
    pub(super) size: u16,
}

/// A corner that a division makes, and the corners on both sides of it along each axis on which it halves something.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct NewCorner {
    pub(super) at: At,
    /// One pair at the middle of an edge, two at the centre of a face, three at the centre of the node.
    pub(super) parents: Vec<[At; 2]>,
}

fn moved(at: At, axis: usize, steps: u16) -> At {
    let mut moved = at;
    moved[axis] += steps;
    moved
}

/// The eight corners of a cube in the order x + 2y + 4z.
pub(super) fn cube(at: At, size: u16) -> [At; 8] {
    std::array::from_fn(|corner| std::array::from_fn(|axis| at[axis] + size * ((corner >> axis) as u16 & 1)))
}

impl Node {
    pub(super) fn corners(self) -> [At; 8] {
        cube(self.at, self.size)
    }

    /// The twelve pairs of adjacent corners.
    pub(super) fn edges(self) -> impl Iterator<Item = [At; 2]> {
        let pairs = (0..3).flat_map(|axis| (0..8_usize).filter(move |corner| corner >> axis & 1 == 0).map(move |corner| (axis, corner)));
        pairs.map(move |(axis, corner)| {
            let low = self.corners()[corner];
            [low, moved(low, axis, self.size)]
        })
    }

    /// The eight halves, in the order x + 2y + 4z. The size must be above 1.
    pub(super) fn children(self) -> [Self; 8] {
        let size = self.size / 2;
        cube(self.at, size).map(|at| Self { at, size })
    }

    /// The 19 corners that a division makes: those of edges first, then of faces, then the centre, because each kind's parents are of the kind before.
    pub(super) fn new_corners(self) -> Vec<NewCorner> {
        let half = self.size / 2;
        let mut corners = Vec::with_capacity(19);
        for index in 0..27_u16 {
            let place = [index % 3, index / 3 % 3, index / 9];
            let halved: Vec<usize> = (0..3).filter(|axis| place[*axis] == 1).collect();
            if halved.is_empty() {
                continue;
            }
            let at: At = std::array::from_fn(|axis| self.at[axis] + half * place[axis]);
            let pair = |axis: usize| {
                let mut low = at;
                low[axis] -= half;
                [low, moved(at, axis, half)]
            };
            corners.push(NewCorner { at, parents: halved.into_iter().map(pair).collect() });
        }
        corners.sort_by_key(|corner| (corner.parents.len(), corner.at));
        corners
    }
}

/// World position of a corner on a lattice of `levels`.
pub(super) fn position(space: CameraSpace, levels: u8, at: At) -> Vec3 {
    let steps = f64::from(1_u32 << levels);
    // In double precision, and exact at both ends, so that a corner is at one place at whatever depth of lattice it is named.
    let along = |min: f32, max: f32, coordinate: u16| {
        let share = f64::from(coordinate) / steps;
        (f64::from(min) * (1.0 - share) + f64::from(max) * share) as f32
    };
    let [x, y, z] = at;
    Vec3::new(along(space.min.x, space.max.x, x), along(space.min.y, space.max.y, y), along(space.min.z, space.max.z, z))
}

/// The corner on the finest lattice that there can be: the same whatever the level limit of the run.
pub(super) fn finest(levels: u8, at: At) -> At {
    at.map(|coordinate| coordinate << (MAX_LEVELS - levels))
}

/// Squared distance in lattice steps.
pub(super) fn squared_distance(a: At, b: At) -> u64 {
    a.iter().zip(b).map(|(a, b)| u64::from(a.abs_diff(b)).pow(2)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_division_makes_each_corner_once_with_its_neighbours_as_parents() {
        let node = Node { at: [4, 0, 8], size: 4 };
        let new = node.new_corners();
        let kinds: Vec<_> = new.iter().map(|corner| corner.parents.len()).collect();
        assert_eq!(kinds, [[1; 12].as_slice(), [2; 6].as_slice(), [3].as_slice()].concat());
        let mut known = node.corners().to_vec();
        for corner in &new {
            assert!(!known.contains(&corner.at));
            for [low, high] in &corner.parents {
                assert_eq!((squared_distance(*low, corner.at), squared_distance(*high, corner.at)), (4, 4));
                assert!(known.contains(low) && known.contains(high), "parents come first");
            }
            known.push(corner.at);
        }
        assert_eq!(new[18].at, [6, 2, 10]);
        let mut children: Vec<_> = node.children().into_iter().flat_map(Node::corners).collect();
        children.sort_unstable();
        children.dedup();
        known.sort_unstable();
        assert_eq!(children, known);
        assert_eq!(node.children()[5], Node { at: [6, 0, 10], size: 2 });
    }

    #[test]
    fn there_are_twelve_edges_of_the_node_s_length() {
        let edges: Vec<_> = Node { at: [0, 2, 0], size: 2 }.edges().collect();
        assert_eq!(edges.len(), 12);
        assert!(edges.iter().all(|[a, b]| squared_distance(*a, *b) == 4 && a < b));
        assert!((0..12).all(|i| !edges[i + 1..].contains(&edges[i])));
    }

    #[test]
    fn positions_hit_the_corners_of_the_space_and_agree_between_lattices() {
        let space = CameraSpace { min: Vec3::new(-8.1, 0.3, -1e6), max: Vec3::new(7.7, 0.31, 1e6) };
        assert_eq!(position(space, 0, [0, 0, 0]), space.min);
        assert_eq!(position(space, 15, [1 << 15; 3]), space.max);
        assert_eq!(position(space, 2, [1, 2, 3]), position(space, 5, [8, 16, 24]));
        assert_eq!(finest(2, [1, 2, 4]), finest(5, [8, 16, 32]));
    }
}
