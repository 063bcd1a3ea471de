//! Free space: the voxels that a camera can reach from known camera positions.

use std::collections::{HashMap, HashSet, VecDeque};

use glam::{IVec3, Vec3};
use rand::RngExt;

use frugal_trace::scene::{Bounds, RayScene};

/// Edge of a voxel, metres; larger if the bounds would have too many voxels.
const VOXEL: f32 = 0.5;
/// Most voxels along an edge of the bounds.
const MOST_ALONG: f32 = 96.0;
/// Most voxels that a fill visits.
const MOST: usize = 60_000;

/// Least distance of a camera from any surface, metres.
const CLEARANCE: f32 = 0.25;
/// Eye heights of people who sit, stand, or stand on something: least and greatest, metres above the
/// ground.
pub(super) const HEIGHTS: (f32, f32) = (0.9, 2.4);

/// Whether a camera can be at `position`: away from surfaces, and between `heights` above the ground.
/// Without ground below, the height is not limited.
pub(super) fn allows(rays: &RayScene, position: Vec3, heights: (f32, f32)) -> bool {
    is_clear(rays, position, CLEARANCE)
        && !rays.inside_geometry(position)
        && rays
            .closest(position, Vec3::NEG_Y, f32::INFINITY)
            .is_none_or(|hit| (heights.0..=heights.1).contains(&hit.distance))
}

/// Whether no surface is within `distance` of `position`, by rays to the faces, edges and corners
/// of a cube.
fn is_clear(rays: &RayScene, position: Vec3, distance: f32) -> bool {
    let steps = || -1..=1;
    let directions =
        steps().flat_map(|x| steps().flat_map(move |y| steps().map(move |z| IVec3::new(x, y, z))));
    directions
        .filter(|direction| *direction != IVec3::ZERO)
        .all(|direction| !rays.any(position, direction.as_vec3().normalize(), distance))
}

/// Positions that cameras can reach.
#[derive(Clone, Debug, Default)]
pub(super) struct FreeSpace {
    positions: Vec<Vec3>,
    voxel: f32,
}

impl FreeSpace {
    /// Flood-fills `bounds` from `seeds`, between voxels without geometry in between. Without a
    /// free seed, starts from every free voxel of the bounds.
    pub(super) fn fill(
        rays: &RayScene,
        bounds: &Bounds,
        seeds: &[Vec3],
        heights: (f32, f32),
    ) -> Self {
        let voxel = VOXEL.max(bounds.size().max_element() / MOST_ALONG);
        let at = |index: IVec3| bounds.min + (index.as_vec3() + 0.5) * voxel;
        let voxel_at = |position: Vec3| ((position - bounds.min) / voxel).floor().as_ivec3();
        let mut known: HashMap<IVec3, bool> = HashMap::new();
        // A camera may pass over a low wall or through a door between positions at eye height: only
        // the positions themselves need full clearance.
        let passable =
            |position: Vec3| bounds.contains(position) && is_clear(rays, position, CLEARANCE * 0.5);
        let mut queue: VecDeque<IVec3> =
            seeds.iter().filter(|seed| seed.is_finite()).map(|seed| voxel_at(*seed)).collect();
        if !queue.iter().any(|index| passable(at(*index))) {
            queue = every_voxel(bounds, voxel).collect();
        }
        let mut filled: HashSet<IVec3> = HashSet::new();
        let mut positions = Vec::new();
        while let Some(index) = queue.pop_front() {
            if filled.len() >= MOST
                || !*known.entry(index).or_insert_with(|| passable(at(index)))
                || !filled.insert(index)
            {
                continue;
            }
            if allows(rays, at(index), heights) {
                positions.push(at(index));
            }
            for axis in [IVec3::X, IVec3::Y, IVec3::Z] {
                for next in [index + axis, index - axis] {
                    if !filled.contains(&next) && !rays.any(at(index), at(next) - at(index), 1.0) {
                        queue.push_back(next);
                    }
                }
            }
        }
        Self { positions, voxel }
    }

    /// A random position in a random voxel, and the voxel's number.
    pub(super) fn sample(&self, random: &mut impl rand::Rng) -> Option<(Vec3, u32)> {
        let center = *self.positions.get(random.random_range(0..self.positions.len().max(1)))?;
        let mut offset = || random.random_range(-0.5..0.5) * self.voxel;
        let position = center + Vec3::new(offset(), offset(), offset());
        // A spatial hash of the voxel.
        let block = (center / self.voxel).floor().as_ivec3();
        let number = block.x.wrapping_mul(73_856_093)
            ^ block.y.wrapping_mul(19_349_663)
            ^ block.z.wrapping_mul(83_492_791);
        Some((position, number.cast_unsigned()))
    }
}

