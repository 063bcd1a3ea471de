use super::*;
use crate::scene::SceneMesh;
use crate::scene::testing::MeshBuilder;

fn scene(build: impl FnOnce(&mut MeshBuilder)) -> RayScene {
    let mut builder = MeshBuilder::new();
    build(&mut builder);
    RayScene::from_geometry(&SceneGeometry {
        meshes: vec![builder.finish(0)],
        ..SceneGeometry::default()
    })
}

fn triangle(corners: [Vec3; 3]) -> Triangle {
    Triangle { corners, mesh: 0, index: 0 }
}

#[test]
fn closest_hit_has_the_right_distance_side_and_weights() {
    let scene = scene(|builder| builder.cuboid(Vec3::splat(-1.0), Vec3::ONE));
    let hit = scene.closest(Vec3::new(0.25, 0.5, 5.0), Vec3::NEG_Z, f32::INFINITY).unwrap();
    assert_eq!((hit.distance, hit.side), (4.0, Side::Front));
    let point: Vec3 =
        hit.triangle.corners.iter().zip(hit.weights).map(|(corner, weight)| *corner * weight).sum();
    assert!(point.distance(Vec3::new(0.25, 0.5, 1.0)) < 1e-6, "{point}");
    let hit = scene.closest(Vec3::ZERO, Vec3::X, f32::INFINITY).unwrap();
    assert_eq!((hit.distance, hit.side), (1.0, Side::Back));
    // Distances are in lengths of the direction.
    assert_eq!(scene.closest(Vec3::X * 5.0, Vec3::X * -2.0, f32::INFINITY).unwrap().distance, 2.0);
    for zero in [0.0, -0.0] {
        assert!(
            scene.any(Vec3::X * 5.0, Vec3::new(-1.0, zero, zero), 9.0)
                && scene.any(Vec3::Y * -5.0, Vec3::new(zero, 1.0, zero), 9.0)
        );
    }
    assert_eq!(scene.closest(Vec3::X * 5.0, Vec3::NEG_X, 3.9), None);
    assert!(
        scene.any(Vec3::X * 5.0, Vec3::NEG_X, 4.1) && !scene.any(Vec3::X * 5.0, Vec3::NEG_X, 3.9)
    );
    assert!(!scene.any(Vec3::X * 5.0, Vec3::X, f32::INFINITY));
}

#[test]
fn the_tree_agrees_with_trying_every_triangle() {
    let mut builder = MeshBuilder::new();
    builder.icosphere(Vec3::ZERO, 2.0, 3, false);
    builder.cuboid(Vec3::new(-4.0, -1.0, -1.0), Vec3::new(-2.5, 1.0, 1.0));
    let geometry = SceneGeometry { meshes: vec![builder.finish(0)], ..SceneGeometry::default() };
    let tree = RayScene::from_geometry(&geometry);
    let single: Vec<RayScene> =
        geometry.triangles().map(|triangle| RayScene::new([triangle])).collect();
    for (i, direction) in sphere_directions(200).enumerate() {
        let origin = Vec3::new(-3.0 + i as f32 * 0.03, (i % 7) as f32 - 3.0, (i % 5) as f32 - 2.0);
        let least = single
            .iter()
            .filter_map(|one| one.closest(origin, direction, f32::INFINITY))
            .map(|hit| hit.distance)
            .min_by(f32::total_cmp);
        assert_eq!(
            tree.closest(origin, direction, f32::INFINITY).map(|hit| hit.distance),
            least,
            "ray {i}"
        );
        assert_eq!(tree.any(origin, direction, f32::INFINITY), least.is_some(), "ray {i}");
    }
}

