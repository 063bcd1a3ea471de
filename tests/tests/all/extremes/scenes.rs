//! Scenes with errors: degenerate triangles and normals, lights that hit nothing, lights inside
//! walls.

use bevy::asset::RenderAssetUsages;
use bevy::light::PointLight;
use bevy::math::Vec3;
use bevy::mesh::{Indices, Mesh, PrimitiveTopology};
use bevy::transform::components::Transform;
use frugal::stage::{Component, Stage};
use frugal_tests::{gpu, meshes, set};
use frugal_trace::light::Light;
use frugal_trace::metrics::Radiance;

use crate::gi::{PLAIN, corner, sun};

tests!(
    degenerate_triangles_change_nothing,
    invalid_normals_have_local_effects_only,
    a_light_that_hits_nothing_adds_no_flux,
    a_light_in_a_wall_shines_through_it_as_its_shadow_map_does,
);

/// Asserts that the image, its RSM texels and its VPLs are finite and not negative.
fn assert_finite(stage: &Stage, radiance: &Radiance) {
    assert!(
        radiance.rgb.iter().flatten().all(|value| value.is_finite() && *value >= 0.0),
        "a pixel is not finite"
    );
    for point in gpu::rsm_texels(stage).iter().chain(&gpu::vpls(stage)) {
        let numbers =
            point.position.iter().chain(&point.normal).chain(&point.flux).chain([&point.extent]);
        assert!(
            numbers.copied().all(f32::is_finite)
                && point.flux.iter().all(|flux| *flux >= 0.0)
                && point.extent >= 0.0,
            "{point:?}"
        );
        assert!((Vec3::from_array(point.normal).length() - 1.0).abs() < 1e-3, "{point:?}");
    }
}

fn mesh(positions: Vec<[f32; 3]>, normal: [f32; 3]) -> Mesh {
    let count = positions.len();
    Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::all())
        .with_inserted_attribute(Mesh::ATTRIBUTE_NORMAL, vec![normal; count])
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, positions)
        .with_inserted_indices(Indices::U32((0..count as u32).collect()))
}

fn degenerate_triangles_change_nothing() {
    let mut stage = corner(vec![sun(Vec3::NEG_Y)]);
    let settings = format!("{PLAIN},gi_visibility=coarse");
    set::apply(&mut stage, &settings);
    let expected = set::radiance(&mut stage);
    let (a, b) = ([0.5, 0.6, 0.3], [-0.9, 1.2, -0.7]);
    let lists = [
        ("points", vec![a, a, a, b, b, b]),
        ("lines", vec![a, b, b, a, b, a]),
        ("nothing", vec![]),
        ("half a triangle", vec![a, b]),
        ("too small for a float's square", vec![a, [0.5 + 1e-7, 0.6, 0.3], [0.5, 0.6 + 1e-7, 0.3]]),
    ];
    for (label, list) in lists {
        let entity = meshes::spawn(
            &mut stage,
            mesh(list, [0.0, 1.0, 0.0]),
            meshes::diffuse(0.9, 0.9, 0.9),
            Transform::default(),
        );
        let found = set::radiance(&mut stage);
        assert_finite(&stage, &found);
        assert!(found == expected, "{label}");
        stage.world_mut().despawn(entity);
    }
    // Vertices that are not finite, and one so far away that its square is not. The driver decides
    // how to draw such a triangle; the effect must not spread.
    for broken in [f32::NAN, f32::INFINITY, 1e30] {
        let list = vec![a, b, [broken, 1.0, 0.0]];
        let entity = meshes::spawn(
            &mut stage,
            mesh(list, [0.0, 1.0, 0.0]),
            meshes::diffuse(0.9, 0.9, 0.9),
            Transform::default(),
        );
        let found = set::radiance(&mut stage);
        assert_finite(&stage, &found);
        println!(
            "    a corner at {broken}: {:.3} nits, {:.3} without",
            found.mean(),
            expected.mean()
        );
        stage.world_mut().despawn(entity);
        assert!(set::radiance(&mut stage) == expected, "no trace after its removal");
    }
}

