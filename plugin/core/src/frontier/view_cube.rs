//! The view direction with the largest share of a camera's image.
//!
//! Wang et al. 2016, section 3.6, project the view frustum onto the cube map of the leaf's faces
//! and select the face with the largest part of it. We cast a fixed grid of rays through the image
//! and count the face by which each leaves the cube: the share of the image, without polygon
//! clipping.
//!
//! Two deviations from the paper keep the result stable:
//! - Rays start half as far from the cube's centre as the camera. From a camera on a face, half of
//!   the image would leave by that face at once, whatever the view direction; one step further, in
//!   the next leaf, by the opposite face. With half the distance, a camera anywhere in the leaf
//!   that looks along an axis gets that axis's direction, as its sample camera does (up to a field
//!   of view of about 65 by 95 degrees).
//! - Every leaf counts as a cube, whatever its box: sample cameras look along the axes, so only
//!   directions count. In a long corridor, a box would assign nearly all of the image to the walls.

use glam::Vec3;

use super::{CameraView, ViewDirection};

/// Rays along each side of the image: 8 × 8 rays resolve shares of 2 %.
const RAYS: usize = 8;

/// Distance of the ray origin from the centre, as a fraction of the camera's distance.
const PARALLAX: f32 = 0.5;

/// The view direction with the largest share of the image.
///
/// `in_leaf` is the camera's position, with the leaf spanning 0 to 1 on each axis. Any view has one:
/// numbers out of range are clamped, and NaN gives any direction.
pub(super) fn widest_direction(in_leaf: Vec3, view: &CameraView) -> ViewDirection {
    let half_height = (view.vertical_fov.clamp(1e-3, 3.1) * 0.5).tan();
    let half_width = half_height * view.aspect.clamp(0.01, 100.0);
    let (right, up, forward) = (
        view.rotation * Vec3::X * half_width,
        view.rotation * Vec3::Y * half_height,
        view.rotation * Vec3::NEG_Z,
    );

    // A ray leaves by the face of least distance ÷ speed; speed ÷ distance needs no division per
    // ray. The origin is at least a quarter of the cube away from every face, so the reciprocals
    // are finite.
    let origin = (in_leaf.clamp(Vec3::ZERO, Vec3::ONE) - 0.5) * PARALLAX;
    let to_upper = (0.5 - origin).recip();
    let to_lower = (0.5 + origin).recip();

    // Through an edge by the face of the first axis.
    let mut counts = [0_u32; 6];
    for row in 0..RAYS {
        for column in 0..RAYS {
            let ray = forward + up * offset(row) + right * offset(column);
            // Both distances are positive, so the greater product is the one of the side ahead.
            let axis = (ray * to_upper).max(-ray * to_lower).max_position();
            counts[2 * axis + usize::from(ray[axis] < 0.0)] += 1;
        }
    }
    // Of equal shares that nearest to the camera's forward direction.
    let score = |direction: ViewDirection| {
        counts[direction.index()] as f32 + 0.4 * forward.dot(direction.forward())
    };
    let [first, others @ ..] = ViewDirection::ALL;
    others
        .into_iter()
        .fold(first, |best, other| if score(other) > score(best) { other } else { best })
}

/// Centre of the `index`-th of [`RAYS`] equal intervals of −1 to 1.
fn offset(index: usize) -> f32 {
    (2 * index + 1) as f32 / RAYS as f32 - 1.0
}

#[cfg(test)]
mod tests {
    use glam::Quat;
    use proptest::prelude::*;

    use super::*;

    fn looking(rotation: Quat) -> CameraView {
        CameraView {
            position: Vec3::ZERO,
            rotation,
            vertical_fov: 60_f32.to_radians(),
            aspect: 16.0 / 9.0,
        }
    }

    #[test]
    fn a_camera_along_an_axis_gets_that_direction_anywhere_in_the_leaf() {
        let steps = [0.0, 1e-6, 0.25, 0.5, 0.9, 1.0];
        for direction in ViewDirection::ALL {
            for number in 0..steps.len().pow(3) {
                let in_leaf =
                    Vec3::new(steps[number % 6], steps[number / 6 % 6], steps[number / 36]);
                assert_eq!(
                    widest_direction(in_leaf, &looking(direction.rotation())),
                    direction,
                    "at {in_leaf}"
                );
            }
        }
    }

    #[test]
    fn from_the_centre_the_shares_are_those_of_a_cube_map() {
        // Rotated by 40 degrees from −Z towards +X, an image 60 degrees wide covers −Z up to 45
        // degrees: 35 of its 60 degrees, and the rest is +X.
        let square = |degrees: f32| CameraView {
            aspect: 1.0,
            ..looking(Quat::from_rotation_y(-degrees.to_radians()))
        };
        let centre = Vec3::splat(0.5);
        assert_eq!(widest_direction(centre, &square(40.0)), ViewDirection::NegativeZ);
        assert_eq!(widest_direction(centre, &square(50.0)), ViewDirection::PositiveX);
        // Of equal shares, the direction nearest to the camera's.
        assert_eq!(widest_direction(centre, &square(44.0)), ViewDirection::NegativeZ);
        assert_eq!(widest_direction(centre, &square(46.0)), ViewDirection::PositiveX);
        // Nearer to the +X face, more of the image leaves by it.
        let right = Vec3::new(1.0, 0.5, 0.5);
        assert_eq!(widest_direction(right, &square(40.0)), ViewDirection::PositiveX);
    }

    proptest! {
        #[test]
        fn no_view_panics(
            in_leaf in prop::array::uniform3(prop::num::f32::ANY),
            rotation in prop::array::uniform4(prop::num::f32::ANY),
            vertical_fov in prop::num::f32::ANY,
            aspect in prop::num::f32::ANY,
        ) {
            let view = CameraView { position: Vec3::NAN, rotation: Quat::from_array(rotation), vertical_fov, aspect };
            let _ = widest_direction(Vec3::from_array(in_leaf), &view);
        }
    }
}
