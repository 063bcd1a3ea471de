//! A component of another crate as a knob, under the controller.
//!
//! Look at the number of spheres: Up and Down change a power budget, and the controller sets the
//! level of the knob `marbles` that keeps it, step by step. In the panel the point moves along the
//! frontier. Its four points are figures measured by hand: a `FrontierStore` need not be a map.

use bevy::prelude::*;
use bevy_frugal_gi::control::FrontierSource;
use bevy_frugal_gi::frontier::FrontierStore;
use bevy_frugal_gi::frontier::{
    CameraView, CostPoint, Frontier, FrontierPoint, SampleCamera, SampleRef, ViewDirection,
};
use bevy_frugal_gi::knobs::{FieldKnob, Knob, KnobDriver, KnobField, KnobLevels, KnobSpace};
use bevy_frugal_gi::prelude::*;
use bevy_frugal_gi_tools::HudPlugin;
use frugal_examples::{ExamplePlugin, caption};

/// Another crate's effect: it knows nothing of knobs.
mod marbles {
    use bevy::prelude::*;

    /// How many marbles lie around; on the camera that sees them.
    #[derive(Component, Clone)]
    pub(super) struct Marbles(pub(super) usize);

    #[derive(Component)]
    pub(super) struct Marble;

    pub(super) fn lay_out(
        mut commands: Commands,
        marbles: Single<&Marbles, Changed<Marbles>>,
        lying: Query<Entity, With<Marble>>,
        mut meshes: ResMut<Assets<Mesh>>,
        mut materials: ResMut<Assets<StandardMaterial>>,
    ) {
        lying.iter().for_each(|marble| commands.entity(marble).despawn());
        let mesh = meshes.add(Sphere::new(0.12));
        let material = materials.add(Color::srgb(0.9, 0.35, 0.1));
        for number in 0..marbles.0 {
            // Vogel's spiral: evenly spread for any number.
            let (radius, angle) = (0.22 * (number as f32).sqrt(), 2.399_963 * number as f32);
            let place = vec3(radius * angle.cos(), 0.12, radius * angle.sin());
            let surface = (Mesh3d(mesh.clone()), MeshMaterial3d(material.clone()));
            commands.spawn((Marble, surface, Transform::from_translation(place)));
        }
    }
}
use marbles::Marbles;

/// The knob: a level is a number of marbles, on a camera to which the app gave [`Marbles`].
fn marbles_knob() -> FieldKnob {
    FieldKnob::new(
        Knob::new("marbles", [0.0, 20.0, 80.0, 200.0]),
        KnobField::new(|marbles: &mut Marbles| &mut marbles.0, |level, _| level.value as usize),
    )
}

/// One frontier for all views.
struct Everywhere {
    space: KnobSpace,
    frontier: Frontier,
}

impl FrontierStore for Everywhere {
    fn look_up(&self, view: &CameraView) -> Option<SampleRef<'_>> {
        let direction = ViewDirection::NegativeZ;
        let camera = SampleCamera { corner: 0, position: view.position, direction };
        Some(SampleRef { camera, frontier: &self.frontier })
    }

    fn knobs(&self) -> &KnobSpace {
        &self.space
    }
}

fn main() -> AppExit {
    App::new()
        .add_plugins((DefaultPlugins, FrugalGiPlugins, HudPlugin))
        .add_plugins(ExamplePlugin { title: "custom_knob" })
        .register_knob(marbles_knob())
        .insert_resource(GlobalAmbientLight::NONE)
        .add_systems(Startup, set_up)
        .add_systems(Update, (change_budget, marbles::lay_out))
        .run()
}

fn set_up(
    mut commands: Commands,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    // Power and error of each level.
    let points = [(3.0, 0.20), (3.4, 0.09), (4.6, 0.02), (7.0, 0.0)];
    let point = |(level, (power, error))| FrontierPoint {
        settings: KnobLevels::default().with_level(0, level),
        cost: CostPoint::new(power, error),
    };
    let frontier = Frontier::from_points(points.into_iter().enumerate().map(point));
    let space = KnobSpace::new(vec![marbles_knob().knob()]).expect("a valid knob");
    let view = Transform::from_xyz(0.0, 3.0, 5.5).looking_at(Vec3::ZERO, Vec3::Y);
    let source = FrontierSource::new(Everywhere { space, frontier });
    commands.spawn((
        (Camera3d::default(), Msaa::Off, FrugalGi::default(), view),
        (Marbles(200), source, Budget::power(Watts(5.0))),
    ));

    let ground = materials.add(Color::srgb(0.7, 0.7, 0.75));
    commands.spawn((Mesh3d(meshes.add(Cuboid::new(9.0, 0.1, 9.0))), MeshMaterial3d(ground)));
    let light = SpotLight {
        intensity: 2_000_000.0,
        outer_angle: 1.0,
        shadow_maps_enabled: true,
        ..default()
    };
    commands.spawn((light, Transform::from_xyz(2.0, 6.0, 2.0).looking_at(Vec3::ZERO, Vec3::Y)));
    commands.spawn(caption("Up, Down: budget   F3: panel"));
}

fn change_budget(keys: Res<ButtonInput<KeyCode>>, mut budget: Single<&mut Budget>) {
    let step = i32::from(keys.just_pressed(KeyCode::ArrowUp))
        - i32::from(keys.just_pressed(KeyCode::ArrowDown));
    if let (true, Some(power)) = (step != 0, budget.power) {
        budget.power = Some(Watts((power.0 + 0.5 * f64::from(step)).clamp(2.0, 9.0)));
    }
}
