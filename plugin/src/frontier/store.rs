//! From a run-time camera to the frontier of its sample camera.

use bevy::math::Vec3;
use bevy::reflect::Reflect;

use super::view_cube::directions_by_coverage;
use super::{Bounds, CameraView, Frontier, FrontierMap, Leaf, Octree, ViewDirection};
use crate::knobs::KnobSpace;

/// Where frontiers come from: [`FrontierMap`], with its octree and view cubes, or any other
/// structure over a scene's cameras.
///
/// The controller asks once per camera and frame, so [`look_up`](Self::look_up) should take less
/// than a microsecond and must not allocate.
pub trait FrontierStore: Send + Sync {
    /// The frontier that fits `view` best, and whose it is. `None` where nothing is known. Never
    /// panics, whatever numbers `view` holds.
    fn look_up(&self, view: &CameraView) -> Option<SampleRef<'_>>;

    /// The knobs that the frontiers' settings set.
    fn knobs(&self) -> &KnobSpace;

    /// Watts that a unit of error is worth under an error budget, so that the mean keeps it; see
    /// [`ErrorRates`](super::ErrorRates). `None` where the store does not know: each frame's error
    /// is then limited.
    fn error_rate(&self, budget: f64) -> Option<f64> {
        let _ = budget;
        None
    }

    /// Mean of predicted errors at which an error budget is just kept. `None` where the store does
    /// not know: the rate then stays as it is.
    fn error_target(&self, budget: f64) -> Option<f64> {
        let _ = budget;
        None
    }
}

/// Where a look-up begins: an octree corner, and a view direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Reflect)]
pub struct Address {
    /// Lattice coordinates of the corner.
    pub at: [u16; 3],
    /// The direction that the picture covers most.
    pub direction: ViewDirection,
}

/// The address of a camera in `leaf` of an octree of so many `levels` over `bounds`: the leaf's
/// nearest corner, and the view direction that the picture covers most (Wang et al. 2016, section
/// 3.6).
pub fn address_in(bounds: &Bounds, levels: u8, leaf: Leaf, view: &CameraView) -> Address {
    let in_leaf =
        position_in(bounds, f32::from(1_u16 << levels.min(Octree::MAX_LEVELS)), leaf, view);
    let corner = corners_by_distance(in_leaf, bounds.extent())[0];
    Address {
        at: leaf.corner(usize::from(corner)),
        direction: directions_by_coverage(in_leaf, view)[0],
    }
}

/// The camera's position with the leaf at 0 to 1 on each axis.
fn position_in(bounds: &Bounds, lattice: f32, leaf: Leaf, view: &CameraView) -> Vec3 {
    (bounds.to_unit(view.position) * lattice - Vec3::from_array(leaf.min.map(f32::from)))
        / f32::from(leaf.size)
}

/// A camera at which a frontier was found.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
pub struct SampleCamera {
    /// Number of the position in its store: for a [`FrontierMap`], the index of the octree corner.
    pub corner: u32,
    /// World position, metres.
    pub position: Vec3,
    /// Where it looks.
    pub direction: ViewDirection,
}

/// What a look-up finds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampleRef<'a> {
    /// Whose frontier it is.
    pub camera: SampleCamera,
    /// The frontier; not empty.
    pub frontier: &'a Frontier,
}

impl FrontierStore for FrontierMap {
    /// Wang et al. 2016, section 3.6: the leaf that holds the camera, the view direction that its
    /// picture covers most, the corner nearest to it.
    ///
    /// Where that corner does not know that view, the next nearest corner of the leaf that does;
    /// where none does, the direction that the picture covers next. Cameras outside the bounds
    /// count as at the nearest position inside.
    fn look_up(&self, view: &CameraView) -> Option<SampleRef<'_>> {
        look_up_in(&self.octree, &self.bounds, view)
    }

    fn knobs(&self) -> &KnobSpace {
        &self.knobs
    }

    fn error_rate(&self, budget: f64) -> Option<f64> {
        self.error_rates.rate(budget)
    }

    fn error_target(&self, budget: f64) -> Option<f64> {
        self.error_rates.target(budget)
    }
}

/// [`FrontierMap`]'s look-up, in an octree over `bounds` that is no map yet.
pub fn look_up_in<'a>(
    octree: &'a Octree,
    bounds: &Bounds,
    view: &CameraView,
) -> Option<SampleRef<'a>> {
    let leaf = octree.leaf_at(bounds.to_unit(view.position));
    let lattice = f32::from(octree.lattice());
    let in_leaf = position_in(bounds, lattice, leaf, view);
    let corners = corners_by_distance(in_leaf, bounds.extent());
    for direction in directions_by_coverage(in_leaf, view) {
        for number in corners {
            let at = leaf.corner(usize::from(number));
            let Some(index) = octree.corner_index(at) else { continue };
            let Some(frontier) = octree.frontier(&octree.corners[index], direction) else {
                continue;
            };
            let position = bounds.from_unit(Vec3::from_array(at.map(f32::from)) / lattice);
            return Some(SampleRef {
                camera: SampleCamera { corner: index as u32, position, direction },
                frontier,
            });
        }
    }
    None
}

/// Numbers of a leaf's eight corners, the nearest to `in_leaf` first, where the leaf is a box of
/// the shape of `extent`.
///
/// Corners at equal distance come in the order of their numbers, so that a camera that stands still
/// keeps its sample.
fn corners_by_distance(in_leaf: Vec3, extent: Vec3) -> [u8; 8] {
    let to_lower = in_leaf * extent;
    let to_upper = (Vec3::ONE - in_leaf) * extent;
    let (to_lower, to_upper) = (to_lower * to_lower, to_upper * to_upper);
    let distances: [f32; 8] = std::array::from_fn(|number| {
        (0..3)
            .map(|axis| if number >> axis & 1 == 1 { to_upper[axis] } else { to_lower[axis] })
            .sum()
    });
    let mut corners = [0, 1, 2, 3, 4, 5, 6, 7];
    corners.sort_unstable_by(|a, b| {
        distances[usize::from(*a)].total_cmp(&distances[usize::from(*b)]).then(a.cmp(b))
    });
    corners
}

#[cfg(test)]
#[path = "store_tests.rs"]
mod tests;
