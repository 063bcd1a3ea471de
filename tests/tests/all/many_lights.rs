//! More lights than maps can be rendered in a frame, or exist: only maps that are out of date are
//! rendered, in turns, and lights fade when they get or lose their maps.

use std::any::TypeId;

use bevy::camera::visibility::{Visibility, VisibilityRange, VisibleEntities};
use bevy::color::Color;
use bevy::ecs::component::Component;
use bevy::ecs::entity::Entity;
use bevy::image::Image;
use bevy::light::{PointLight, SpotLight};
use bevy::math::primitives::Sphere;
use bevy::math::{Quat, Vec3};
use bevy::mesh::{Mesh3d, Meshable};
use bevy::transform::components::Transform;
use bevy_frugal_gi::gi::{GiLimits, GiRefresh, RsmView};
use frugal::stage::Stage;
use frugal_tests::{gpu, meshes, set};

use super::gi::{PLAIN, corner};

tests!(
    only_maps_that_can_show_a_change_are_rendered,
    what_no_map_shows_renders_none,
    only_what_changed_is_uploaded,
    maps_are_rendered_in_turns,
    a_light_that_goes_takes_its_light_with_it,
    lights_are_exchanged_without_a_step,
    maps_take_no_view_of_levels_of_detail,
);

/// Range of the point lights, metres.
const RANGE: f32 = 2.0;
/// Middle of a second place, out of the first one's reach.
const ELSEWHERE: Vec3 = Vec3::new(60.0, 0.0, 0.0);

fn point_light(stage: &mut Stage, position: Vec3, color: Color) -> Entity {
    let light = PointLight { color, intensity: 1e5, range: RANGE, ..Default::default() };
    stage.world_mut().spawn((light, Transform::from_translation(position))).id()
}

fn small_box(stage: &mut Stage, position: Vec3) -> Entity {
    meshes::spawn_box(stage, position, Vec3::splat(0.2), meshes::diffuse(0.7, 0.3, 0.3))
}

/// Two places, each with a point light and a box, and a flashlight in the first: nothing changes any more.
/// The boxes and the flashlight.
fn two_places() -> (Stage, [Entity; 2], Entity) {
    let mut stage = corner(vec![]);
    stage.frame();
    set::disable_history(&mut stage);
    let boxes = [Vec3::ZERO, ELSEWHERE].map(|place| {
        point_light(&mut stage, place + Vec3::new(0.5, 1.0, 0.0), Color::WHITE);
        small_box(&mut stage, place + Vec3::new(0.0, 0.5, 0.0))
    });
    let flashlight = stage
        .world_mut()
        .spawn((
            SpotLight { intensity: 1e5, range: RANGE, ..Default::default() },
            Transform::from_xyz(0.0, 1.0, 0.5),
        ))
        .id();
    rest(&mut stage);
    (stage, boxes, flashlight)
}

fn rest(stage: &mut Stage) {
    stage.world_mut().insert_resource(GiRefresh::OnChange);
    stage.get_ready().expect("a ready stage");
    (0..16).for_each(|_| stage.frame());
    let done = set::gathered(stage);
    assert_eq!((done.maps, done.cameras, done.waiting_maps), (0, 0, 0), "{done:?}");
}

/// Maps that the next frame renders.
fn rendered(stage: &mut Stage) -> u32 {
    stage.frame();
    set::gathered(stage).maps
}

fn moved(stage: &mut Stage, entity: Entity, by: Vec3) {
    stage.world_mut().get_mut::<Transform>(entity).expect("a transform").translation += by;
}

