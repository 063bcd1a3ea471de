//! What is left out of reflective shadow maps and of occluders: meshes that cast no shadow, and
//! meshes and lights on other render layers.

use bevy::camera::visibility::{NoCpuCulling, RenderLayers, VisibilityRange};
use bevy::camera::{Camera, Camera3d};
use bevy::color::LinearRgba;
use bevy::ecs::entity::Entity;
use bevy::ecs::query::{With, Without};
use bevy::light::{DirectionalLight, NotShadowCaster};
use bevy::math::Vec3;
use bevy::mesh::Mesh3d;
use bevy::pbr::StandardMaterial;
use bevy::render::view::Msaa;
use bevy::transform::components::Transform;
use bevy_frugal_gi::gi::{FrugalGi, GiRefresh};
use frugal::stage::{Component, Radiance, Stage};
use frugal_tests::{meshes, set};

use super::gi::{PLAIN, assert_costs_nothing, corner, sun};
use super::refresh::converges_in_one_frame;

tests!(
    meshes_that_cast_no_shadow_are_in_no_map,
    meshes_that_bevy_does_not_cull_are_in_maps,
    multisampling_is_switched_off_on_gi_cameras,
    a_light_reflects_meshes_of_its_layers,
    a_light_of_other_layers_than_the_camera_s_bounces_nothing,
    a_resting_camera_lights_what_its_new_layers_show,
    meshes_that_no_gi_camera_shows_occlude_nothing,
    meshes_that_no_gi_camera_shows_emit_nothing,
    a_level_of_detail_that_is_not_shown_occludes_nothing,
    levels_of_detail_reflect_as_one_mesh,
);

/// A black lid over the whole corner, out of the camera's sight.
fn spawn_lid(stage: &mut Stage) -> Entity {
    let black = meshes::diffuse(0.0, 0.0, 0.0);
    meshes::spawn_box(stage, Vec3::new(0.0, 6.0, 0.0), Vec3::new(6.0, 0.1, 6.0), black)
}

fn the_sun(stage: &mut Stage) -> Entity {
    let world = stage.world_mut();
    world.query_filtered::<Entity, With<DirectionalLight>>().single(world).expect("the sun")
}

fn meshes_that_cast_no_shadow_are_in_no_map() {
    let mut stage = corner(vec![sun(Vec3::NEG_Y)]);
    let open = set::radiance(&mut stage);
    let lid = spawn_lid(&mut stage);
    let closed = set::radiance(&mut stage).mean();
    assert!(closed < 0.01 * open.mean() && open.mean() > 1.0, "{closed} {}", open.mean());
    stage.world_mut().entity_mut(lid).insert(NotShadowCaster);
    assert!(set::radiance(&mut stage) == open, "the lid casts no shadow");
    // A sky dome does not stretch the map either.
    let dome = spawn_lid(&mut stage);
    stage.world_mut().entity_mut(dome).insert((
        NotShadowCaster,
        Transform::from_xyz(0.0, 900.0, 0.0).with_scale(Vec3::splat(500.0)),
    ));
    assert!(set::radiance(&mut stage) == open, "the dome casts no shadow");
    stage.world_mut().entity_mut(lid).remove::<NotShadowCaster>();
    assert_eq!(set::radiance(&mut stage).mean(), closed, "the lid casts its shadow again");
}

fn meshes_that_bevy_does_not_cull_are_in_maps() {
    let mut stage = corner(vec![sun(Vec3::NEG_Y)]);
    let open = set::radiance(&mut stage).mean();
    let lid = spawn_lid(&mut stage);
    stage.world_mut().entity_mut(lid).insert(NoCpuCulling);
    let closed = set::radiance(&mut stage).mean();
    assert!(open > 1.0 && closed < 0.01 * open, "it casts its shadow: {closed} {open}");
}

