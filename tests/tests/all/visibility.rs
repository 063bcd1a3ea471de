//! Visibility between surfaces and virtual point lights.

use bevy::app::Last;
use bevy::asset::Assets;
use bevy::camera::visibility::VisibilityRange;
use bevy::ecs::entity::Entity;
use bevy::ecs::resource::Resource;
use bevy::ecs::system::{Commands, Query, Res};
use bevy::light::NotShadowCaster;
use bevy::math::Vec3;
use bevy::mesh::{Mesh, Mesh3d};
use bevy::prelude::{AlphaMode, Cuboid};
use bevy::transform::components::Transform;
use bevy_frugal_gi::gi::{FrugalGi, GiOccluders, GiRefresh, GiVisibility};
use frugal::stage::{Component, Stage};
use frugal_tests::{meshes, set};

use super::gi::{PLAIN, corner, sun};

tests!(
    the_dark_room_is_dark,
    a_screen_occludes_the_bounce_and_follows_its_transform,
    surfaces_that_cast_no_shadow_occlude_nothing,
    coarse_and_fine_have_the_same_mean,
    nothing_is_kept_without_rays,
    rays_enabled_at_the_end_of_a_frame_work_one_frame_later,
    occluders_that_moved_occlude_where_they_are,
    what_streams_in_is_spread_over_frames,
    hidden_levels_of_detail_do_not_wait,
);

/// Mean indirect radiance of a view, nits.
fn mean(stage: &mut Stage, visibility: &str) -> f64 {
    set::apply(stage, &format!("{PLAIN},gi_visibility={visibility}"));
    set::radiance(stage).mean()
}

fn the_dark_room_is_dark() {
    let mut stage =
        set::open(&set::scene("two_rooms"), set::radiance_options(64, 36, Component::Indirect));
    set::look(&mut stage, Vec3::new(0.8, 1.7, 2.0), Vec3::new(3.2, 1.0, -1.6));
    let [none, coarse, fine] =
        ["none", "coarse", "fine"].map(|visibility| mean(&mut stage, visibility));
    set::look(&mut stage, Vec3::new(-0.8, 1.7, 2.0), Vec3::new(-3.2, 1.0, -1.6));
    let lit = mean(&mut stage, "fine");
    println!(
        "    dark room: {none:.3} nits without rays, {coarse:.5} coarse, {fine:.5} fine; lit room {lit:.2}"
    );
    assert!(none > 0.05 * lit, "without rays light leaks, or this test proves nothing: {none}");
    assert!(coarse < 1e-4 * lit && fine < 1e-4 * lit, "{coarse} {fine}");
}

/// A lit floor, a wall that it lights, and a black screen directly in front of the wall.
fn screened() -> (Stage, Entity) {
    let mut stage = corner(vec![sun(Vec3::NEG_Y)]);
    let screen = meshes::spawn_box(
        &mut stage,
        Vec3::new(0.0, 1.0, -1.85),
        Vec3::new(4.5, 2.1, 0.02),
        meshes::diffuse(0.0, 0.0, 0.0),
    );
    // The camera sees only the wall behind the screen.
    set::look(&mut stage, Vec3::new(0.0, 1.2, -1.87), Vec3::new(0.0, 0.8, -2.0));
    (stage, screen)
}

fn a_screen_occludes_the_bounce_and_follows_its_transform() {
    let (mut stage, screen) = screened();
    let (leaking, occluded) = (mean(&mut stage, "none"), mean(&mut stage, "fine"));
    stage.world_mut().get_mut::<Transform>(screen).expect("the screen").translation.y = -50.0;
    let open = mean(&mut stage, "fine");
    println!(
        "    behind the screen {occluded:.3} nits, without rays {leaking:.2}, without the screen {open:.2}"
    );
    assert!(leaking > 1.0 && occluded < 0.05 * leaking, "{leaking} {occluded}");
    assert!(
        (open / leaking - 1.0).abs() < 0.05,
        "nothing occludes the wall any more: {open} {leaking}"
    );
    stage.world_mut().get_mut::<Transform>(screen).expect("the screen").translation.y = 1.0;
    let back = mean(&mut stage, "fine");
    assert!((back - occluded).abs() < 1e-3 * leaking, "{back} {occluded}");
}