fn only_maps_that_can_show_a_change_are_rendered() {
    let (mut stage, [near, far], flashlight) = two_places();
    let before = stage.radiance().expect("radiance");
    moved(&mut stage, far, Vec3::Y * 0.1);
    assert_eq!(rendered(&mut stage), 2, "faces of the light beside it that see it");
    assert!(set::gathered(&stage).cameras == 1, "rays may meet it");
    rest(&mut stage);
    moved(&mut stage, near, Vec3::Y * 0.1);
    assert_eq!(rendered(&mut stage), 3, "of the light and of the flashlight");
    rest(&mut stage);
    assert!(stage.radiance().expect("radiance") != before, "and the image shows it");
    let mut transform = stage.world_mut().get_mut::<Transform>(flashlight).expect("a transform");
    transform.rotation *= Quat::from_rotation_y(0.3);
    assert_eq!(rendered(&mut stage), 1, "its own");
    rest(&mut stage);
    // From one place to the other: both the old place and the new one count.
    moved(&mut stage, near, ELSEWHERE + Vec3::X * 0.3);
    assert_eq!(rendered(&mut stage), 5);
    rest(&mut stage);
    // What all of it comes to is what rendering everything does.
    let shown = stage.radiance().expect("radiance");
    stage.world_mut().insert_resource(GiRefresh::EveryFrame);
    (0..3).for_each(|_| stage.frame());
    assert!(stage.radiance().expect("radiance") == shown);
}

fn what_no_map_shows_renders_none() {
    let (mut stage, [near, _], _) = two_places();
    // A mesh that nothing lights, which rays may meet; it comes with a mesh and a material.
    let alone = small_box(&mut stage, Vec3::Y * 40.0);
    rest(&mut stage);
    moved(&mut stage, alone, Vec3::X);
    assert_eq!((rendered(&mut stage), set::gathered(&stage).cameras), (0, 1));
    rest(&mut stage);
    // An image of the interface, say.
    let world = stage.world_mut();
    let image = world.resource_mut::<bevy::asset::Assets<Image>>().add(Image::default());
    for _ in 0..6 {
        assert_eq!((rendered(&mut stage), set::gathered(&stage).cameras), (0, 0));
    }
    // A mesh that nothing shows.
    let world = stage.world_mut();
    let cube = bevy::math::primitives::Cuboid::default();
    let mesh = world.resource_mut::<bevy::asset::Assets<bevy::mesh::Mesh>>().add(cube);
    for _ in 0..6 {
        assert_eq!((rendered(&mut stage), set::gathered(&stage).cameras), (0, 0));
    }
    drop((image, mesh));
    // The children of what moves, before Bevy tells them.
    let parent = stage.world_mut().spawn((Transform::default(), Visibility::default())).id();
    stage.world_mut().entity_mut(parent).add_child(near);
    rest(&mut stage);
    moved(&mut stage, parent, Vec3::Y * 0.1);
    assert_eq!(rendered(&mut stage), 3, "of the light and of the flashlight");
}

fn only_what_changed_is_uploaded() {
    const NODE: u64 = 32;
    const INSTANCE: u64 = 64;
    let (mut stage, [near, far], flashlight) = two_places();
    set::apply(&mut stage, &format!("{PLAIN},gi_visibility=coarse"));
    let uploaded = |stage: &mut Stage| {
        stage.frame();
        set::gathered(stage).uploaded
    };
    // A mesh of a thousand triangles, and one that makes the buffers grow, which uploads all.
    let sphere = Sphere::new(0.3).mesh().uv(32, 18);
    let ball = |stage: &mut Stage, place: Vec3| {
        meshes::spawn(
            stage,
            sphere.clone(),
            meshes::diffuse(0.5, 0.5, 0.5),
            Transform::from_translation(place),
        )
    };
    for place in [Vec3::new(-0.5, 0.5, 0.0), Vec3::new(-0.5, 0.5, 0.7)] {
        ball(&mut stage, place);
        rest(&mut stage);
    }
    let whole = set::gathered(&stage).bytes;
    assert_eq!(uploaded(&mut stage), 0, "nothing changed");

    moved(&mut stage, far, Vec3::Y * 0.1);
    let moving = uploaded(&mut stage);
    assert!(
        (INSTANCE..=INSTANCE + 16 * NODE).contains(&moving),
        "{moving}: itself and boxes above"
    );
    rest(&mut stage);
    for entity in [near, far] {
        moved(&mut stage, entity, Vec3::Y * 0.1);
    }
    assert!(uploaded(&mut stage) <= 8 * INSTANCE + 16 * NODE, "both, and what lies between");
    rest(&mut stage);

    let mut transform = stage.world_mut().get_mut::<Transform>(flashlight).expect("a transform");
    transform.rotation *= Quat::from_rotation_y(0.3);
    assert_eq!(uploaded(&mut stage), 0, "a light is no occluder");
    rest(&mut stage);
    let image =
        stage.world_mut().resource_mut::<bevy::asset::Assets<Image>>().add(Image::default());
    assert_eq!((0..6).map(|_| uploaded(&mut stage)).sum::<u64>(), 0, "an image of the interface");
    drop(image);

    // Geometry that comes is uploaded alone, and once.
    small_box(&mut stage, Vec3::new(0.3, 0.5, 0.3));
    let coming: u64 = (0..16).map(|_| uploaded(&mut stage)).sum();
    println!(
        "    uploaded: {moving} B for a mesh that moves, {coming} B for a box that comes, of {whole} B"
    );
    assert!((12 * 48..4000).contains(&coming), "{coming}");
}

