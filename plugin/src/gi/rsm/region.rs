//! How much of the world a directional light's map covers.

use bevy::camera::primitives::Aabb;
use bevy::ecs::prelude::*;
use bevy::math::{Mat3, Vec2, Vec3, Vec3A};
use bevy::mesh::Mesh3d;
use bevy::transform::components::GlobalTransform;

/// The box around every mesh of the world.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct SceneBox(pub Option<(Vec3, Vec3)>);

/// Redone only when a mesh appeared, moved or went away.
pub(super) fn update_scene_box(
    mut scene: ResMut<SceneBox>,
    meshes: Query<(&Aabb, &GlobalTransform), With<Mesh3d>>,
    changed: Query<(), (With<Mesh3d>, Or<(Changed<GlobalTransform>, Changed<Aabb>)>)>,
    mut removed: RemovedComponents<Mesh3d>,
) {
    if changed.is_empty() && removed.read().count() == 0 {
        return;
    }
    let mut least = Vec3A::splat(f32::INFINITY);
    let mut most = Vec3A::splat(f32::NEG_INFINITY);
    for (aabb, transform) in &meshes {
        let affine = transform.affine();
        let center = affine.transform_point3a(aabb.center);
        let half = affine.matrix3.abs() * aabb.half_extents;
        if (center + half).is_finite() && (center - half).is_finite() {
            least = least.min(center - half);
            most = most.max(center + half);
        }
    }
    let found = least.cmple(most).all().then(|| (Vec3::from(least), Vec3::from(most)));
    scene.set_if_neq(SceneBox(found));
}

/// A directional light's map in the light's own axes (the light shines along −Z).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LightRegion {
    /// Centre of the near plane, world space.
    pub origin: Vec3,
    /// Size across the rays, metres.
    pub size: Vec2,
    /// Length along the rays, metres.
    pub depth: f32,
}

/// What a map of `texels` × `texels` must cover for a camera at `camera`: the whole scene where it is small, else a square of twice `range`
/// around the camera. Along the rays it always holds the whole scene, since whatever stands in the light shades what is near.
///
/// The region moves in steps of whole texels and grows in steps of an eighth, so that VPLs stay put while the camera or a mesh moves a little.
pub(super) fn cover(scene: (Vec3, Vec3), rotation: Mat3, camera: Vec3, range: f32, texels: u32) -> LightRegion {
    let world_from_light = rotation;
    let light_from_world = rotation.transpose();
    let half = 0.5 * (scene.1 - scene.0);
    let center = light_from_world * (0.5 * (scene.0 + scene.1));
    let spread = Mat3::from_cols(light_from_world.x_axis.abs(), light_from_world.y_axis.abs(), light_from_world.z_axis.abs()) * half;
    let eye = light_from_world * camera;
    let range = if range.is_finite() && range > 0.0 { range } else { f32::MAX };

    let axis = |center: f32, spread: f32, eye: f32| -> (f32, f32) {
        if spread <= range || !eye.is_finite() {
            let step = power_of_two_above(spread.max(1e-3)) / 8.0;
            let low = ((center - spread) / step).floor() * step;
            let high = ((center + spread) / step).ceil() * step;
            (0.5 * (low + high), (high - low).max(step))
        } else {
            let size = 2.0 * range;
            let texel = size / texels as f32;
            ((eye / texel).round() * texel, size)
        }
    };
    let (x, width) = axis(center.x, spread.x, eye.x);
    let (y, height) = axis(center.y, spread.y, eye.y);
    let margin = 0.01 * spread.z + 0.01;
    let near = center.z + spread.z + margin;
    LightRegion { origin: world_from_light * Vec3::new(x, y, near), size: Vec2::new(width, height), depth: 2.0 * (spread.z + margin) }
}

fn power_of_two_above(value: f32) -> f32 {
    value.log2().ceil().exp2()
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
    fn a_large_scene_is_followed_in_whole_texels() {
        let large = (Vec3::splat(-1000.0), Vec3::splat(1000.0));
        let a = cover(large, down(), Vec3::new(10.0, 0.0, 10.0), 32.0, 64);
        let b = cover(large, down(), Vec3::new(10.4, 0.0, 10.4), 32.0, 64);
        assert_eq!(a, b, "less than half a texel is no step");
        let c = cover(large, down(), Vec3::new(11.0, 0.0, 10.0), 32.0, 64);
        assert_eq!((c.origin - a.origin).length(), 1.0);
        assert_eq!(a.size, Vec2::splat(64.0));
    }

    #[test]
    fn hostile_input_stays_finite() {
        for camera in [Vec3::NAN, Vec3::INFINITY, Vec3::splat(1e30)] {
            for range in [0.0, -1.0, f32::NAN, f32::INFINITY, 1e-20] {
                let region = cover(SCENE, down(), camera, range, 64);
                assert!(region.size.is_finite() && region.depth.is_finite(), "{camera} {range}: {region:?}");
            }
        }
        let flat = cover((Vec3::ONE, Vec3::ONE), down(), Vec3::ZERO, 40.0, 64);
        assert!(flat.size.min_element() > 0.0 && flat.depth > 0.0);
    }
}
