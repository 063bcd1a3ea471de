//! Nothing is recomputed without a change, and changes take effect at once.

use bevy::camera::visibility::NoFrustumCulling;
use bevy::ecs::query::With;
use bevy::light::DirectionalLight;
use bevy::math::{Quat, Vec3};
use bevy::mesh::morph::{MeshMorphWeights, MorphAttributes, MorphWeights};
use bevy::transform::components::Transform;
use bevy_frugal_gi::gi::GiRefresh;
use frugal::stage::Stage;
use frugal_tests::{meshes, set};

use super::gi::{corner, sun};

tests!(
    nothing_is_recomputed_in_a_still_scene,
    changes_are_in_the_next_frame,
    weights_of_morphs_that_another_entity_holds_wake_the_maps,
    a_walk_through_a_still_scene_renders_no_map,
    the_refresh_period_limits_how_often_maps_are_rendered,
);

/// A corner under the sun, after it has converged.
fn at_rest(policy: GiRefresh) -> Stage {
    let mut stage = corner(vec![sun(Vec3::new(-0.3, -1.0, -0.2))]);
    // These tests examine the gathered light, without temporal accumulation.
    set::disable_history(&mut stage);
    stage.world_mut().insert_resource(policy);
    set::radiance(&mut stage);
    (0..16).for_each(|_| stage.frame());
    stage
}

fn nothing_is_recomputed_in_a_still_scene() {
    let mut stage = at_rest(GiRefresh::OnChange);
    let before = stage.radiance().expect("an image");
    assert!(before.mean() > 1.0);
    for frame in 0..30 {
        stage.frame();
        let done = set::gathered(&stage);
        assert_eq!((done.maps, done.cameras, done.pairs, done.rays), (0, 0, 0, 0), "frame {frame}");
        assert!(done.bytes > 0, "the gathered light is kept");
    }
    assert!(stage.radiance().expect("an image") == before);

    let mut stage = at_rest(GiRefresh::EveryFrame);
    stage.frame();
    let done = set::gathered(&stage);
    assert!((done.maps, done.cameras) == (1, 1) && done.pairs > 0, "{done:?}");
    assert!(stage.radiance().expect("an image") == before, "recomputed, it is the same");
}

/// Rotates the only sun by `angle` radians.
pub(crate) fn turn_the_sun(stage: &mut Stage, angle: f32) {
    let world = stage.world_mut();
    world
        .query_filtered::<&mut Transform, With<DirectionalLight>>()
        .single_mut(world)
        .expect("the sun")
        .rotation *= Quat::from_rotation_x(angle);
}

/// Whether the image after one frame equals that after several frames that recompute everything.
pub(crate) fn converges_in_one_frame(stage: &mut Stage, change: &str) -> bool {
    stage.frame();
    let after_one_frame = stage.radiance().expect("an image");
    assert_eq!(set::gathered(stage).cameras, 1, "{change}");
    stage.world_mut().insert_resource(GiRefresh::EveryFrame);
    (0..3).for_each(|_| stage.frame());
    let converged = stage.radiance().expect("an image");
    stage.world_mut().insert_resource(GiRefresh::OnChange);
    (0..16).for_each(|_| stage.frame());
    assert_eq!(set::gathered(stage).cameras, 0, "converged again");
    after_one_frame == converged
}