fn multisampling_is_switched_off_on_gi_cameras() {
    let mut stage = corner(vec![]);
    let world = stage.world_mut();
    let camera = (Camera3d::default(), Camera { is_active: false, ..Default::default() });
    let [before, after] = [true, false].map(|has_samples| {
        let camera = world.spawn(camera.clone()).id();
        if has_samples {
            world.entity_mut(camera).insert(Msaa::Sample4);
        }
        world.entity_mut(camera).insert(FrugalGi::default());
        camera
    });
    stage.frame();
    for camera in [before, after] {
        assert_eq!(stage.world_mut().get::<Msaa>(camera), Some(&Msaa::Off));
    }
}

fn a_light_reflects_meshes_of_its_layers() {
    let mut stage = corner(vec![sun(Vec3::NEG_Y)]);
    let lid = spawn_lid(&mut stage);
    let closed = set::radiance(&mut stage).mean();
    stage.world_mut().entity_mut(lid).insert(RenderLayers::layer(1));
    let open = set::radiance(&mut stage).mean();
    assert!(open > 1.0 && closed < 0.01 * open, "the sun does not see the lid: {open} {closed}");
    // At run time, too.
    let sun = the_sun(&mut stage);
    stage.world_mut().entity_mut(sun).insert(RenderLayers::from_layers(&[0, 1]));
    assert_eq!(set::radiance(&mut stage).mean(), closed, "now it does");
    stage.world_mut().entity_mut(sun).remove::<RenderLayers>();
    assert_eq!(set::radiance(&mut stage).mean(), open, "and again not");
}

fn a_light_of_other_layers_than_the_camera_s_bounces_nothing() {
    let mut stage = corner(vec![sun(Vec3::NEG_Y)]);
    let lit = set::radiance(&mut stage).mean();
    let sun = the_sun(&mut stage);
    stage.world_mut().entity_mut(sun).insert(RenderLayers::layer(1));
    assert_eq!(set::radiance(&mut stage).mean(), 0.0, "Bevy shows none of its light either");
    assert_costs_nothing(&mut stage);
    let camera = set::camera(&mut stage);
    stage.world_mut().entity_mut(camera).insert(RenderLayers::from_layers(&[0, 1]));
    assert_eq!(set::radiance(&mut stage).mean(), 0.0, "the sun sees no mesh");
    stage.world_mut().entity_mut(sun).insert(RenderLayers::from_layers(&[0, 1]));
    assert_eq!(set::radiance(&mut stage).mean(), lit);
}

fn a_resting_camera_lights_what_its_new_layers_show() {
    let mut stage = corner(vec![sun(Vec3::NEG_Y)]);
    let grey = meshes::diffuse(0.5, 0.5, 0.5);
    let hidden = meshes::spawn_box(&mut stage, Vec3::new(0.0, 0.5, -1.0), Vec3::splat(0.4), grey);
    stage.world_mut().entity_mut(hidden).insert(RenderLayers::layer(1));
    set::disable_history(&mut stage);
    stage.world_mut().insert_resource(GiRefresh::OnChange);
    set::radiance(&mut stage);
    (0..16).for_each(|_| stage.frame());
    assert_eq!(set::gathered(&stage).cameras, 0, "at rest");
    let camera = set::camera(&mut stage);
    stage.world_mut().entity_mut(camera).insert(RenderLayers::from_layers(&[0, 1]));
    assert!(converges_in_one_frame(&mut stage, "more layers"));
}

/// A corner with rays and a black fence before its wall: the fence, and the radiance without and
/// with it.
fn fenced_corner() -> (Stage, Entity, [Radiance; 2]) {
    let mut stage = corner(vec![sun(Vec3::NEG_Y)]);
    set::apply(&mut stage, &format!("{PLAIN},gi_visibility=coarse"));
    let open = set::radiance(&mut stage);
    let black = meshes::diffuse(0.0, 0.0, 0.0);
    let (center, size) = (Vec3::new(0.0, 0.6, -1.6), Vec3::new(4.0, 1.1, 0.02));
    let fence = meshes::spawn_box(&mut stage, center, size, black);
    let fenced = set::radiance(&mut stage);
    (stage, fence, [open, fenced])
}

