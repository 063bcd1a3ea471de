//! Spawns a scene's geometry, lights, sky and camera in an app.

use bevy::anti_alias::smaa::Smaa;
use bevy::camera::{
    Camera, Camera3d, ClearColorConfig, Exposure, PerspectiveProjection, Projection,
};
use bevy::color::{Color, LinearRgba};
use bevy::core_pipeline::tonemapping::{DebandDither, Tonemapping};
use bevy::ecs::entity::Entity;
use bevy::ecs::world::World;
use bevy::light::{
    CascadeShadowConfigBuilder, DirectionalLight, GlobalAmbientLight, PointLight, SpotLight,
};
use bevy::pbr::ScreenSpaceAmbientOcclusion;
use bevy::post_process::bloom::Bloom;
use bevy::transform::components::Transform;
use bevy_frugal_gi::gi::FrugalGi;
use frugal_trace::light::Light;
use glam::Vec3;

use super::{StageError, environment};
use crate::scene::{Environment, LoadedScene, spawn as spawn_geometry};

/// Sets up `scene` for `camera`: spawns its geometry and lights, sets the app's environment light,
/// and gives the camera the scene's lens, exposure and background. The camera's other components,
/// including its transform, are unchanged.
///
/// The geometry loads in the background. `camera` must be a `Camera3d`, and the world that of an app
/// with Bevy's 3D renderer; it opens files outside its own folder if its `AssetPlugin` allows
/// unapproved paths.
///
/// # Errors
/// When the environment map cannot be read.
pub fn populate(world: &mut World, scene: &LoadedScene, camera: Entity) -> Result<(), StageError> {
    let geometry = &scene.geometry;
    let reach =
        geometry.bounds().map_or(scene.camera.far, |b| b.size().length().min(scene.camera.far));
    let exposure = 1.0 / (1.2 * scene.exposure_ev100.exp2());
    spawn_geometry(world, scene, scene.number, Some(exposure));
    for light in &scene.lights {
        spawn_light(world, light, reach);
    }
    let lens = PerspectiveProjection {
        fov: scene.camera.vertical_fov.to_radians(),
        near: scene.camera.near,
        far: scene.camera.far,
        ..Default::default()
    };
    world
        .entity_mut(camera)
        .insert((Projection::Perspective(lens), Exposure { ev100: scene.exposure_ev100 }));
    if let Some(mut camera) = world.get_mut::<Camera>(camera) {
        camera.clear_color = ClearColorConfig::Custom(Color::BLACK);
    }
    world.insert_resource(GlobalAmbientLight::NONE);
    match &scene.environment {
        Environment::None => {}
        Environment::Constant(radiance) => {
            environment::constant(world, camera, *radiance, exposure);
        }
        Environment::Map(_, intensity) => {
            if let Some(map) = scene.sky().map_err(StageError::usage)? {
                environment::map(world, camera, &map, *intensity);
            }
        }
    }
    Ok(())
}

/// Spawns `scene` and a camera for it, with the effects on which knobs act, at their own defaults: a
/// knob adds none by itself.
pub(super) fn spawn(world: &mut World, scene: &LoadedScene) -> Result<Entity, StageError> {
    let camera = world.spawn((
        Camera3d::default(),
        Tonemapping::TonyMcMapface,
        DebandDither::Disabled,
        FrugalGi::default(),
        Transform::default(),
        ScreenSpaceAmbientOcclusion::default(),
        Bloom::NATURAL,
        Smaa::default(),
    ));
    let camera = camera.id();
    populate(world, scene, camera)?;
    Ok(camera)
}

fn linear([red, green, blue]: [f32; 3]) -> Color {
    Color::LinearRgba(LinearRgba::rgb(red, green, blue))
}

fn spawn_light(world: &mut World, light: &Light, reach: f32) {
    match light {
        Light::Directional { direction, illuminance, color } => {
            let cascades = CascadeShadowConfigBuilder {
                num_cascades: 4,
                minimum_distance: 0.1,
                maximum_distance: reach.max(1.0),
                first_cascade_far_bound: (reach / 12.0).max(0.5),
                ..Default::default()
            };
            world.spawn((
                DirectionalLight {
                    color: linear(*color),
                    illuminance: *illuminance,
                    shadow_maps_enabled: true,
                    shadow_normal_bias: 1.0,
                    ..Default::default()
                },
                cascades.build(),
                toward(Vec3::ZERO, *direction),
            ));
        }
        Light::Point { position, luminous_power, range, color } => {
            world.spawn((
                PointLight {
                    color: linear(*color),
                    intensity: *luminous_power,
                    range: *range,
                    shadow_maps_enabled: true,
                    ..Default::default()
                },
                Transform::from_translation(*position),
            ));
        }
        Light::Spot {
            position,
            direction,
            luminous_power,
            range,
            inner_angle,
            outer_angle,
            color,
        } => {
            world.spawn((
                SpotLight {
                    color: linear(*color),
                    intensity: *luminous_power,
                    range: *range,
                    inner_angle: inner_angle.to_radians(),
                    outer_angle: outer_angle.to_radians(),
                    shadow_maps_enabled: true,
                    ..Default::default()
                },
                toward(*position, *direction),
            ));
        }
    }
}

fn toward(position: Vec3, direction: Vec3) -> Transform {
    let direction = direction.normalize_or(Vec3::NEG_Y);
    Transform::from_translation(position).looking_to(direction, direction.any_orthonormal_vector())
}