fn changes_are_in_the_next_frame() {
    let mut stage = at_rest(GiRefresh::OnChange);
    // Inside the bounds of all meshes, which the map covers completely.
    let mesh = meshes::spawn_box(
        &mut stage,
        Vec3::new(0.5, 0.5, 0.0),
        Vec3::splat(0.4),
        meshes::diffuse(0.8, 0.2, 0.2),
    );
    (0..16).for_each(|_| stage.frame());
    let mut before = stage.radiance().expect("an image");
    let mut changes = |stage: &mut Stage, change: &str| {
        assert!(converges_in_one_frame(stage, change), "{change}");
        let now = stage.radiance().expect("an image");
        assert!(now != before, "{change} changed nothing");
        before = now;
    };
    turn_the_sun(&mut stage, 0.2);
    changes(&mut stage, "a light that turns");

    let world = stage.world_mut();
    world.query::<&mut DirectionalLight>().single_mut(world).expect("the sun").illuminance *= 0.5;
    changes(&mut stage, "a light that fades");

    stage.world_mut().get_mut::<Transform>(mesh).expect("a transform").translation.y += 0.2;
    changes(&mut stage, "a mesh that moves");

    let camera = set::camera(&mut stage);
    stage.world_mut().get_mut::<Transform>(camera).expect("a transform").translation.x += 0.2;
    changes(&mut stage, "a camera that moves");

    set::gi_without_knobs(&mut stage).vpl_count = 512;
    changes(&mut stage, "more VPLs");

    set::gi_without_knobs(&mut stage).rsm_resolution = 128;
    changes(&mut stage, "finer maps");

    set::gi_without_knobs(&mut stage).visibility = bevy_frugal_gi::gi::GiVisibility::Fine;
    changes(&mut stage, "rays");

    let material = meshes::diffuse(0.1, 0.9, 0.1);
    let world = stage.world_mut();
    let mut materials = world.resource_mut::<bevy::asset::Assets<bevy::pbr::StandardMaterial>>();
    let ids: Vec<_> = materials.ids().collect();
    for id in ids {
        drop(materials.insert(id, material.clone()));
    }
    changes(&mut stage, "materials of another colour");

    assert!(stage.world_mut().despawn(mesh));
    changes(&mut stage, "a mesh that is removed");
}

fn weights_of_morphs_that_another_entity_holds_wake_the_maps() {
    let mut stage = at_rest(GiRefresh::OnChange);
    let mut mesh = meshes::plate(false);
    let raised = MorphAttributes::new(Vec3::Y, Vec3::ZERO, Vec3::ZERO);
    mesh.set_morph_targets(vec![raised; mesh.count_vertices()]);
    let weights = MorphWeights::new(vec![0.0], None).expect("one target");
    let holder = stage.world_mut().spawn(weights).id();
    let place = Transform::from_xyz(0.0, 0.2, 0.0);
    let plate = meshes::spawn(&mut stage, mesh, meshes::diffuse(0.9, 0.1, 0.1), place);
    let weights = (MeshMorphWeights::Reference(holder), NoFrustumCulling);
    stage.world_mut().entity_mut(plate).insert(weights);
    (0..16).for_each(|_| stage.frame());
    let before = stage.radiance().expect("an image");
    let world = stage.world_mut();
    world.get_mut::<MorphWeights>(holder).expect("weights").weights_mut()[0] = 0.5;
    stage.frame();
    assert_eq!(set::gathered(&stage).maps, 1);
    assert!(stage.radiance().expect("an image") != before, "the plate is higher");
    (0..16).for_each(|_| stage.frame());
    assert_eq!(set::gathered(&stage).maps, 0, "until they rest");
}

fn a_walk_through_a_still_scene_renders_no_map() {
    let mut stage = at_rest(GiRefresh::OnChange);
    for step in 0..8 {
        set::look(
            &mut stage,
            Vec3::new(0.05 * (step + 1) as f32, 1.2, 3.0),
            Vec3::new(0.0, 0.8, -2.0),
        );
        stage.frame();
        let done = set::gathered(&stage);
        assert!((done.maps, done.cameras) == (0, 1) && done.pairs > 0, "{done:?}");
    }
}

fn the_refresh_period_limits_how_often_maps_are_rendered() {
    let mut stage = at_rest(GiRefresh::OnChange);
    for period in [1, 2, 4, 8] {
        set::gi_without_knobs(&mut stage).refresh_period = period;
        (0..16).for_each(|_| stage.frame());
        let mut rendered = 0;
        for _ in 0..16 {
            turn_the_sun(&mut stage, 0.01);
            stage.frame();
            rendered += set::gathered(&stage).maps;
        }
        assert_eq!(rendered, 16 / period, "every {period}th frame");
        // The last change also takes effect.
        (0..16).for_each(|_| stage.frame());
        let converged = stage.radiance().expect("an image");
        stage.world_mut().insert_resource(GiRefresh::EveryFrame);
        (0..9).for_each(|_| stage.frame());
        assert!(stage.radiance().expect("an image") == converged, "period {period}");
        stage.world_mut().insert_resource(GiRefresh::OnChange);
    }
}
