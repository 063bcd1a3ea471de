//! Patches reflect again after every change, and after nothing else.

use bevy::asset::Assets;
use bevy::color::LinearRgba;
use bevy::math::primitives::Plane3d;
use bevy::math::{Vec2, Vec3};
use bevy::mesh::{MeshBuilder, Meshable};
use bevy::pbr::{MeshMaterial3d, StandardMaterial};
use bevy::transform::components::Transform;
use bevy_frugal_gi::gi::{GiRefresh, GiTextureCopies};
use frugal::stage::{Component, Stage};
use frugal_tests::{meshes, set};

use super::super::gi::{corner, sun};
use super::super::refresh::{converges_in_one_frame, turn_the_sun};
use super::{RAYS, with_bounces};

tests!(
    patches_rest_when_nothing_changes,
    changes_are_reflected_in_the_next_frame,
    emission_that_changes_is_reflected_anew,
    textures_that_arrive_late_are_reflected,
    what_follows_a_cut_depends_on_nothing_before,
    the_sky_of_before_a_cut_leaves_no_trace,
    light_does_not_depend_on_the_numbers_of_entities,
);

/// A corner under the sun with three bounces, after it has converged.
fn at_rest() -> Stage {
    let mut stage = corner(vec![sun(Vec3::new(-0.3, -1.0, -0.2))]);
    set::apply(&mut stage, RAYS);
    stage.frame();
    set::disable_history(&mut stage);
    with_bounces(&mut stage, 3).world_mut().insert_resource(GiRefresh::OnChange);
    set::radiance(&mut stage);
    (0..16).for_each(|_| stage.frame());
    stage
}

fn patches_rest_when_nothing_changes() {
    let mut stage = at_rest();
    let before = stage.radiance().expect("an image");
    for _ in 0..8 {
        stage.frame();
        assert_eq!(set::gathered(&stage).patches, 0);
    }
    assert!(stage.radiance().expect("an image") == before);
    // A small movement of the camera updates no patches.
    for step in 0..4 {
        set::look(
            &mut stage,
            Vec3::new(0.01 * (step + 1) as f32, 1.2, 3.0),
            Vec3::new(0.0, 0.8, -2.0),
        );
        stage.frame();
        let done = set::gathered(&stage);
        assert!(done.patches == 0 && done.pairs > 0, "{done:?}");
    }
    turn_the_sun(&mut stage, 0.1);
    stage.frame();
    assert_eq!(set::gathered(&stage).patches, 2 * 2048, "two rounds");
}

fn changes_are_reflected_in_the_next_frame() {
    let mut stage = at_rest();
    let mesh = meshes::spawn_box(
        &mut stage,
        Vec3::new(0.5, 0.5, 0.0),
        Vec3::splat(0.4),
        meshes::diffuse(0.8, 0.2, 0.2),
    );
    (0..16).for_each(|_| stage.frame());
    let check = |stage: &mut Stage, label: &str| {
        assert!(converges_in_one_frame(stage, label), "{label}");
        assert_eq!(set::gathered(stage).patches, 0, "{label}: converged again");
    };
    turn_the_sun(&mut stage, 0.2);
    check(&mut stage, "a light that turns");
    stage.world_mut().get_mut::<Transform>(mesh).expect("a transform").translation.y += 0.2;
    check(&mut stage, "a mesh that moves");
    let camera = set::camera(&mut stage);
    stage.world_mut().get_mut::<Transform>(camera).expect("a transform").translation.x += 3.0;
    check(&mut stage, "a camera that moves");
    with_bounces(&mut stage, 2);
    check(&mut stage, "fewer bounces");
    set::gi_without_knobs(&mut stage).rsm_resolution = 128;
    check(&mut stage, "finer maps");
    assert!(stage.world_mut().despawn(mesh));
    check(&mut stage, "a mesh that is removed");
}

fn emission_that_changes_is_reflected_anew() {
    // A floor below a panel, without any light that has a map.
    let mut stage = set::bare(vec![], set::radiance_options(48, 27, Component::Global));
    meshes::spawn_corner(&mut stage, 0.5);
    let emission = |nits: f32| LinearRgba::rgb(nits, nits, nits);
    let material = StandardMaterial { emissive: emission(5.0), ..meshes::diffuse(0.0, 0.0, 0.0) };
    let mesh = Plane3d::new(Vec3::NEG_Y, Vec2::splat(1.0)).mesh().build();
    let panel = meshes::spawn(&mut stage, mesh, material, Transform::from_xyz(0.0, 2.0, 0.0));
    set::apply(&mut stage, RAYS);
    set::disable_history(&mut stage);
    with_bounces(&mut stage, 3).world_mut().insert_resource(GiRefresh::OnChange);
    set::radiance(&mut stage);
    (0..16).for_each(|_| stage.frame());
    assert_eq!(set::gathered(&stage).patches, 0, "at rest");
    let world = stage.world_mut();
    let handle =
        world.get::<MeshMaterial3d<StandardMaterial>>(panel).expect("a material").0.clone();
    let mut materials = world.resource_mut::<Assets<StandardMaterial>>();
    materials.get_mut(&handle).expect("the material").emissive = emission(1.0);
    // Bevy tells of a changed asset a frame later.
    let seen = [(); 3].map(|()| {
        stage.frame();
        set::gathered(&stage).patches
    });
    assert!(seen.contains(&(2 * 2048)), "two rounds: {seen:?}");
    (0..16).for_each(|_| stage.frame());
    assert_eq!(set::gathered(&stage).patches, 0, "at rest again");
}

