//! Zero, one, and hundreds of lights.

use std::collections::HashSet;

use bevy::camera::primitives::{Frustum, Sphere};
use bevy::ecs::entity::Entity;
use bevy::light::{PointLight, SpotLight};
use bevy::math::Vec3;
use bevy::transform::components::Transform;
use bevy_frugal_gi::gi::{GiLimits, RsmView};
use frugal::stage::Stage;
use frugal_tests::{gpu, meshes, set};

use super::Random;
use crate::gi::{corner, sun};

tests!(the_lights_with_the_highest_illuminance_at_the_camera_get_maps);

/// Lights with maps, and the number of maps.
fn bouncing(stage: &mut Stage) -> (HashSet<Entity>, usize) {
    let world = stage.world_mut();
    let maps: Vec<Entity> = world.query::<&RsmView>().iter(world).map(|view| view.light).collect();
    (maps.iter().copied().collect(), maps.len())
}

/// Limits the number of maps. At a cut lights do not fade, and what had maps has no advantage.
fn limit(stage: &mut Stage, most: usize) {
    stage.world_mut().insert_resource(GiLimits { max_rsm_count: most, ..Default::default() });
    set::cut(stage);
}

fn the_lights_with_the_highest_illuminance_at_the_camera_get_maps() {
    let mut stage = corner(vec![]);
    // The first frame applies the knobs' levels, which would overwrite the following changes.
    stage.frame();
    let camera = set::camera(&mut stage);
    set::gi_without_knobs(&mut stage).rsm_resolution = 16;
    let eye = stage.world_mut().get::<Transform>(camera).expect("a transform").translation;
    // The camera is inside the scene, whose lights count by what they do around it.
    meshes::spawn_box(&mut stage, eye + 1.0, Vec3::splat(0.01), meshes::diffuse(0.0, 0.0, 0.0));
    let mut random = Random(23);
    // 200 spot lights and 100 point lights, without shadow maps, which GI does not need.
    let mut lights = Vec::new();
    for index in 0..300 {
        let position = random.inside(Vec3::new(-40.0, 0.5, -40.0), Vec3::new(40.0, 3.0, 40.0));
        let intensity = 10.0 * 10f32.powf(4.0 * random.next());
        let at = Transform::from_translation(position).looking_to(Vec3::NEG_Y, Vec3::X);
        let (entity, maps) = if index % 3 == 0 {
            (stage.world_mut().spawn((PointLight { intensity, ..Default::default() }, at)).id(), 6)
        } else {
            (stage.world_mut().spawn((SpotLight { intensity, ..Default::default() }, at)).id(), 1)
        };
        // Proportional to the illuminance at the eye, with distances clamped to at least 1 m.
        let importance = f64::from(intensity) / f64::from(position.distance_squared(eye).max(1.0));
        lights.push((entity, importance, maps));
    }
    stage.frame();
    // A tenth of it where a light reaches nothing in view.
    let frustum = *stage.world_mut().get::<Frustum>(camera).expect("a frustum");
    for (light, importance, _) in &mut lights {
        let world = stage.world_mut();
        let center = world.get::<Transform>(*light).expect("a transform").translation.into();
        let range = PointLight::default().range;
        assert_eq!(range, SpotLight::default().range);
        if !frustum.intersects_sphere(&Sphere { center, radius: range }, false) {
            *importance *= 0.1;
        }
    }
    let found = set::radiance(&mut stage);
    assert!(found.rgb.iter().flatten().all(|value| value.is_finite()));
    lights.sort_by(|a, b| b.1.total_cmp(&a.1));
    let expect = |most: usize| {
        let mut left = most;
        let mut chosen = HashSet::new();
        for (entity, _, maps) in &lights {
            if *maps <= left {
                left -= maps;
                chosen.insert(*entity);
            }
        }
        (chosen, most - left)
    };
    let default = GiLimits::default().max_rsm_count;
    let (chosen, maps) = bouncing(&mut stage);
    println!(
        "    {} of {} lights bounce, in {maps} maps of at most {default}",
        chosen.len(),
        lights.len()
    );
    assert_eq!((chosen, maps), expect(default));
    assert!(
        maps == default && set::gathered(&stage).bytes < 4 << 20,
        "{maps} {:?}",
        set::gathered(&stage)
    );

    // As few as are rendered in a frame, no map, one map, and five, too few for a point light.
    for most in [GiLimits::default().max_rsms_per_frame, 0, 1, 5] {
        limit(&mut stage, most);
        let found = set::radiance(&mut stage).mean();
        let (chosen, maps) = bouncing(&mut stage);
        assert_eq!((chosen, maps), expect(most), "at most {most}");
        assert!(maps == most && (most > 0 || found == 0.0), "{most}: {found}");
        let bytes = set::gathered(&stage).bytes;
        assert!(bytes < 1 << 20, "{most}: {bytes}");
    }
    // The sun is the brightest light.
    let sun = sun(Vec3::NEG_Y);
    let frugal_trace::light::Light::Directional { illuminance, .. } = sun else { panic!("a sun") };
    let down = Transform::default().looking_to(Vec3::NEG_Y, Vec3::X);
    let sun = stage
        .world_mut()
        .spawn((bevy::light::DirectionalLight { illuminance, ..Default::default() }, down))
        .id();
    limit(&mut stage, 1);
    set::radiance(&mut stage);
    assert_eq!(bouncing(&mut stage), (HashSet::from([sun]), 1));
    assert!(gpu::total_flux(&gpu::vpls(&stage))[0] > 0.0);
}
