use bevy::math::{DVec3, Quat};
use proptest::prelude::*;

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
    let map_of = |words: &TriangleWords| u64::from(words.map_high) << 32 | u64::from(words.map_low);
    let maps: Vec<u64> = bvh.triangles.iter().map(map_of).collect();
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

/// Whether the micro-triangle at a point is opaque: the twin of `trace.wgsl`'s.
fn is_opaque(map: u64, [second, third]: [f64; 2]) -> bool {
    let side = f64::from(SIDE);
    let row = ((second * side) as u64).min(7);
    let column = ((third * side) as u64).min(7 - row);
    let turned =
        second * side - row as f64 + third * side - column as f64 > 1.0 && column < 7 - row;
    map >> (row * (16 - row) + 2 * column + u64::from(turned)) & 1 == 1
}

#[test]
fn an_opaque_mask_is_solid_and_a_clear_one_is_all_hole() {
    assert_eq!(micromap(|_| true), SOLID);
    assert_eq!(micromap(|_| false), 0);
}

#[test]
fn each_bit_is_one_micro_triangle() {
    let points: Vec<[f32; 2]> =
        micro_triangles().map(|micro_triangle| micro_triangle([0.3, 0.3])).collect();
    assert_eq!(points.len(), 64);
    for (index, point) in points.iter().enumerate() {
        assert!(point[0] + point[1] < 1.0 && point.iter().all(|weight| *weight > 0.0), "{point:?}");
        for other in 0..64 {
            assert_eq!(
                is_opaque(1 << other, point.map(f64::from)),
                other == index,
                "bit {other} at {point:?}"
            );
        }
    }
    // Corners and edges belong to some micro-triangle.
    for corner in [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.5, 0.5], [0.875, 0.125]] {
        assert!(is_opaque(SOLID, corner) && !is_opaque(0, corner));
    }
}

#[test]
fn fine_holes_keep_their_share() {
    // A wire mesh, ever finer; also aligned with the micro-triangles.
    for repeats in [3.0f32, 8.0, 16.0, 37.0, 64.0] {
        for share in [0.1f32, 0.5, 0.9] {
            let map =
                micromap(|[u, v]| (u * repeats).fract() < share && (v * repeats).fract() >= 0.0);
            let found = map.count_ones() as f32 / 64.0;
            assert!((found - share).abs() < 0.08, "{found} of {share}, repeated {repeats} times");
        }
    }
}

proptest! {
    /// A mask cut by a straight line: only micro-triangles on the line may differ.
    #[test]
    fn coarse_holes_are_at_the_right_positions(angle in 0.0f64..6.3, at in 0.1f64..0.6, u in 0.0f64..1.0, v in 0.0f64..1.0) {
        let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
        let side = |u: f64, v: f64| (u - at) * angle.cos() + (v - 0.5 * at) * angle.sin();
        let map = micromap(|[u, v]| side(f64::from(u), f64::from(v)) > 0.0);
        // Farther from the line than a micro-triangle's longest side.
        if side(u, v).abs() > 0.18 {
            prop_assert_eq!(is_opaque(map, [u, v]), side(u, v) > 0.0);
        }
    }

    #[test]
    fn the_opaque_share_is_kept(share in 0.0f32..1.0, seed in 0u32..1000) {
        let mut state = seed;
        let mut count = 0;
        let map = micromap(|_| {
            state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
            let there = ((state >> 8) as f32) < share * (1 << 24) as f32;
            count += u32::from(there);
            there
        });
        let exact = count as f32 / SAMPLES as f32;
        prop_assert!((map.count_ones() as f32 - exact).abs() <= 0.5, "{} micro-triangles of {exact}", map.count_ones());
    }
}
