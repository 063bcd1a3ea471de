use bevy::math::{DVec3, Quat};
use proptest::prelude::*;

use super::super::micromap::SOLID;
use super::super::wide::{MAX_LEVELS, below, soup, walk};
use super::*;

fn dvec(v: [f32; 3]) -> DVec3 {
    DVec3::new(f64::from(v[0]), f64::from(v[1]), f64::from(v[2]))
}

/// Whether the segment from `origin` to `origin + direction` intersects the triangle.
fn meets(triangle: &TriangleWords, origin: DVec3, direction: DVec3) -> bool {
    let [a, ab, ac] = [triangle.corner, triangle.edge_1, triangle.edge_2].map(dvec);
    let p = direction.cross(ac);
    let determinant = ab.dot(p);
    let offset = origin - a;
    let (u, q) = (offset.dot(p) / determinant, offset.cross(ab));
    let (v, t) = (direction.dot(q) / determinant, ac.dot(q) / determinant);
    u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0 && t < 1.0
}

fn solid(triangles: impl IntoIterator<Item = [Vec3; 3]>) -> MeshBvh {
    MeshBvh::new(triangles.into_iter().map(|triangle| (triangle, SOLID)))
}

/// Whether the traversal finds it.
fn found_by_walk(bvh: &MeshBvh, origin: DVec3, direction: DVec3) -> bool {
    let mut is_met = |index: usize| meets(&bvh.triangles[index], origin, direction);
    let walk = walk(&bvh.nodes, origin.as_vec3(), direction.as_vec3(), &mut is_met);
    assert!(walk.deepest < MAX_LEVELS as usize, "{} entries", walk.deepest);
    walk.found.is_some()
}

#[test]
fn traversal_agrees_with_brute_force() {
    for count in [1, 2, 3, 7, 50, 1000] {
        let bvh = solid(soup(count, count as u32));
        assert_eq!(bvh.triangles.len(), count);
        let mut found = 0;
        for ray in 0..400u32 {
            let part =
                |shift: u32| f64::from(ray.wrapping_mul(2_654_435_761) >> shift & 255) / 25.6;
            let (from, to) =
                (DVec3::new(part(0), part(8), part(16)), DVec3::new(part(20), part(4), part(12)));
            let expected = bvh.triangles.iter().any(|triangle| meets(triangle, from, to - from));
            assert_eq!(
                found_by_walk(&bvh, from, to - from),
                expected,
                "{count} triangles, ray {ray}"
            );
            found += usize::from(expected);
        }
        assert!(
            count < 50 || (20..400).contains(&found),
            "{found} rays of {count} triangles say nothing"
        );
    }
}

#[test]
fn degenerate_triangles_are_left_out() {
    let good = [Vec3::ZERO, Vec3::X, Vec3::Y];
    let bad = [
        [Vec3::ZERO; 3],
        [Vec3::ZERO, Vec3::X, Vec3::X * 2.0],
        [Vec3::NAN, Vec3::X, Vec3::Y],
        [Vec3::INFINITY, Vec3::X, Vec3::Y],
        [Vec3::splat(1e20), Vec3::X, Vec3::Y],
    ];
    assert_eq!(solid(bad), MeshBvh::default());
    assert_eq!(solid(bad.into_iter().chain([good])).triangles.len(), 1);
    // Small is not degenerate.
    assert_eq!(solid([good.map(|corner| corner * 1e-15)]).triangles.len(), 1);
    assert_eq!(MeshBvh::default().bounds(&Affine3A::IDENTITY), None);
}

#[test]
fn a_triangle_that_is_all_hole_is_left_out_and_others_keep_their_holes() {
    let triangle = [Vec3::ZERO, Vec3::X, Vec3::Y];
    let map = 0x0123_4567_89ab_cdef;
    let bvh = MeshBvh::new([(triangle, 0), (triangle, map), (triangle, SOLID)]);
    let maps: Vec<u64> = bvh.triangles.iter().map(TriangleWords::map).collect();
    assert!(maps.len() == 2 && maps.contains(&map) && maps.contains(&SOLID), "{maps:x?}");
    assert_eq!(MeshBvh::new([(triangle, 0)]), MeshBvh::default());
}

#[test]
fn coincident_triangles_are_split_among_leaves() {
    let bvh = solid([[Vec3::ZERO, Vec3::X, Vec3::Y]; 100]);
    assert_eq!(bvh.triangles.len(), 100);
    let mut found = below(&bvh.nodes, 0);
    found.sort_unstable();
    assert_eq!(found, (0..100).collect::<Vec<_>>());
}

proptest! {
    #[test]
    fn a_moved_tree_s_box_holds_its_corners(seed in 1u32.., angle in -3.0f32..3.0, scale in 0.01f32..100.0) {
        let triangles = soup(20, seed);
        let affine = Affine3A::from_scale_rotation_translation(Vec3::splat(scale), Quat::from_rotation_y(angle), Vec3::new(1.0, -2.0, 3.0));
        let (min, max) = solid(triangles.clone()).bounds(&affine).unwrap();
        let slack = Vec3A::splat(1e-4 * (1.0 + scale * 10.0));
        for corner in triangles.iter().flatten() {
            let moved = affine.transform_point3a((*corner).into());
            prop_assert!(moved.cmpge(min - slack).all() && moved.cmple(max + slack).all());
        }
    }
}