#[test]
fn rays_pass_through_hits_that_a_filter_rejects() {
    let scene = scene(|builder| builder.cuboid(Vec3::splat(-1.0), Vec3::ONE));
    let (origin, direction) = (Vec3::new(0.25, 0.5, 5.0), Vec3::NEG_Z);
    let back = scene
        .closest_where(origin, direction, f32::INFINITY, |hit| hit.side == Side::Back)
        .unwrap();
    assert_eq!((back.distance, back.side), (6.0, Side::Back));
    assert_eq!(scene.closest_where(origin, direction, 5.9, |hit| hit.side == Side::Back), None);
    assert!(scene.any_where(origin, direction, 6.1, |hit| hit.side == Side::Back));
    assert!(!scene.any_where(origin, direction, 5.9, |hit| hit.side == Side::Back));
    assert_eq!(scene.closest_where(origin, direction, f32::INFINITY, |_| false), None);
    // The filter receives the hit that would be returned.
    let shown = scene.closest_where(origin, direction, f32::INFINITY, |hit| {
        let point: Vec3 = hit
            .triangle
            .corners
            .iter()
            .zip(hit.weights)
            .map(|(corner, weight)| *corner * weight)
            .sum();
        point.distance(origin + direction * hit.distance) < 1e-5
    });
    assert_eq!(shown, scene.closest(origin, direction, f32::INFINITY));
}

#[test]
fn walls_stop_rays_however_near_and_small_they_are() {
    // In scenes from a tenth of a millimetre to a thousand kilometres. Nearer than a millionth of
    // the size, rounding in the tree's boxes lets rays through.
    for size in [1e-4_f32, 1.0, 100.0, 1e6] {
        let scene = scene(|builder| builder.room(Vec3::splat(-size), Vec3::splat(size)));
        for gap in [size * 1e-5, size * 1e-4, size * 1e-3] {
            for direction in sphere_directions(200) {
                let hit = scene.closest(
                    Vec3::new(0.3 * size, 0.2 * size, size - gap),
                    direction,
                    f32::INFINITY,
                );
                assert!(
                    hit.is_some_and(|hit| hit.side == Side::Front),
                    "{direction} in {size} m, {gap} m from the wall"
                );
            }
        }
    }
}

#[test]
fn a_closed_sphere_has_no_holes() {
    let scene = scene(|builder| builder.icosphere(Vec3::ZERO, 2.0, 3, true));
    for direction in sphere_directions(20_000) {
        assert!(
            scene
                .closest(Vec3::new(0.1, 0.2, -0.3), direction, f32::INFINITY)
                .is_some_and(|hit| hit.side == Side::Front)
        );
    }
    // At the vertices and along the edges, too.
    let corners: Vec<Vec3> = scene.triangles.iter().flat_map(|triangle| triangle.corners).collect();
    for pair in corners.chunks_exact(3) {
        for target in [pair[0], (pair[0] + pair[1]) * 0.5] {
            assert!(scene.any(Vec3::ZERO, target, f32::INFINITY), "{target}");
        }
    }
}

#[test]
fn invalid_triangles_and_rays_are_skipped() {
    let nan = Vec3::splat(f32::NAN);
    let scene = RayScene::new([
        triangle([Vec3::ZERO; 3]),
        triangle([Vec3::ZERO, Vec3::X, Vec3::X * 2.0]),
        triangle([nan, Vec3::X, Vec3::Y]),
        triangle([Vec3::splat(f32::INFINITY), Vec3::X, Vec3::Y]),
        triangle([Vec3::splat(f32::MAX), Vec3::splat(f32::MIN), Vec3::Y]),
        triangle([Vec3::ZERO, Vec3::X, Vec3::Y]),
    ]);
    assert_eq!(scene.triangle_count(), 1);
    let origin = Vec3::new(0.2, 0.2, 1.0);
    assert!(scene.any(origin, Vec3::NEG_Z, f32::INFINITY));
    for (origin, direction, reach) in [
        (nan, Vec3::NEG_Z, f32::INFINITY),
        (origin, nan, f32::INFINITY),
        (origin, Vec3::ZERO, f32::INFINITY),
        (origin, Vec3::NEG_Z, f32::NAN),
        (origin, Vec3::NEG_Z, -1.0),
        (Vec3::splat(f32::MAX), Vec3::NEG_Z, f32::INFINITY),
        (origin, Vec3::splat(f32::MAX), f32::INFINITY),
    ] {
        assert_eq!(scene.closest(origin, direction, reach), None);
        assert!(!scene.any(origin, direction, reach));
    }
    // A ray in the triangle's own plane hits nothing.
    assert!(!scene.any(Vec3::new(-1.0, 0.2, 0.0), Vec3::X, f32::INFINITY));
    assert!(!scene.inside_geometry(nan) && !scene.sees_geometry(nan, Quat::IDENTITY, 1.0, 1.0));
}

