//! The region of the world that a directional light's cascades cover.

use bevy::math::{Mat3, Vec2, Vec3};

use crate::gi::texels::CascadeCut;

/// Share of half a region's width over which its light fades towards its border, so that none
/// appears at once where the region follows the camera.
const FADE: f32 = 0.25;
/// Steps along the side of a region in which it follows the camera.
const STEPS: u32 = 16;
/// Radius of the near cascade, as a share of the range.
const NEAR_SHARE: f32 = 0.3;
/// Where the near cascade would be larger than this share of the far one's side, one map replaces
/// both.
const LARGEST_NEAR: f32 = 0.6;
/// Least distance along the rays, metres, up to which meshes before and behind the camera are in a
/// map: one of a greater depth would tell positions apart only to centimetres.
const DEPTH: f32 = 16_384.0;

/// Extent of a directional light's map in the light's own axes (the light shines along −Z).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LightRegion {
    /// Centre of the near plane, world space.
    pub origin: Vec3,
    /// Size across the rays, metres.
    pub size: Vec2,
    /// Length along the rays, metres.
    pub depth: f32,
    /// Share of half the size over which light fades towards the border: 0 where the scene ends
    /// there.
    pub fade: Vec2,
}

/// The region of a map of `texels` × `texels` around `camera`, where a camera is or looks: the whole
/// scene where it is small, else a square of twice `range`. Along the rays it contains the whole
/// scene, since distant meshes cast shadows on near ones, but what fell or was put kilometres away.
///
/// The region moves in steps of a sixteenth, which are whole texels, and grows in steps of an
/// eighth. So VPLs stay in place while the camera or a mesh moves, and the map is seldom rendered
/// for that.
pub(super) fn cover(
    scene: (Vec3, Vec3),
    rotation: Mat3,
    camera: Vec3,
    range: f32,
    texels: u32,
) -> LightRegion {
    let light_from_world = rotation.transpose();
    let half = 0.5 * (scene.1 - scene.0);
    let center = light_from_world * (0.5 * (scene.0 + scene.1));
    let spread = light_from_world.abs() * half;
    let eye = light_from_world * camera;
    let range = if range.is_finite() && range > 0.0 { range } else { f32::MAX };

    let axis = |center: f32, spread: f32, eye: f32| -> (f32, f32, f32) {
        if spread <= range || !eye.is_finite() {
            let step = spread.max(1e-3).log2().ceil().exp2() / 8.0;
            let low = ((center - spread) / step).floor() * step;
            let high = ((center + spread) / step).ceil() * step;
            (0.5 * (low + high), (high - low).max(step), 0.0)
        } else {
            let size = 2.0 * range;
            let step = size / texels as f32 * (texels / STEPS).max(1) as f32;
            ((eye / step).round() * step, size, FADE)
        }
    };
    let (x, width, fade_x) = axis(center.x, spread.x, eye.x);
    let (y, height, fade_y) = axis(center.y, spread.y, eye.y);
    let most = DEPTH.max(4.0 * range);
    let (middle, half_depth) = if spread.z > most && eye.is_finite() {
        let step = most / 8.0;
        let middle = (eye.z / step).round() * step;
        (middle.max(center.z - spread.z).min(center.z + spread.z), most)
    } else {
        (center.z, spread.z)
    };
    let margin = 0.01 * half_depth + 0.01;
    let near = middle + half_depth + margin;
    LightRegion {
        origin: rotation * Vec3::new(x, y, near),
        size: Vec2::new(width, height),
        depth: 2.0 * (half_depth + margin),
        fade: Vec2::new(fade_x, fade_y),
    }
}

