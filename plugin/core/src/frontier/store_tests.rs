//! Tests of the look-up.

use glam::Quat;
use proptest::prelude::*;

use super::*;
use crate::testing;

fn view(position: Vec3, direction: ViewDirection) -> CameraView {
    CameraView { position, rotation: direction.rotation(), vertical_fov: 1.0, aspect: 16.0 / 9.0 }
}

#[test]
fn the_nearest_corner_and_the_view_straight_ahead_are_found() {
    let map = testing::map(1);
    for direction in ViewDirection::ALL {
        let sample = map.look_up(&view(Vec3::new(-3.9, 0.1, 2.5), direction)).expect("a sample");
        assert_eq!(sample.camera.position, Vec3::new(-4.0, 0.0, 4.0));
        assert_eq!(sample.camera.direction, direction);
        assert_eq!(map.octree.corners[sample.camera.corner as usize].at, [0, 1, 2]);
        // The test map's frontiers start at one watt plus their view's index.
        assert_eq!(sample.frontier.points()[0].cost.power.0, 1.0 + direction.index() as f64);
    }
}

#[test]
fn outside_the_bounds_the_nearest_position_inside_is_used() {
    let map = testing::map(2);
    for (outside, inside) in [
        (Vec3::new(100.0, 0.0, 0.3), Vec3::new(4.0, 0.0, 0.3)),
        (Vec3::new(f32::INFINITY, f32::NEG_INFINITY, 1e30), Vec3::new(4.0, -2.0, 4.0)),
        (Vec3::NAN, Vec3::new(-4.0, -2.0, -4.0)),
    ] {
        let direction = ViewDirection::NegativeZ;
        assert_eq!(map.look_up(&view(outside, direction)), map.look_up(&view(inside, direction)));
    }
}

#[test]
fn an_empty_frontier_counts_as_none() {
    let mut map = testing::map(0);
    let camera = view(Vec3::new(-3.0, -1.8, -3.5), ViewDirection::NegativeZ);
    let sample = map.look_up(&camera).expect("a sample");
    assert_eq!(sample.camera.position, Vec3::new(-4.0, -2.0, -4.0));
    let index = map.octree.corners[0].frontiers[ViewDirection::NegativeZ.index()];
    map.octree.frontiers[index as usize] = Frontier::default();
    assert_eq!(map.look_up(&camera), None);
}

#[test]
fn invalid_maps_are_read_without_panic() {
    let camera = view(Vec3::ZERO, ViewDirection::PositiveY);
    let mut map = testing::map(2);
    map.octree.nodes = vec![1; 9];
    let _ = map.look_up(&camera);
    map.octree.corners.iter_mut().for_each(|corner| corner.frontiers = [u32::MAX - 1; 6]);
    assert_eq!(map.look_up(&camera), None);
    map.octree.levels = 255;
    map.octree.corners.clear();
    assert_eq!(map.look_up(&camera), None);
    map.octree.nodes.clear();
    assert_eq!(map.look_up(&camera), None);
}

proptest! {
    #[test]
    fn any_view_finds_a_sample_deterministically(
        position in prop::array::uniform3(prop::num::f32::ANY),
        rotation in prop::array::uniform4(prop::num::f32::ANY),
        vertical_fov in prop::num::f32::ANY,
        aspect in prop::num::f32::ANY,
    ) {
        let map = testing::map(3);
        let camera = CameraView { position: Vec3::from_array(position), rotation: Quat::from_array(rotation), vertical_fov, aspect };
        let sample = map.look_up(&camera);
        prop_assert!(sample.is_some_and(|sample| sample.camera.position.is_finite()));
        let copy = map.clone();
        prop_assert_eq!(sample, copy.look_up(&camera));
    }

    #[test]
    fn no_corner_of_the_leaf_is_nearer(position in prop::array::uniform3(-2.0_f32..2.0)) {
        let map = testing::map(3);
        let position = Vec3::from_array(position);
        let sample = map.look_up(&view(position, ViewDirection::PositiveX)).expect("a sample");
        let leaf = map.octree.leaf_at(map.bounds.to_unit(position));
        for at in testing::corners_of(leaf) {
            let corner = map.bounds.from_unit(Vec3::from_array(at.map(f32::from)) / 8.0);
            prop_assert!(sample.camera.position.distance(position) <= corner.distance(position) + 1e-5);
        }
    }
}
