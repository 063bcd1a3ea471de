use bevy::math::{DVec3, Quat};
use proptest::prelude::*;

use super::super::micromap::SOLID;
use super::*;

#[test]
fn a_refitted_tree_holds_primitives_where_they_moved() {
    let place = |index: usize, shift: f32| {
        let corner = Vec3A::new((index % 10) as f32, (index / 10) as f32, shift * index as f32);
        (corner, corner + 0.5)
    };
    for count in [1, 2, 5, 100] {
        let before: Vec<_> = (0..count).map(|index| place(index, 0.0)).collect();
        let FlatBvh { mut nodes, order } = FlatBvh::new(&before, Effort::ForLong);
        let in_order = |shift: f32| -> Vec<_> {
            order.iter().map(|index| place(*index as usize, shift)).collect()
        };
        let still = nodes.clone();
        let area = refit(&mut nodes, &in_order(0.0));
        assert_eq!(nodes, still, "nothing moved");
        let grown = refit(&mut nodes, &in_order(0.3));
        assert!(count < 5 || grown > area, "{grown} {area}");
        let inside = |node: &Node, (min, max): (Vec3A, Vec3A)| {
            Vec3A::from(node.min).cmple(min).all() && Vec3A::from(node.max).cmpge(max).all()
        };
        let moved = in_order(0.3);
        for (index, node) in nodes.iter().enumerate() {
            // A node holds the primitives of all leaves up to its skip link.
            for leaf in nodes[index..node.skip as usize].iter().filter(|leaf| leaf.leaf != 0) {
                assert!(leaf.primitives().all(|primitive| inside(node, moved[primitive])));
            }
        }
    }
    assert_eq!(refit(&mut [], &[]), 0.0);
}

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

fn meets_box(node: &Node, origin: DVec3, direction: DVec3) -> bool {
    let (mut near, mut far) = (0.0f64, 1.0f64);
    for axis in 0..3 {
        let inverse = 1.0 / direction[axis];
        let (a, b) = (
            (f64::from(node.min[axis]) - origin[axis]) * inverse,
            (f64::from(node.max[axis]) - origin[axis]) * inverse,
        );
        (near, far) = (near.max(a.min(b)), far.min(a.max(b)));
    }
    near <= far * (1.0 + 1e-9)
}

/// The traversal of `trace/trace.wgsl`.
fn walk(bvh: &MeshBvh, origin: DVec3, direction: DVec3) -> bool {
    let mut at = 0;
    while at < bvh.nodes.len() {
        let node = &bvh.nodes[at];
        if meets_box(node, origin, direction) {
            if node.leaf > 0
                && node.primitives().any(|index| meets(&bvh.triangles[index], origin, direction))
            {
                return true;
            }
            at += 1;
        } else {
            at = node.skip as usize;
        }
    }
    false
}

fn solid(triangles: impl IntoIterator<Item = [Vec3; 3]>) -> MeshBvh {
    MeshBvh::new(triangles.into_iter().map(|triangle| (triangle, SOLID)))
}

fn soup(count: usize, seed: u32) -> Vec<[Vec3; 3]> {
    let mut state = seed | 1;
    let mut random = move || {
        state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
        (state >> 8) as f32 / (1 << 24) as f32
    };
    let mut triangle = || {
        let center = Vec3::new(random(), random(), random()) * 10.0;
        [(); 3].map(|()| center + Vec3::new(random(), random(), random()) * 1.5)
    };
    (0..count).map(|_| triangle()).collect()
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
            assert_eq!(walk(&bvh, from, to - from), expected, "{count} triangles, ray {ray}");
            found += usize::from(expected);
        }
        assert!(
            count < 50 || (20..400).contains(&found),
            "{found} rays of {count} triangles say nothing"
        );
    }
}

#[test]
fn skip_links_lead_forward_and_leaves_name_every_triangle_once() {
    let bvh = FlatBvh::new(
        &soup(777, 5)
            .iter()
            .map(|[a, b, c]| (a.min(*b).min(*c).into(), a.max(*b).max(*c).into()))
            .collect::<Vec<_>>(),
        Effort::ForLong,
    );
    let mut visits = vec![0; 777];
    for (index, node) in bvh.nodes.iter().enumerate() {
        assert!(node.skip as usize > index && node.skip as usize <= bvh.nodes.len());
        assert!(node.leaf == 0 || node.skip as usize == index + 1);
        node.primitives()
            .filter(|_| node.leaf > 0)
            .for_each(|index| visits[bvh.order[index] as usize] += 1);
    }
    assert_eq!(bvh.nodes[0].skip as usize, bvh.nodes.len());
    assert!(visits.iter().all(|count| *count == 1));
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
    assert_eq!(
        bvh.nodes
            .iter()
            .filter(|node| node.leaf > 0)
            .map(|node| node.primitives().len())
            .sum::<usize>(),
        100
    );
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
