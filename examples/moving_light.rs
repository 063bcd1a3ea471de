//! A light that circles around a column, and its indirect light.
//!
//! Look at the shadow of the column: all light in it has bounced, and it is redder towards one wall
//! and greener towards the other. It follows the light without delay or flicker. Space switches
//! global illumination off and on; the shadows turn black. P pauses the light: in a still image
//! nothing is rendered or gathered again.

use bevy::prelude::*;
use bevy_frugal_gi::prelude::*;
use frugal_examples::{ExamplePlugin, caption, spawn_blocks};

/// Seconds of a round.
const ROUND: f32 = 6.0;

fn main() -> AppExit {
    App::new()
        .add_plugins((DefaultPlugins, FrugalGiPlugins))
        .add_plugins(ExamplePlugin { title: "moving_light" })
        .insert_resource(GlobalAmbientLight::NONE)
        .add_systems(Startup, set_up)
        .add_systems(Update, (switch, circle))
        .run()
}

/// A light on its way, with the share of the round that it has behind it.
#[derive(Component, Default)]
struct Circling {
    share: f32,
    is_paused: bool,
}

fn set_up(
    mut commands: Commands,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    let grey = Color::srgb(0.75, 0.75, 0.75);
    let (red, green) = (Color::srgb(0.9, 0.12, 0.1), Color::srgb(0.12, 0.75, 0.2));
    let blocks = [
        (vec3(8.0, 0.1, 6.0), vec3(0.0, -0.05, 0.0), grey),
        (vec3(8.0, 0.1, 6.0), vec3(0.0, 3.05, 0.0), grey),
        (vec3(8.0, 3.0, 0.1), vec3(0.0, 1.5, -3.05), grey),
        (vec3(0.1, 3.0, 6.0), vec3(-4.05, 1.5, 0.0), red),
        (vec3(0.1, 3.0, 6.0), vec3(4.05, 1.5, 0.0), green),
        (vec3(0.8, 3.0, 0.8), vec3(0.0, 1.5, -0.3), grey),
    ];
    spawn_blocks(&mut commands, &mut meshes, &mut materials, blocks);
    let light = PointLight { intensity: 250_000.0, shadow_maps_enabled: true, ..default() };
    commands.spawn((light, Circling::default(), Transform::default()));
    let view = Transform::from_xyz(0.0, 1.8, 6.6).looking_at(vec3(0.0, 1.4, 0.0), Vec3::Y);
    commands.spawn((Camera3d::default(), Msaa::Off, FrugalGi::default(), view));
    commands.spawn(caption("Space: global illumination   P: pause"));
}

fn circle(time: Res<Time>, mut light: Single<(&mut Transform, &mut Circling)>) {
    let (transform, circling) = &mut *light;
    if !circling.is_paused {
        circling.share = (circling.share + time.delta_secs() / ROUND).fract();
    }
    let (sin, cos) = (circling.share * std::f32::consts::TAU).sin_cos();
    let place = vec3(2.6 * cos, 1.6, 1.9 * sin - 0.3);
    // Writing the same place would be a change, and the maps would be rendered again.
    transform.set_if_neq(Transform::from_translation(place));
}

fn switch(
    keys: Res<ButtonInput<KeyCode>>,
    mut gi: Single<&mut FrugalGi>,
    mut light: Single<&mut Circling>,
) {
    if keys.just_pressed(KeyCode::Space) {
        gi.vpl_count = if gi.vpl_count == 0 { FrugalGi::default().vpl_count } else { 0 };
    }
    if keys.just_pressed(KeyCode::KeyP) {
        light.is_paused = !light.is_paused;
    }
}