fn surfaces_that_cast_no_shadow_occlude_nothing() {
    let (mut stage, screen) = screened();
    let occluded = mean(&mut stage, "fine");
    stage.world_mut().entity_mut(screen).insert(NotShadowCaster);
    let open = mean(&mut stage, "fine");
    assert!(open > 10.0 * occluded.max(0.05), "{open} {occluded}");
    stage.world_mut().entity_mut(screen).remove::<NotShadowCaster>();
    assert!(mean(&mut stage, "fine") < 0.1 * open);
    let material = stage
        .world_mut()
        .get::<bevy::pbr::MeshMaterial3d<bevy::pbr::StandardMaterial>>(screen)
        .expect("a material")
        .0
        .clone();
    let mut materials = stage.world_mut().resource_mut::<Assets<bevy::pbr::StandardMaterial>>();
    materials.get_mut(&material).expect("the material").alpha_mode = AlphaMode::Blend;
    assert!(mean(&mut stage, "fine") > 0.5 * open, "glass occludes nothing");
}

fn coarse_and_fine_have_the_same_mean() {
    let mut stage = corner(vec![sun(Vec3::new(0.3, -1.0, -0.2))]);
    meshes::spawn_box(
        &mut stage,
        Vec3::new(0.3, 0.5, -0.9),
        Vec3::new(0.8, 0.9, 0.2),
        meshes::diffuse(0.3, 0.3, 0.3),
    );
    let [none, coarse, fine] =
        ["none", "coarse", "fine"].map(|visibility| mean(&mut stage, visibility));
    println!("    {none:.3} nits without rays, {coarse:.3} coarse, {fine:.3} fine");
    assert!((coarse / fine - 1.0).abs() < 0.02, "sampling must not bias the mean: {coarse} {fine}");
    assert!(fine < 0.95 * none, "{fine} {none}");
}

fn nothing_is_kept_without_rays() {
    let mut stage = corner(vec![sun(Vec3::NEG_Y)]);
    let held = |stage: &mut Stage| {
        let occluders = stage.world_mut().resource::<GiOccluders>();
        (occluders.instance_count(), occluders.triangle_count())
    };
    set::radiance(&mut stage);
    let (without, rays) = (held(&mut stage), set::gathered(&stage).rays);
    assert_eq!((without, rays), ((0, 0), 0));
    mean(&mut stage, "coarse");
    assert_eq!(held(&mut stage), (2, 24), "two boxes");
    assert_eq!(set::gathered(&stage).rays, 48 * 27 * 2);
    // Removing a mesh removes its acceleration structure.
    let world = stage.world_mut();
    let meshes: Vec<Entity> =
        world.query_filtered::<Entity, bevy::ecs::query::With<Mesh3d>>().iter(world).collect();
    world.despawn(meshes[0]);
    mean(&mut stage, "coarse");
    assert_eq!(held(&mut stage).0, 1);
    mean(&mut stage, "none");
    assert_eq!(held(&mut stage), (0, 0));
}

/// Makes the app enable rays at the end of a frame, after the plugin's systems.
#[derive(Resource)]
struct AskForRays;

fn rays_enabled_at_the_end_of_a_frame_work_one_frame_later() {
    let ask = |asked: Option<Res<AskForRays>>,
               mut cameras: Query<&mut FrugalGi>,
               mut commands: Commands| {
        if asked.is_some() {
            cameras.iter_mut().for_each(|mut gi| gi.visibility = GiVisibility::Fine);
            commands.remove_resource::<AskForRays>();
        }
    };
    let options = set::radiance_options(48, 27, Component::Indirect);
    let mut stage = set::bare_with(vec![sun(Vec3::NEG_Y)], options, |app| {
        app.add_systems(Last, ask);
    });
    meshes::spawn_corner(&mut stage, 0.5);
    meshes::spawn_box(
        &mut stage,
        Vec3::new(0.0, 1.0, -1.85),
        Vec3::new(4.5, 2.1, 0.02),
        meshes::diffuse(0.0, 0.0, 0.0),
    );
    set::look(&mut stage, Vec3::new(0.0, 1.2, -1.87), Vec3::new(0.0, 0.8, -2.0));
    // Compiles the pipelines for rays.
    let occluded = mean(&mut stage, "fine");
    let leaking = mean(&mut stage, "none");
    set::gi_without_knobs(&mut stage).history_frames = 1;
    stage.world_mut().insert_resource(GiRefresh::OnChange);
    (0..16).for_each(|_| stage.frame());
    stage.world_mut().insert_resource(AskForRays);
    let found: Vec<f64> = (0..3)
        .map(|_| {
            stage.frame();
            stage.radiance().expect("an image").mean()
        })
        .collect();
    println!(
        "    {leaking:.3} nits without rays, {occluded:.3} with them; the frames after: {found:.3?}"
    );
    assert!(found[1] < 0.05 * leaking && found[2] == found[1], "{found:?}");
}

