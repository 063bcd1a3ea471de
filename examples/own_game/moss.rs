//! Moss on the floor, and the game's own knob of how thick it grows.

use bevy::prelude::*;
use bevy_frugal_gi::knobs::{FieldKnob, Knob, KnobField};
use bevy_frugal_gi::prelude::*;

/// Number of tufts; on the camera that sees them.
#[derive(Component, Clone)]
pub(crate) struct Moss(pub(crate) usize);

#[derive(Component)]
pub(crate) struct Tuft;

/// Registers the knob: a level is a number of tufts.
pub(crate) fn register(app: &mut App) {
    app.register_knob(FieldKnob::new(
        Knob::new("moss", [0.0, 50.0, 150.0, 400.0]),
        KnobField::new(|moss: &mut Moss| &mut moss.0, |level, _| level.value as usize),
    ));
}

/// Lets the tufts grow, or takes them away.
pub(crate) fn grow(
    mut commands: Commands,
    moss: Single<&Moss, Changed<Moss>>,
    tufts: Query<Entity, With<Tuft>>,
    mut assets: Local<Option<(Handle<Mesh>, Handle<StandardMaterial>)>>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    let (mesh, material) = assets
        .get_or_insert_with(|| {
            (meshes.add(Cone::new(0.08, 0.25)), materials.add(Color::srgb(0.2, 0.45, 0.1)))
        })
        .clone();
    tufts.iter().skip(moss.0).for_each(|tuft| commands.entity(tuft).despawn());
    for number in tufts.iter().count()..moss.0 {
        // Halton's points: evenly spread for any number.
        let place = vec3(halton(number, 2) * 5.0 - 1.2, 0.1, halton(number, 3) * 11.0 - 5.5);
        let surface = (Mesh3d(mesh.clone()), MeshMaterial3d(material.clone()));
        commands.spawn((Tuft, surface, Transform::from_translation(place)));
    }
}

/// Digits of a number to a base, behind the point in reverse.
fn halton(number: usize, base: usize) -> f32 {
    let (mut rest, mut digit, mut value) = (number + 1, 1.0, 0.0);
    while rest > 0 {
        digit /= base as f32;
        value += digit * (rest % base) as f32;
        rest /= base;
    }
    value
}