fn maps_are_rendered_in_turns() {
    const LIGHTS: usize = 8;
    let mut stage = corner(vec![]);
    stage.frame();
    set::disable_history(&mut stage);
    stage.world_mut().insert_resource(GiLimits { max_rsms_per_frame: 12, ..Default::default() });
    let lights: Vec<Entity> = (0..LIGHTS)
        .map(|index| {
            let at = Vec3::new(index as f32 * 0.4 - 1.4, 0.5, 0.3 * (index % 3) as f32);
            point_light(&mut stage, at, Color::WHITE)
        })
        .collect();
    rest(&mut stage);
    let move_all = |stage: &mut Stage| {
        for light in &lights {
            moved(stage, *light, Vec3::Y * 0.05);
        }
    };
    move_all(&mut stage);
    let turns: Vec<(u32, u32)> =
        (0..5).map(|_| (rendered(&mut stage), set::gathered(&stage).waiting_maps)).collect();
    assert_eq!(turns, [(12, 36), (12, 24), (12, 12), (12, 0), (0, 0)]);
    rest(&mut stage);
    // While all of them move, each gets its turn.
    let mut last = stage.radiance().expect("radiance");
    for _ in 0..8 {
        move_all(&mut stage);
        assert_eq!(rendered(&mut stage), 12);
    }
    assert!(stage.radiance().expect("radiance") != last);
    rest(&mut stage);
    // After a cut nothing waits.
    move_all(&mut stage);
    set::cut(&mut stage);
    assert_eq!(rendered(&mut stage), 6 * LIGHTS as u32);
    // A limit below one light's maps still goes on.
    stage.world_mut().insert_resource(GiLimits { max_rsms_per_frame: 0, ..Default::default() });
    rest(&mut stage);
    move_all(&mut stage);
    assert_eq!(rendered(&mut stage), 6);
    rest(&mut stage);
    last = stage.radiance().expect("radiance");
    stage.world_mut().insert_resource(GiLimits { max_rsms_per_frame: 999, ..Default::default() });
    stage.world_mut().insert_resource(GiRefresh::EveryFrame);
    (0..3).for_each(|_| stage.frame());
    assert!(stage.radiance().expect("radiance") == last, "in turns or at once");
}

fn a_light_that_goes_takes_its_light_with_it() {
    let mut stage = corner(vec![]);
    stage.frame();
    set::disable_history(&mut stage);
    let red = point_light(&mut stage, Vec3::new(-0.5, 0.6, -1.0), Color::linear_rgb(1.0, 0.0, 0.0));
    rest(&mut stage);
    let alone = stage.radiance().expect("radiance");
    let green =
        point_light(&mut stage, Vec3::new(0.5, 0.6, -1.0), Color::linear_rgb(0.0, 1.0, 0.0));
    rest(&mut stage);
    let [red_light, green_light, _] = set::channel_means(&stage.radiance().expect("radiance"));
    assert!(red_light > 0.0 && green_light > 0.0);
    assert!(stage.world_mut().despawn(green));
    assert_eq!(rendered(&mut stage), 0, "the other one's map is as it was");
    assert!(stage.radiance().expect("radiance") == alone);
    assert!(stage.world_mut().despawn(red));
    rest(&mut stage);
    assert_eq!(stage.radiance().expect("radiance").mean(), 0.0);
}