fn invalid_normals_have_local_effects_only() {
    let mut stage = corner(vec![sun(Vec3::NEG_Y)]);
    let expected = set::radiance(&mut stage);
    for normal in
        [[0.0; 3], [f32::NAN; 3], [f32::INFINITY, 0.0, 0.0], [1e-30, 0.0, 0.0], [0.0, 1e30, 0.0]]
    {
        // One square metre in the middle of the floor.
        let (low, high, y) = (-0.5, 0.5, 0.02);
        let square = vec![
            [low, y, low],
            [low, y, high],
            [high, y, low],
            [high, y, low],
            [low, y, high],
            [high, y, high],
        ];
        let entity = meshes::spawn(
            &mut stage,
            mesh(square, normal),
            meshes::diffuse(0.8, 0.8, 0.8),
            Transform::default(),
        );
        let found = set::radiance(&mut stage);
        assert_finite(&stage, &found);
        // It is a sixteenth of the floor, and far from everything in view.
        let share = found.mean() / expected.mean();
        println!("    normals {normal:?}: {share:.3} of the light without");
        assert!((0.8..1.2).contains(&share), "{normal:?}: {share}");
        stage.world_mut().despawn(entity);
    }
}

fn a_light_that_hits_nothing_adds_no_flux() {
    let up = Light::Spot {
        position: Vec3::new(0.0, 3.0, 0.0),
        direction: Vec3::Y,
        luminous_power: 1e5,
        range: 30.0,
        inner_angle: 20.0,
        outer_angle: 30.0,
        color: [1.0; 3],
    };
    let mut stage = corner(vec![up]);
    set::apply(&mut stage, &format!("{PLAIN},gi_visibility=coarse"));
    let found = set::radiance(&mut stage);
    assert_finite(&stage, &found);
    assert_eq!(found.mean(), 0.0);
    assert!(!gpu::rsm_texels(&stage).is_empty() && gpu::total_flux(&gpu::vpls(&stage)) == [0.0; 3]);
    // Next to a light that hits something, it only changes the positions of the sampled VPLs.
    let mut alone = corner(vec![sun(Vec3::NEG_Y)]);
    let alone = set::radiance(&mut alone);
    stage.world_mut().spawn((
        bevy::light::DirectionalLight { illuminance: 10_000.0, ..Default::default() },
        Transform::default().looking_to(Vec3::NEG_Y, Vec3::X),
    ));
    set::apply(&mut stage, PLAIN);
    let beside = set::radiance(&mut stage).mean();
    println!("    {beside:.3} nits next to a light that hits nothing, {:.3} alone", alone.mean());
    assert!((beside / alone.mean() - 1.0).abs() < 0.03, "{beside} {}", alone.mean());
}

/// Bevy culls the back faces of single-sided surfaces, also in shadow maps: for a light inside a
/// wall, the wall does not exist.
fn a_light_in_a_wall_shines_through_it_as_its_shadow_map_does() {
    let wall = |stage: &mut Stage| {
        meshes::spawn_box(
            stage,
            Vec3::new(0.0, 1.0, 0.5),
            Vec3::new(0.6, 0.6, 0.6),
            meshes::diffuse(0.0, 0.0, 0.0),
        )
    };
    let spawn_light = |stage: &mut Stage, position: Vec3| {
        let light = PointLight {
            intensity: 20_000.0,
            range: 20.0,
            shadow_maps_enabled: true,
            ..Default::default()
        };
        stage.world_mut().spawn((light, Transform::from_translation(position))).id()
    };
    let lights = |component: Component| {
        let mut stage = set::bare(vec![], set::radiance_options(48, 27, component));
        meshes::spawn_corner(&mut stage, 0.5);
        // The wall and the floor before it, past the box.
        set::look(&mut stage, Vec3::new(1.6, 1.2, 1.0), Vec3::new(-0.5, 0.3, -2.0));
        set::apply(&mut stage, PLAIN);
        let mut found = Vec::new();
        for position in
            [Vec3::new(0.0, 1.0, 0.5), Vec3::new(0.0, 1.0, 0.2), Vec3::new(0.0, 1.0, 0.2 + 1e-6)]
        {
            let light = spawn_light(&mut stage, position);
            let open = set::radiance(&mut stage);
            let around = wall(&mut stage);
            let walled = set::radiance(&mut stage);
            if component == Component::Indirect {
                assert_finite(&stage, &walled);
            }
            found.push((position, walled.mean() / open.mean()));
            stage.world_mut().despawn(around);
            stage.world_mut().despawn(light);
        }
        found
    };
    for ((position, indirect), (_, direct)) in
        lights(Component::Indirect).into_iter().zip(lights(Component::Direct))
    {
        println!(
            "    a light at {position} in a box: {direct:.3} of its direct light is left, {indirect:.3} of its indirect light"
        );
        // The box itself is black, and covers a small part of the image.
        assert!(
            direct > 0.7 && (indirect / direct - 1.0).abs() < 0.25,
            "{position}: {direct} {indirect}"
        );
    }
}
