//! Where a camera's patches are dense.

use bevy::ecs::entity::Entity;
use bevy::math::Vec3;

use super::choice::density;

/// Distance from the camera at which patches are half as dense, as a share of the range.
const NEAR_SHARE: f32 = 0.1;
/// Step in which the centre of density follows the camera, as a share of that distance: patches
/// stay while the camera moves within a step.
const STEP_SHARE: f32 = 0.25;

/// A camera's density of patches: its centre, which follows the camera in steps, and the distance
/// at which the density is a half, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PatchFocus {
    pub camera: Entity,
    center: Vec3,
    near: f32,
}

impl PatchFocus {
    /// `before`: the last one of this camera.
    pub(super) fn new(camera: Entity, position: Vec3, range: f32, before: Option<&Self>) -> Self {
        // NaN compares false.
        let near = if range * NEAR_SHARE > 0.1 { (range * NEAR_SHARE).min(1e6) } else { 0.1 };
        let step = near * STEP_SHARE;
        // Hysteresis: a camera that moves to and fro over the border of a step changes nothing.
        let is_near = |before: &&Self| {
            before.near == near && (position - before.center).abs().max_element() <= 0.75 * step
        };
        if let Some(before) = before.filter(is_near) {
            return *before;
        }
        let center = (position / step).round() * step;
        Self { camera, center: if center.is_finite() { center } else { Vec3::ZERO }, near }
    }

    /// The same in a world that is shifted.
    pub(super) fn shifted(self, shift: Vec3) -> Self {
        Self { center: self.center + shift, ..self }
    }

    /// Relative density at a position.
    pub(super) fn density(&self, position: Vec3) -> f32 {
        density(position, self.center, self.near)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patches_stay_while_a_camera_moves_within_a_step() {
        let from = |x: f32, range: f32, before: Option<&PatchFocus>| {
            PatchFocus::new(Entity::PLACEHOLDER, Vec3::new(x, 2.0, -3.0), range, before)
        };
        let at = |x: f32, range: f32| from(x, range, None);
        assert_eq!(at(0.1, 40.0), at(0.4, 40.0));
        assert_ne!(at(0.1, 40.0), at(1.4, 40.0));
        // Steps are of 1 m: over the border and back, and then beyond.
        let before = at(0.45, 40.0);
        assert_ne!(at(0.55, 40.0), before);
        assert_eq!(from(0.55, 40.0, Some(&before)), before);
        assert_ne!(from(0.8, 40.0, Some(&before)), before);
        assert_ne!(from(0.45, 80.0, Some(&before)), before, "another range");
        for (position, range) in [
            (f32::NAN, 40.0),
            (1e30, 40.0),
            (f32::INFINITY, 0.0),
            (1.0, f32::NAN),
            (1.0, f32::INFINITY),
            (1.0, -1.0),
        ] {
            let around = at(position, range);
            assert!(
                around.center.is_finite() && around.near.is_finite() && around.near > 0.0,
                "{around:?}"
            );
        }
    }
}