/// Fences before the wall of a corner under the sun, `shift` metres off their first place.
fn fenced(shift: f32) -> (Stage, Vec<Entity>) {
    let mut stage = corner(vec![sun(Vec3::NEG_Y)]);
    set::apply(&mut stage, &format!("{PLAIN},gi_visibility=coarse"));
    let fences = (0..6).map(|index| {
        let center = Vec3::new(0.5 * index as f32 - 1.5 + shift, 0.4, -1.6);
        let black = meshes::diffuse(0.0, 0.0, 0.0);
        meshes::spawn_box(&mut stage, center, Vec3::new(0.2, 0.7, 0.05), black)
    });
    let fences = fences.collect();
    (stage, fences)
}

fn occluders_that_moved_occlude_where_they_are() {
    let (mut stage, fences) = fenced(0.0);
    let before = set::radiance(&mut stage);
    // One alone, then all.
    for moving in [&fences[2..3], &fences[..]] {
        for _ in 0..4 {
            for fence in moving {
                let mut place = stage.world_mut().get_mut::<Transform>(*fence).expect("a place");
                place.translation.x += 0.03;
            }
            stage.frame();
        }
    }
    let mut place = stage.world_mut().get_mut::<Transform>(fences[2]).expect("a place");
    place.translation.x -= 0.12;
    let moved = set::radiance(&mut stage);
    assert!(moved != before);
    let (mut fresh, places) = fenced(0.0);
    for (fence, place) in fences.iter().zip(places) {
        let moved = *stage.world_mut().get::<Transform>(*fence).expect("a place");
        *fresh.world_mut().get_mut::<Transform>(place).expect("a place") = moved;
    }
    assert!(set::radiance(&mut fresh) == moved, "as if they had always been there");
}

fn what_streams_in_is_spread_over_frames() {
    let mut stage = corner(vec![sun(Vec3::NEG_Y)]);
    mean(&mut stage, "coarse");
    let speck = stage.world_mut().resource_mut::<Assets<Mesh>>().add(Cuboid::from_length(0.01));
    let spawn = |stage: &mut Stage, count: usize| -> Vec<Entity> {
        let place = |index| Transform::from_xyz(0.02 * index as f32, 0.5, 0.5);
        (0..count)
            .map(|index| stage.world_mut().spawn((Mesh3d(speck.clone()), place(index))).id())
            .collect()
    };
    let after_frame = |stage: &mut Stage| {
        stage.frame();
        let occluders = stage.world_mut().resource::<GiOccluders>();
        (occluders.instance_count(), occluders.waiting())
    };
    // More than were there: a scene that arrives.
    spawn(&mut stage, 600);
    assert_eq!(after_frame(&mut stage), (602, 0));
    // Fewer than were there.
    let streamed = spawn(&mut stage, 600);
    assert_eq!(after_frame(&mut stage), (602 + 256, 344));
    // Of those that wait, some go, one moves, one gets another mesh, and others come.
    for mesh in &streamed[500..] {
        assert!(stage.world_mut().despawn(*mesh));
    }
    stage.world_mut().entity_mut(streamed[499]).insert(Transform::from_xyz(0.0, 0.9, 0.0));
    stage.world_mut().entity_mut(streamed[498]).insert(Mesh3d(speck.clone()));
    spawn(&mut stage, 20);
    assert_eq!(after_frame(&mut stage), (602 + 512, 8));
    assert_eq!(after_frame(&mut stage), (602 + 520, 0));
    // What goes is gone at once.
    for mesh in &streamed[..500] {
        assert!(stage.world_mut().despawn(*mesh));
    }
    assert_eq!(after_frame(&mut stage), (602 + 20, 0));
}

fn hidden_levels_of_detail_do_not_wait() {
    let mut stage = corner(vec![sun(Vec3::NEG_Y)]);
    mean(&mut stage, "coarse");
    let speck = stage.world_mut().resource_mut::<Assets<Mesh>>().add(Cuboid::from_length(0.01));
    let mut spawn = |count: usize, range: Option<VisibilityRange>| {
        for index in 0..count {
            let place = Transform::from_xyz(0.02 * index as f32, 0.5, 0.5);
            let mut mesh = stage.world_mut().spawn((Mesh3d(speck.clone()), place));
            range.clone().map(|range| mesh.insert(range));
        }
        stage.frame();
        let occluders = stage.world_mut().resource::<GiOccluders>();
        (occluders.instance_count(), occluders.waiting())
    };
    assert_eq!(spawn(1500, None), (1502, 0));
    let [far, near] = [500.0, 0.0].map(|start| Some(VisibilityRange::abrupt(start, 600.0)));
    assert_eq!(spawn(600, far), (1502, 0), "out of range");
    assert_eq!(spawn(600, near), (1502 + 256, 344), "in range");
}