fn every_voxel(bounds: &Bounds, voxel: f32) -> impl Iterator<Item = IVec3> {
    let count = (bounds.size() / voxel)
        .ceil()
        .as_ivec3()
        .clamp(IVec3::ONE, IVec3::splat(MOST_ALONG as i32 + 1));
    (0..count.z).flat_map(move |z| {
        (0..count.y).flat_map(move |y| (0..count.x).map(move |x| IVec3::new(x, y, z)))
    })
}

#[cfg(test)]
mod tests {
    use frugal_trace::scene::Triangle;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;

    /// A solid box: its faces, counter-clockwise seen from outside.
    fn slab(min: Vec3, max: Vec3) -> impl Iterator<Item = Triangle> {
        let (center, half) = ((min + max) * 0.5, (max - min) * 0.5);
        [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z].into_iter().flat_map(
            move |axis| {
                let up = if axis.y == 0.0 { Vec3::Y } else { Vec3::Z };
                let right = up.cross(axis);
                let at = |r: f32, u: f32| center + (axis + right * r + up * u) * half;
                let [a, b, c, d] = [at(-1.0, -1.0), at(1.0, -1.0), at(1.0, 1.0), at(-1.0, 1.0)];
                [[a, b, c], [a, c, d]].map(|corners| Triangle { corners, mesh: 0, index: 0 })
            },
        )
    }

    /// A closed room of 6 × 3 × 6 m with a wall across it that has no door, inside bounds of 10 × 5
    /// × 10 m.
    fn scene() -> RayScene {
        let slabs = [
            ([-3.2, -0.2, -3.2], [3.2, 0.0, 3.2]),
            ([-3.2, 3.0, -3.2], [3.2, 3.2, 3.2]),
            ([-3.2, 0.0, -3.2], [-3.0, 3.0, 3.2]),
            ([3.0, 0.0, -3.2], [3.2, 3.0, 3.2]),
            ([-3.0, 0.0, -3.2], [3.0, 3.0, -3.0]),
            ([-3.0, 0.0, 3.0], [3.0, 3.0, 3.2]),
            ([-0.1, 0.0, -3.0], [0.1, 3.0, 3.0]),
        ];
        RayScene::new(slabs.into_iter().flat_map(|(min, max)| slab(min.into(), max.into())))
    }

    fn bounds() -> Bounds {
        Bounds { min: Vec3::new(-5.0, -1.0, -5.0), max: Vec3::new(5.0, 4.0, 5.0) }
    }

    #[test]
    fn only_reachable_voxels_are_filled() {
        let rays = scene();
        let space = FreeSpace::fill(&rays, &bounds(), &[Vec3::new(-1.5, 1.6, 0.0)], HEIGHTS);
        assert!(space.positions.len() > 100, "{}", space.positions.len());
        let mut random = ChaCha8Rng::seed_from_u64(1);
        for _ in 0..500 {
            let (position, _) = space.sample(&mut random).expect("positions");
            // Up to half a voxel from a voxel's centre, which is clear.
            assert!(
                position.x < 0.1
                    && position.x > -3.1
                    && position.z.abs() < 3.1
                    && (0.5..2.9).contains(&position.y),
                "{position}"
            );
        }
    }

    #[test]
    fn clearance_keeps_cameras_from_walls_floors_and_solids() {
        let rays = scene();
        let allows = |x: f32, y: f32, z: f32| allows(&rays, Vec3::new(x, y, z), HEIGHTS);
        assert!(allows(-1.5, 1.6, 0.0));
        assert!(!allows(-2.9, 1.6, 0.0), "10 cm from a wall");
        assert!(
            !allows(-1.5, 0.3, 0.0) && !allows(-1.5, 2.7, 0.0),
            "just above the floor, under the ceiling"
        );
        assert!(!allows(0.0, 1.6, 0.0) && !allows(3.1, 1.6, 0.0), "in a wall");
    }

    #[test]
    fn without_a_seed_all_of_the_bounds_are_tried_and_nothing_is_fine_too() {
        let rays = scene();
        let all = FreeSpace::fill(&rays, &bounds(), &[], HEIGHTS);
        let one_side = FreeSpace::fill(&rays, &bounds(), &[Vec3::new(-1.5, 1.6, 0.0)], HEIGHTS);
        assert!(all.positions.len() > one_side.positions.len());
        let wall = Bounds { min: Vec3::new(3.05, 1.0, 0.0), max: Vec3::new(3.15, 1.1, 0.1) };
        let nothing = FreeSpace::fill(&rays, &wall, &[Vec3::NAN], HEIGHTS);
        assert!(nothing.positions.is_empty());
        assert!(nothing.sample(&mut ChaCha8Rng::seed_from_u64(1)).is_none());
    }
}