fn textures_that_arrive_late_are_reflected() {
    let mut stage = at_rest();
    // The CPU reads copies of them, four at a time.
    for x in 0..16 {
        let texture = meshes::compressed_texture(&mut stage, &[0xf800, 0x001f]);
        let white = meshes::diffuse(1.0, 1.0, 1.0);
        let material = StandardMaterial { base_color_texture: Some(texture), ..white };
        let place = Vec3::new(0.2 * x as f32 - 1.5, 0.3, -1.0);
        meshes::spawn_box(&mut stage, place, Vec3::splat(0.15), material);
    }
    let waiting = |stage: &mut Stage| stage.world_mut().resource::<GiTextureCopies>().waiting();
    for _ in 0..300 {
        stage.frame();
        if waiting(&mut stage) == 0 {
            break;
        }
    }
    assert_eq!(waiting(&mut stage), 0);
    (0..16).for_each(|_| stage.frame());
    assert_eq!(set::gathered(&stage).cameras, 0, "at rest");
    let shown = stage.radiance().expect("an image");
    stage.world_mut().insert_resource(GiRefresh::EveryFrame);
    (0..3).for_each(|_| stage.frame());
    assert!(stage.radiance().expect("an image") == shown, "nothing was left out");
}

fn what_follows_a_cut_depends_on_nothing_before() {
    let there = (Vec3::new(0.6, 1.2, 1.6), Vec3::new(0.0, 0.5, -1.0));
    let image = |before: Option<Vec3>| {
        let mut stage = corner(vec![sun(Vec3::new(-0.3, -1.0, -0.2))]);
        with_bounces(&mut stage, 2);
        // Each with points of its own, as many as its distance asks for.
        for x in 0..40 {
            let place = Vec3::new(x as f32, 0.1, -1.0);
            meshes::spawn_box(&mut stage, place, Vec3::splat(0.4), meshes::diffuse(0.8, 0.2, 0.2));
        }
        for eye in before.into_iter().chain([there.0]) {
            set::look(&mut stage, eye, there.1);
            set::apply(&mut stage, RAYS);
            (0..6).for_each(|_| stage.frame());
        }
        stage.radiance().expect("an image")
    };
    let alone = image(None);
    // So near that the patches of before would do.
    assert!(image(Some(Vec3::new(0.2, 1.2, 1.6))) == alone);
    // So far that the boxes there get more points, and those here fewer.
    assert!(image(Some(Vec3::new(40.0, 0.5, 0.0))) == alone);
}

fn the_sky_of_before_a_cut_leaves_no_trace() {
    let scene = set::scene("courtyard");
    let pose = scene.paths["tour"].sample(2.0).expect("a tour");
    let mut stage = set::open(&scene, set::options(64, 36));
    with_bounces(&mut stage, 3);
    stage.place(pose.position, pose.rotation);
    let mut picture = |settings: &str| {
        set::apply(&mut stage, settings);
        stage.get_ready().expect("a ready stage");
        stage.picture().expect("an image")
    };
    let alone = picture("max");
    // Takes other samples of the sky, and patches keep what those lit.
    picture("max,gi_visibility=cached");
    assert!(picture("max") == alone);
}

fn light_does_not_depend_on_the_numbers_of_entities() {
    let image = |others: usize| {
        let mut stage = corner(vec![sun(Vec3::new(-0.3, -1.0, -0.2))]);
        with_bounces(&mut stage, 2);
        for _ in 0..others {
            stage.world_mut().spawn_empty();
        }
        for x in 0..4 {
            let place = Vec3::new(0.5 * x as f32 - 0.8, 0.1, -1.0);
            meshes::spawn_box(&mut stage, place, Vec3::splat(0.4), meshes::diffuse(0.8, 0.2, 0.2));
        }
        set::look(&mut stage, Vec3::new(0.6, 1.2, 1.6), Vec3::new(0.0, 0.5, -1.0));
        set::apply(&mut stage, RAYS);
        (0..6).for_each(|_| stage.frame());
        stage.radiance().expect("an image")
    };
    assert!(image(3) == image(0));
}