/// The near cascade: the part of `far`, a region of `texels` × `texels`, around the camera, whose
/// texels light most of the image. `None` where it would be most of `far`. Its border lies between
/// texels of `far`, so that all light is in exactly one cascade.
pub(super) fn near(
    far: &LightRegion,
    rotation: Mat3,
    camera: Vec3,
    range: f32,
    texels: u32,
) -> Option<(LightRegion, CascadeCut)> {
    let light_from_world = rotation.transpose();
    let (center, eye) = (light_from_world * far.origin, light_from_world * camera);
    if !(eye.is_finite() && center.is_finite()) {
        return None;
    }
    let axis = |center: f32, size: f32, eye: f32| -> Option<(u32, u32)> {
        let texel = size / texels as f32;
        let count = (2.0 * NEAR_SHARE * range / texel).ceil();
        if !(count >= 1.0 && count <= LARGEST_NEAR * texels as f32) {
            return None;
        }
        let step = (count / 8.0).floor().max(1.0);
        let first = ((eye - (center - 0.5 * size)) / texel - 0.5 * count) / step;
        Some(((first.round() * step).clamp(0.0, texels as f32 - count) as u32, count as u32))
    };
    let (left, width) = axis(center.x, far.size.x, eye.x)?;
    let (bottom, height) = axis(center.y, far.size.y, eye.y)?;
    let texel = far.size / texels as f32;
    let low = center.truncate() - 0.5 * far.size;
    let texels_across = Vec2::new(width as f32, height as f32);
    let middle = low + texel * (Vec2::new(left as f32, bottom as f32) + 0.5 * texels_across);
    let region = LightRegion {
        origin: rotation * middle.extend(center.z),
        size: texel * texels_across,
        depth: far.depth,
        fade: Vec2::ZERO,
    };
    let rows = [texels - bottom - height, texels - bottom];
    Some((region, CascadeCut { columns: [left, left + width], rows }))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCENE: (Vec3, Vec3) = (Vec3::new(-5.0, 0.0, -5.0), Vec3::new(5.0, 3.0, 5.0));

    fn down() -> Mat3 {
        // −Z of the light is −Y of the world.
        Mat3::from_cols(Vec3::X, Vec3::NEG_Z, Vec3::Y)
    }

    #[test]
    fn a_small_scene_is_covered_whole_wherever_the_camera_is() {
        let here = cover(SCENE, down(), Vec3::ZERO, 40.0, 128);
        assert_eq!(here, cover(SCENE, down(), Vec3::splat(4.0), 40.0, 128));
        assert!(here.size.x >= 10.0 && here.size.y >= 10.0 && here.depth > 3.0);
        assert!(here.origin.y > 3.0, "the map looks down from above the scene: {here:?}");
    }

    #[test]
    fn a_large_scene_is_followed_in_steps_of_whole_texels() {
        let large = (Vec3::splat(-1000.0), Vec3::splat(1000.0));
        let a = cover(large, down(), Vec3::new(12.0, 0.0, 12.0), 32.0, 64);
        let b = cover(large, down(), Vec3::new(13.4, 0.0, 11.0), 32.0, 64);
        assert_eq!(a, b, "less than half a step is none");
        let c = cover(large, down(), Vec3::new(15.0, 0.0, 12.0), 32.0, 64);
        assert_eq!((c.origin - a.origin).length(), 4.0);
        assert_eq!(a.size, Vec2::splat(64.0));
        assert_eq!(a.fade, Vec2::splat(FADE), "light fades where the scene goes on");
        let long = (Vec3::new(-1000.0, 0.0, -5.0), Vec3::new(1000.0, 3.0, 5.0));
        assert_eq!(cover(long, down(), Vec3::ZERO, 32.0, 64).fade, Vec2::new(FADE, 0.0));
    }

    #[test]
    fn the_near_cascade_covers_whole_texels_of_the_far_one() {
        let scene = (Vec3::new(-30.0, 0.0, -30.0), Vec3::new(30.0, 3.0, 30.0));
        let texels = 128;
        for camera in [
            Vec3::ZERO,
            Vec3::new(11.0, 1.0, -17.3),
            Vec3::new(29.0, 2.0, 29.0),
            Vec3::splat(-500.0),
        ] {
            let far = cover(scene, down(), camera, 40.0, texels);
            let (near, cut) = near(&far, down(), camera, 40.0, texels).expect("a large scene");
            let texel = far.size / texels as f32;
            for (axis, cut) in [(0, cut.columns), (1, cut.rows)] {
                assert!(
                    cut[1] <= texels && near.size[axis] >= 24.0 && near.size[axis] < 26.0,
                    "{near:?} {cut:?}"
                );
                assert!(((cut[1] - cut[0]) as f32 * texel[axis] - near.size[axis]).abs() < 1e-3);
            }
            // The light's x is the world's, and its y the world's −z: rows count along z.
            let low = near.origin - Vec3::new(0.5 * near.size.x, 0.0, 0.5 * near.size.y);
            let corner = far.origin - Vec3::new(0.5 * far.size.x, 0.0, 0.5 * far.size.y);
            let expected = corner
                + Vec3::new(cut.columns[0] as f32 * texel.x, 0.0, cut.rows[0] as f32 * texel.y);
            assert!(low.abs_diff_eq(expected, 1e-3), "{camera}: {low} {expected}");
            let inside = (camera - near.origin).abs();
            let is_in_scene = camera.abs().max_element() < 30.0;
            assert!(
                !is_in_scene || inside.x <= 0.5 * near.size.x && inside.z <= 0.5 * near.size.y,
                "{camera}: {near:?}"
            );
        }
    }

    #[test]
    fn a_small_scene_has_one_map() {
        let far = cover(SCENE, down(), Vec3::ZERO, 40.0, 128);
        assert_eq!(near(&far, down(), Vec3::ZERO, 40.0, 128), None);
        for (camera, range) in [
            (Vec3::NAN, 40.0),
            (Vec3::ZERO, f32::NAN),
            (Vec3::ZERO, f32::INFINITY),
            (Vec3::ZERO, 0.0),
        ] {
            assert_eq!(near(&far, down(), camera, range, 128), None);
        }
    }

    #[test]
    fn a_mesh_that_fell_out_of_the_world_leaves_maps_their_precision() {
        let fallen = (Vec3::new(-5.0, -1e7, -5.0), SCENE.1);
        for height in [0.0, 1.7, 100.0] {
            let eye = Vec3::new(0.0, height, 0.0);
            let near = cover(fallen, down(), eye, 40.0, 128);
            assert!(
                near.depth < 40_000.0 && near.size == cover(SCENE, down(), eye, 40.0, 128).size
            );
            // From above the scene to below the camera.
            assert!(near.origin.y > 3.0 && near.origin.y - near.depth < -1000.0, "{near:?}");
        }
        let wide = cover(fallen, down(), Vec3::ZERO, 1e5, 128);
        assert!(wide.depth > 2e5, "a long range needs its depth: {wide:?}");
        let all = cover(fallen, down(), Vec3::ZERO, f32::INFINITY, 128);
        assert!(all.depth >= 1e7, "{all:?}");
    }

    #[test]
    fn extreme_input_stays_finite() {
        for camera in [Vec3::NAN, Vec3::INFINITY, Vec3::splat(1e30)] {
            for range in [0.0, -1.0, f32::NAN, f32::INFINITY, 1e-20] {
                let region = cover(SCENE, down(), camera, range, 64);
                assert!(
                    region.size.is_finite() && region.depth.is_finite(),
                    "{camera} {range}: {region:?}"
                );
            }
        }
        let flat = cover((Vec3::ONE, Vec3::ONE), down(), Vec3::ZERO, 40.0, 64);
        assert!(flat.size.min_element() > 0.0 && flat.depth > 0.0);
    }
}
