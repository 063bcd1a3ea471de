//! Look-up of the frontier for a run-time camera.

use glam::Vec3;

use super::view_cube::widest_direction;
use super::{
    Bounds, CameraView, Conditions, Frontier, FrontierMap, KnobEffects, Leaf, Octree, SharedLevels,
    ViewDirection,
};
use crate::knobs::KnobSpace;

/// A source of frontiers: [`FrontierMap`], with its octree and view cubes, or any other structure
/// over a scene's cameras.
///
/// The controller calls [`look_up`](Self::look_up) once per camera and frame, so it should take
/// less than a microsecond and must not allocate.
pub trait FrontierStore: Send + Sync {
    /// The frontier that fits `view` best, with its sample camera. `None` where no frontier is
    /// known. Must not panic for any numbers in `view`, NaN included.
    fn look_up(&self, view: &CameraView) -> Option<SampleRef<'_>>;

    /// The knobs of the frontiers' settings.
    fn knobs(&self) -> &KnobSpace;

    /// What the levels of knobs of app scope cost each camera. `None` where there are none, or their
    /// cost is unknown: with several cameras the levels of others then cost nothing.
    fn shared_levels(&self) -> Option<SharedLevels<'_>> {
        None
    }

    /// What each knob saves and costs alone, for people. `None` where it is not known.
    fn knob_effects(&self) -> Option<&KnobEffects> {
        None
    }

    /// The frontier over all views together, for a scene that has changed since the local ones were
    /// measured. `None` where there is none.
    fn overall(&self) -> Option<&Frontier> {
        None
    }

    /// What the frontiers' watts and errors refer to. `None` where it is unknown: the app is then
    /// not compared with it.
    fn conditions(&self) -> Option<Conditions<'_>> {
        None
    }

    /// Mean predicted error (1 − SSIM) at which the error budget `budget` is just met. `None` where
    /// it is unknown: it is then the budget itself. 0 where only the best settings are safe.
    fn error_target(&self, budget: f64) -> Option<f64> {
        let _ = budget;
        None
    }
}

/// Where a look-up finds a frontier: an octree corner and a view direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Address {
    /// Lattice coordinates of the corner.
    pub at: [u16; 3],
    /// The direction that covers most of the image.
    pub direction: ViewDirection,
}

/// The address of a camera in `leaf` of an octree with `levels` levels (0 to 15; more count as 15)
/// over `bounds`: the leaf's nearest corner, and the view direction that covers most of the image
/// (Wang et al. 2016, section 3.6).
pub fn address_in(bounds: &Bounds, levels: u8, leaf: Leaf, view: &CameraView) -> Address {
    let lattice = f32::from(1_u16 << levels.min(Octree::MAX_LEVELS));
    let min = Vec3::from_array(leaf.min.map(f32::from));
    let in_leaf = (bounds.to_unit(view.position) * lattice - min) / f32::from(leaf.size);
    // Halfway, the lower corner.
    let corner = (0..3).map(|axis| usize::from(in_leaf[axis] > 0.5) << axis).sum();
    Address { at: leaf.corner(corner), direction: widest_direction(in_leaf, view) }
}

/// A camera with a known frontier.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "bevy", derive(bevy_reflect::Reflect))]
pub struct SampleCamera {
    /// Index of the position in its store: for a [`FrontierMap`], the index of the octree corner.
    pub corner: u32,
    /// World position, metres.
    pub position: Vec3,
    /// View direction.
    pub direction: ViewDirection,
}

/// Result of a look-up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampleRef<'a> {
    /// The sample camera of the frontier.
    pub camera: SampleCamera,
    /// The frontier; not empty.
    pub frontier: &'a Frontier,
}

impl FrontierStore for FrontierMap {
    /// Wang et al. 2016, section 3.6: the leaf that contains the camera, the view direction that
    /// covers most of its image, and the nearest corner.
    ///
    /// A camera outside the bounds counts as one at the nearest position inside.
    fn look_up(&self, view: &CameraView) -> Option<SampleRef<'_>> {
        look_up_in(&self.octree, &self.bounds, view)
    }

    fn knobs(&self) -> &KnobSpace {
        &self.knobs
    }

    fn error_target(&self, budget: f64) -> Option<f64> {
        self.error_rates.target(budget)
    }

    fn conditions(&self) -> Option<Conditions<'_>> {
        Some(Conditions {
            scene: &self.scene,
            capture: &self.capture,
            meter: &self.meter,
            bounds: &self.bounds,
            idle: self.work_prices.idle,
        })
    }

    fn shared_levels(&self) -> Option<SharedLevels<'_>> {
        let rate = self.capture.frames_per_second;
        SharedLevels::new(&self.work_prices.shared, &self.knobs, rate)
    }

    fn knob_effects(&self) -> Option<&KnobEffects> {
        Some(&self.knob_effects)
    }

    fn overall(&self) -> Option<&Frontier> {
        (!self.shared.is_empty()).then_some(&self.shared)
    }
}

/// [`FrontierMap`]'s look-up, for an octree over `bounds` that is not part of a map.
pub fn look_up_in<'a>(
    octree: &'a Octree,
    bounds: &Bounds,
    view: &CameraView,
) -> Option<SampleRef<'a>> {
    let leaf = octree.leaf_at(bounds.to_unit(view.position));
    let Address { at, direction } = address_in(bounds, octree.levels, leaf, view);
    let index = octree.corner_index(at)?;
    let frontier = octree.frontier(&octree.corners[index], direction)?;
    let unit = Vec3::from_array(at.map(f32::from)) / f32::from(octree.lattice());
    let position = bounds.from_unit(unit);
    Some(SampleRef { camera: SampleCamera { corner: index as u32, position, direction }, frontier })
}

#[cfg(test)]
#[path = "store_tests.rs"]
mod tests;