fn lights_are_exchanged_without_a_step() {
    let mut stage = corner(vec![]);
    stage.frame();
    set::gi_without_knobs(&mut stage).rsm_resolution = 64;
    stage.world_mut().insert_resource(GiLimits { max_rsm_count: 6, ..Default::default() });
    meshes::spawn_box(
        &mut stage,
        Vec3::new(0.0, -0.3, 0.0),
        Vec3::new(60.0, 0.2, 4.0),
        meshes::diffuse(0.5, 0.5, 0.5),
    );
    let place = Vec3::new(20.0, 1.0, 0.0);
    point_light(&mut stage, Vec3::Y, Color::linear_rgb(1.0, 0.0, 0.0));
    point_light(&mut stage, place, Color::linear_rgb(0.0, 1.0, 0.0));
    rest(&mut stage);
    let [red, green, _] = gpu::total_flux(&gpu::vpls(&stage));
    assert!(red > 0.0 && green == 0.0, "only the first one has maps");
    let mut last = [red, green];
    let mut largest = 0.0f64;
    for step in 1..=40u8 {
        let x = 0.5 * f32::from(step);
        set::look(&mut stage, Vec3::new(x, 1.2, 3.0), Vec3::new(x, 0.8, -2.0));
        stage.frame();
        let [is_red, is_green, _] = gpu::total_flux(&gpu::vpls(&stage));
        for (now, last) in [is_red, is_green].into_iter().zip(last) {
            largest = largest.max((now - last).abs() / red);
        }
        last = [is_red, is_green];
    }
    println!("    the largest step of a light is {:.0} % of its flux", 100.0 * largest);
    assert!(last[0] == 0.0 && last[1] > 0.3 * red, "{last:?} {red}");
    assert!(largest < 0.3, "{largest}");
    let world = stage.world_mut();
    assert_eq!(world.query::<&RsmView>().iter(world).count(), 6, "the first one's maps are gone");
}

/// Makes an entity move behind all others in the order of queries.
#[derive(Component)]
struct Later;

/// Bevy keeps ranges of visibility for 32 views.
fn maps_take_no_view_of_levels_of_detail() {
    let mut stage = corner(vec![]);
    let lights: Vec<Entity> = (0..7)
        .map(|number| {
            let place = Vec3::new(0.4 * number as f32 - 1.2, 1.5, 0.0);
            point_light(&mut stage, place, Color::WHITE)
        })
        .collect();
    rest(&mut stage);
    let world = stage.world_mut();
    assert_eq!(world.query::<&RsmView>().iter(world).count(), 6 * lights.len());
    let lit = gpu::total_flux(&gpu::vpls(&stage))[0];
    let camera = set::camera(&mut stage);
    stage.world_mut().entity_mut(camera).insert(Later);
    let [near, far] = [0.0, 50.0].map(|start| {
        let size = Vec3::new(4.0, 0.1, 4.0);
        let lid =
            meshes::spawn_box(&mut stage, 0.5 * Vec3::Y, size, meshes::diffuse(0.0, 0.0, 0.0));
        let range = VisibilityRange::abrupt(start, start + 50.0);
        stage.world_mut().entity_mut(lid).insert(range);
        lid
    });
    let shows = |stage: &mut Stage, mesh: Entity| {
        let list = stage.world_mut().get::<VisibleEntities>(camera).expect("a list");
        list.get(TypeId::of::<Mesh3d>()).contains(&mesh)
    };
    for _ in 0..4 {
        stage.frame();
        assert!(shows(&mut stage, near) && !shows(&mut stage, far));
    }
    rest(&mut stage);
    assert!(shows(&mut stage, near) && !shows(&mut stage, far));
    let covered = gpu::total_flux(&gpu::vpls(&stage))[0];
    assert!(lit > 0.0 && covered < 0.7 * lit, "all maps show the black lid: {covered} of {lit}");
}
