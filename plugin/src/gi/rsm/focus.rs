//! Where a camera looks at the scene: the middle and the size of what directional lights' maps
//! cover for it.
//!
//! For a camera inside the scene's box, that is around the camera: any surface may be near it. For
//! one outside, as above a large world or behind a long lens, it is where the view enters the box.

use bevy::math::{Mat4, Vec3};
use bevy::transform::components::Transform;

/// What directional lights' maps cover for a camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Focus {
    /// World space, metres.
    pub position: Vec3,
    /// Radius around it, metres: `FrugalGi::range`, or what fills the view where that is more.
    pub range: f32,
}

/// Share by which maps extend beyond what fills the view: surfaces outside of it light it, too.
const MARGIN: f32 = 1.25;

impl Focus {
    /// For a camera of `pose` and projection. The radius grows in steps, so that maps keep their
    /// texels in place while a camera zooms.
    pub(super) fn new(
        scene: (Vec3, Vec3),
        pose: &Transform,
        clip_from_view: Mat4,
        range: f32,
    ) -> Self {
        let around = Self { position: pose.translation, range };
        let view_from_clip = clip_from_view.inverse();
        let is_inside =
            pose.translation.cmpge(scene.0).all() && pose.translation.cmple(scene.1).all();
        if is_inside || !view_from_clip.is_finite() || !(range.is_finite() && range > 0.0) {
            return around;
        }
        let rays = [-1.0, 0.0, 1.0].map(|x| [-1.0, 0.0, 1.0].map(|y| ray(view_from_clip, x, y)));
        let entry = |(origin, direction): &(Vec3, Vec3)| {
            let origin_in_world = pose.rotation * *origin + pose.translation;
            Some(enter(scene, origin_in_world, pose.rotation * *direction)? - origin.z)
        };
        let Some(depth) = rays.iter().flatten().filter_map(entry).min_by(f32::total_cmp) else {
            return around;
        };
        let half_width = rays
            .iter()
            .flatten()
            .map(|(origin, direction)| {
                (*origin + *direction * (depth + origin.z)).truncate().abs().max_element()
            })
            .fold(0.0, f32::max);
        // Steps of a factor of √2.
        let steps = (2.0 * (MARGIN * half_width / range).log2()).ceil().max(0.0);
        let focus = Self {
            position: pose.translation + pose.rotation * Vec3::NEG_Z * depth,
            range: range * (0.5 * steps).exp2(),
        };
        if focus.position.is_finite() && focus.range.is_finite() { focus } else { around }
    }
}

/// Origin and direction, 1 m along the view, of the ray through a point of the image, in view
/// space.
fn ray(view_from_clip: Mat4, x: f32, y: f32) -> (Vec3, Vec3) {
    let at = |depth: f32| view_from_clip.project_point3(Vec3::new(x, y, depth));
    let (near, far) = (at(1.0), at(0.5));
    let along = far - near;
    (near, along / -along.z)
}

/// Distance at which a ray enters a box, in units of its direction; `None` where it misses.
fn enter((least, most): (Vec3, Vec3), origin: Vec3, direction: Vec3) -> Option<f32> {
    let (a, b) = ((least - origin) / direction, (most - origin) / direction);
    // NaN, of a ray in the plane of a side, counts for neither.
    let (first, last) = (a.min(b), a.max(b));
    let (first, last) = (first.max_element().max(0.0), last.min_element());
    (first <= last).then_some(first)
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLAIN: (Vec3, Vec3) = (Vec3::new(-1e3, 0.0, -1e3), Vec3::new(1e3, 2.0, 1e3));

    fn lens(degrees: f32) -> Mat4 {
        Mat4::perspective_infinite_reverse_rh(degrees.to_radians(), 1.5, 0.1)
    }

    fn above(height: f32) -> Transform {
        Transform::from_xyz(5.0, height, 7.0).looking_to(Vec3::NEG_Y, Vec3::Z)
    }

    #[test]
    fn inside_the_scene_it_is_around_the_camera() {
        let pose = Transform::from_xyz(3.0, 1.0, 4.0);
        for degrees in [1.0, 45.0, 120.0] {
            let focus = Focus::new(PLAIN, &pose, lens(degrees), 40.0);
            assert_eq!(focus, Focus { position: pose.translation, range: 40.0 });
        }
    }

    #[test]
    fn from_outside_it_is_where_the_view_enters_the_scene() {
        for height in [10.0, 100.0, 900.0] {
            let focus = Focus::new(PLAIN, &above(height), lens(2.0), 40.0);
            assert!(focus.position.abs_diff_eq(Vec3::new(5.0, 2.0, 7.0), 1e-2), "{focus:?}");
            assert_eq!(focus.range, 40.0, "a long lens sees less than the range");
            let wide = Focus::new(PLAIN, &above(height), lens(60.0), 40.0);
            let needed = MARGIN * 1.5 * (height - 2.0) * 30f32.to_radians().tan();
            assert!(
                wide.range >= needed && wide.range < 1.5 * needed.max(40.0),
                "{height} m: {wide:?} for {needed}"
            );
        }
        let parallel = Mat4::orthographic_rh(-90.0, 90.0, -60.0, 60.0, 2000.0, 0.0);
        let focus = Focus::new(PLAIN, &above(500.0), parallel, 40.0);
        assert!(focus.position.abs_diff_eq(Vec3::new(5.0, 2.0, 7.0), 1e-1), "{focus:?}");
        assert!(focus.range >= MARGIN * 90.0 && focus.range < 160.0 + 1.0, "{focus:?}");
    }

    #[test]
    fn a_view_past_the_scene_and_broken_ones_stay_at_the_camera() {
        let away = Transform::from_xyz(0.0, 50.0, 0.0).looking_to(Vec3::Y, Vec3::Z);
        assert_eq!(Focus::new(PLAIN, &away, lens(60.0), 40.0).position, away.translation);
        for matrix in [Mat4::ZERO, Mat4::from_cols_array(&[f32::NAN; 16])] {
            assert_eq!(Focus::new(PLAIN, &above(50.0), matrix, 40.0).range, 40.0);
        }
        for range in [0.0, -1.0, f32::INFINITY] {
            assert_eq!(Focus::new(PLAIN, &above(50.0), lens(60.0), range).range, range);
        }
        let lost = Transform::from_xyz(f32::NAN, 0.0, 0.0);
        assert!(Focus::new(PLAIN, &lost, lens(60.0), 40.0).range.is_finite());
        let far = Focus::new(PLAIN, &above(1e30), lens(60.0), 40.0);
        assert!(far.position.is_finite() && far.range.is_finite(), "{far:?}");
    }
}