#[test]
fn an_empty_scene_has_nothing_to_see_and_no_inside() {
    let scene = RayScene::new([]);
    assert!(!scene.any(Vec3::ZERO, Vec3::X, f32::INFINITY));
    assert!(!scene.inside_geometry(Vec3::ZERO));
    assert!(!scene.sees_geometry(Vec3::ZERO, Quat::IDENTITY, 1.0, 1.5));
}

#[test]
fn inside_a_solid_is_told_from_rooms_and_outdoors() {
    let solid = scene(|builder| builder.cuboid(Vec3::splat(-1.0), Vec3::ONE));
    assert!(solid.inside_geometry(Vec3::ZERO));
    assert!(solid.inside_geometry(Vec3::new(0.99, -0.98, 0.97)));
    assert!(!solid.inside_geometry(Vec3::X * 1.01));
    assert!(!solid.inside_geometry(Vec3::Y * 50.0));
    let room = scene(|builder| builder.room(Vec3::splat(-3.0), Vec3::splat(3.0)));
    for position in [Vec3::ZERO, Vec3::splat(2.99), Vec3::new(0.0, -2.99, 0.0)] {
        assert!(!room.inside_geometry(position));
    }
    // Walls that are solids, as in levels: inside the wall, and inside the room.
    let walled = scene(|builder| {
        builder.cuboid(Vec3::splat(-4.0), Vec3::splat(4.0));
        builder.room(Vec3::splat(-3.0), Vec3::splat(3.0));
        builder.cuboid(Vec3::new(1.0, -3.0, 1.0), Vec3::new(2.0, -1.0, 2.0));
    });
    assert!(
        walled.inside_geometry(Vec3::X * -3.5) && walled.inside_geometry(Vec3::new(1.5, -2.0, 1.5))
    );
    assert!(!walled.inside_geometry(Vec3::ZERO) && !walled.inside_geometry(Vec3::X * 4.5));
}

#[test]
fn a_drape_has_no_inside() {
    let drape = |builder: &mut MeshBuilder| {
        builder
            .sheet(12, 8, |s, t| Vec3::new(s * 4.0 - 2.0, t * 4.0 - 2.0, 0.1 * (s * 12.0).sin()));
    };
    let outdoors = scene(drape);
    let indoors = scene(|builder| {
        drape(builder);
        builder.room(Vec3::splat(-5.0), Vec3::splat(5.0));
    });
    for distance in [-2.0, -0.3, -0.12, 0.12, 0.3, 2.0] {
        for x in [-1.5, -0.4, 0.0, 0.9] {
            let position = Vec3::new(x, 0.3, distance);
            assert!(
                !outdoors.inside_geometry(position) && !indoors.inside_geometry(position),
                "{position}"
            );
        }
    }
}

#[test]
fn a_camera_sees_geometry_in_front_of_it() {
    let scene = scene(|builder| builder.cuboid(Vec3::splat(-1.0), Vec3::ONE));
    let back = Vec3::Z * 5.0;
    let turned = |angle: f32| Quat::from_rotation_y(angle.to_radians());
    assert!(scene.sees_geometry(back, Quat::IDENTITY, 1.0, 1.5));
    assert!(!scene.sees_geometry(back, turned(180.0), 1.0, 1.5));
    // The image is about 79° wide and the box reaches 14° to the side.
    assert!(scene.sees_geometry(back, turned(48.0), 1.0, 1.5));
    assert!(!scene.sees_geometry(back, turned(58.0), 1.0, 1.5));
    assert!(!scene.sees_geometry(back, turned(48.0), 1.0, 0.5));
    // From inside it sees back faces.
    assert!(scene.sees_geometry(Vec3::ZERO, Quat::IDENTITY, 1.0, 1.5));
}

#[test]
fn broken_meshes_do_not_panic() {
    let mesh =
        SceneMesh { positions: vec![Vec3::ZERO], indices: vec![0, 7, 9], ..SceneMesh::default() };
    assert_eq!(
        RayScene::from_geometry(&SceneGeometry { meshes: vec![mesh], ..SceneGeometry::default() })
            .triangle_count(),
        0
    );
}
