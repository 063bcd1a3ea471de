//! Global illumination in 30 lines: one light, a room, and one component on the camera.
//!
//! Look at the ceiling and the sides of the boxes: the light points down from just under the
//! ceiling and does not reach them; all their light, red and green included, has bounced off the
//! floor and the walls. Space switches global illumination off and on.

use bevy::prelude::*;
use bevy_frugal_gi::prelude::*;

fn main() -> AppExit {
    App::new()
        .add_plugins((
            DefaultPlugins,
            FrugalGiPlugins,
            frugal_examples::ExamplePlugin { title: "minimal" },
        ))
        .insert_resource(GlobalAmbientLight::NONE)
        .add_systems(Startup, set_up)
        .add_systems(Update, switch)
        .run()
}

fn set_up(
    mut commands: Commands,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    let (grey, slate) = (Color::srgb(0.8, 0.8, 0.8), Color::srgb(0.3, 0.3, 0.35));
    let (red, green) = (Color::srgb(0.9, 0.1, 0.1), Color::srgb(0.1, 0.8, 0.2));
    let mut block = |size: Vec3, centre: Vec3, color: Color| {
        let surface = StandardMaterial {
            base_color: color,
            perceptual_roughness: 1.0,
            reflectance: 0.0,
            ..default()
        };
        let cuboid = meshes.add(Cuboid::from_size(size));
        commands.spawn((
            Mesh3d(cuboid),
            MeshMaterial3d(materials.add(surface)),
            Transform::from_translation(centre),
        ));
    };
    block(vec3(4.0, 0.1, 3.0), vec3(0.0, -0.05, 0.0), slate);
    block(vec3(4.0, 0.1, 3.0), vec3(0.0, 2.45, 0.0), grey);
    block(vec3(4.0, 2.4, 0.1), vec3(0.0, 1.2, -1.55), grey);
    block(vec3(0.1, 2.4, 3.0), vec3(-2.05, 1.2, 0.0), red);
    block(vec3(0.1, 2.4, 3.0), vec3(2.05, 1.2, 0.0), green);
    block(vec3(0.8, 1.2, 0.8), vec3(-0.9, 0.6, -0.5), grey);
    block(vec3(0.8, 0.5, 0.8), vec3(0.9, 0.25, 0.2), grey);
    let light = SpotLight {
        intensity: 350_000.0,
        inner_angle: 1.0,
        outer_angle: 1.5,
        shadow_maps_enabled: true,
        ..default()
    };
    commands.spawn((light, Transform::from_xyz(0.0, 2.3, 0.2).looking_to(Vec3::NEG_Y, Vec3::X)));
    // Deferred rendering has no multisampling.
    let view = Transform::from_xyz(0.0, 1.3, 4.6).looking_at(vec3(0.0, 1.15, 0.0), Vec3::Y);
    commands.spawn((Camera3d::default(), Msaa::Off, FrugalGi::default(), view));
}

fn switch(keys: Res<ButtonInput<KeyCode>>, mut gi: Single<&mut FrugalGi>) {
    if keys.just_pressed(KeyCode::Space) {
        gi.vpl_count = if gi.vpl_count == 0 { FrugalGi::default().vpl_count } else { 0 };
    }
}