fn meshes_that_no_gi_camera_shows_occlude_nothing() {
    let (mut stage, fence, [open, fenced]) = fenced_corner();
    assert!(fenced.mean() < 0.9 * open.mean(), "{} {}", fenced.mean(), open.mean());
    stage.world_mut().entity_mut(fence).insert(RenderLayers::layer(1));
    assert!(set::radiance(&mut stage) == open, "neither the sun nor the camera sees it");
    let camera = set::camera(&mut stage);
    stage.world_mut().entity_mut(camera).insert(RenderLayers::from_layers(&[0, 1]));
    let shown = set::radiance(&mut stage).mean();
    assert!(shown < 0.95 * open.mean(), "the camera sees it: {shown} {}", open.mean());
}

fn meshes_that_no_gi_camera_shows_emit_nothing() {
    let mut stage = set::bare(vec![], set::radiance_options(48, 27, Component::Global));
    meshes::spawn_corner(&mut stage, 0.5);
    set::look(&mut stage, Vec3::new(0.0, 1.2, 3.0), Vec3::new(0.0, 0.8, -2.0));
    set::apply(&mut stage, PLAIN);
    let material = StandardMaterial {
        emissive: LinearRgba::rgb(10.0, 10.0, 10.0),
        ..meshes::diffuse(0.0, 0.0, 0.0)
    };
    let emitter =
        meshes::spawn_box(&mut stage, Vec3::new(0.0, 1.5, 0.0), Vec3::splat(0.4), material);
    let lit = set::radiance(&mut stage);
    assert!(lit.mean() > 1.0, "{}", lit.mean());
    stage.world_mut().entity_mut(emitter).insert(RenderLayers::layer(1));
    assert_eq!(set::radiance(&mut stage).mean(), 0.0);
    stage.world_mut().entity_mut(emitter).remove::<RenderLayers>();
    assert!(set::radiance(&mut stage) == lit);
}

fn a_level_of_detail_that_is_not_shown_occludes_nothing() {
    let (mut stage, fence, [open, fenced]) = fenced_corner();
    stage.world_mut().entity_mut(fence).insert(VisibilityRange::abrupt(50.0, 1000.0));
    assert!(set::radiance(&mut stage) == open, "it is for cameras from 50 m on");
    stage.world_mut().entity_mut(fence).insert(VisibilityRange::abrupt(0.0, 50.0));
    assert!(set::radiance(&mut stage) == fenced, "it is for cameras up to 50 m");
}

fn levels_of_detail_reflect_as_one_mesh() {
    let mut stage = corner(vec![sun(Vec3::NEG_Y)]);
    // The sun's map looks down from above this pole.
    let grey = meshes::diffuse(0.5, 0.5, 0.5);
    let (center, size) = (Vec3::new(1.9, 60.0, 1.9), Vec3::new(0.1, 120.0, 0.1));
    let pole = meshes::spawn_box(&mut stage, center, size, grey);
    let without = set::radiance(&mut stage);
    assert!(without.mean() > 1.0);
    for (from, to) in [(0.0, 30.0), (30.0, 1e6)] {
        let world = stage.world_mut();
        let corner: Vec<Entity> = world
            .query_filtered::<Entity, (With<Mesh3d>, Without<VisibilityRange>)>()
            .iter(world)
            .filter(|mesh| *mesh != pole)
            .collect();
        for mesh in corner {
            stage.world_mut().entity_mut(mesh).insert(VisibilityRange::abrupt(from, to));
        }
        if from == 0.0 {
            meshes::spawn_corner(&mut stage, 0.5);
        }
    }
    // The camera shows the near level, and the map the far one: the corner is there once.
    assert!(set::radiance(&mut stage) == without);
}
