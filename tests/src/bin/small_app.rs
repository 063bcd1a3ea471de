//! A small app on the tool's stage, with a knob of its own. `SMALL_APP` names a fault of it, and
//! `SMALL_APP_ONCE` a file: the fault is gone when that is there.

use std::path::PathBuf;
use std::time::Duration;

use bevy::prelude::*;
use bevy_frugal_gi::knobs::{FieldKnob, Knob, KnobField};
use bevy_frugal_gi::prelude::*;
use bevy_frugal_gi::stage::{StageLevel, StageReady, on_stage};

/// Brightness of the app's own light, which the app's own knob sets.
#[derive(Component, Clone)]
struct Lamps(f32);

#[derive(Resource)]
struct Fault(String);

fn main() -> AppExit {
    let fault = std::env::var("SMALL_APP").unwrap_or_default();
    match fault.as_str() {
        "old" => say_another_version(),
        "loud" => {
            let line = "a line of a very talkative app, ".repeat(8);
            (0..100_000).for_each(|number| println!("{line}{number}"));
        }
        "silent" => std::thread::sleep(Duration::from_secs(1000)),
        _ => {}
    }
    let knob = FieldKnob::new(
        Knob::new("lamps", [1.0, 2.0, 4.0]),
        KnobField::new(|lamps: &mut Lamps| &mut lamps.0, |level, _| level.value as f32),
    );
    let mut app = App::new();
    app.add_plugins((on_stage(DefaultPlugins), FrugalGiPlugins))
        .register_knob(knob)
        .insert_resource(Fault(fault))
        .add_systems(Startup, set_up)
        .add_systems(Update, (light_lamps, turn, misbehave))
        .run()
}

/// What an app of another version says.
fn say_another_version() {
    if let Ok(address) = std::env::var("FRUGAL_STAGE") {
        use std::io::Write;
        let hello = r#"{"protocol":9,"version":"9.8.7","app":"old"}"#;
        let (port, token) = address.split_once('/').expect("a port and a token");
        let mut socket = std::net::TcpStream::connect(port).expect("the tool");
        socket.write_all(token.as_bytes()).expect("the tool");
        socket.write_all(&(hello.len() as u32).to_le_bytes()).expect("the tool");
        socket.write_all(hello.as_bytes()).expect("the tool");
        std::thread::sleep(Duration::from_secs(1000));
    }
}

#[derive(Component)]
struct Turning;

fn set_up(
    mut commands: Commands,
    level: Res<StageLevel>,
    fault: Res<Fault>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    match fault.0.as_str() {
        "never ready" => commands.insert_resource(StageReady::NotYet),
        "no level" => {
            let name = level.0.clone().unwrap_or_default();
            commands.insert_resource(StageReady::Failed(format!("no level `{name}`: try `cave`")));
        }
        _ => {}
    }
    let mut block = |size: Vec3, place: Vec3, color: Color| {
        commands.spawn((
            Mesh3d(meshes.add(Cuboid::from_size(size))),
            MeshMaterial3d(materials.add(color)),
            Transform::from_translation(place),
        ));
    };
    block(vec3(8.0, 0.2, 8.0), vec3(0.0, -0.1, 0.0), Color::srgb(0.7, 0.7, 0.7));
    block(vec3(1.0, 1.0, 1.0), vec3(0.0, 0.5, 0.0), Color::srgb(0.8, 0.2, 0.1));
    let lamp = PointLight { intensity: 2e5, shadow_maps_enabled: true, ..default() };
    commands.spawn((lamp, Transform::from_xyz(1.5, 3.0, 1.0)));
    // The camera of a game is often part of something that moves.
    let camera = (
        Camera3d::default(),
        FrugalGi::default(),
        Lamps(4.0),
        Transform::from_xyz(0.0, 1.5, 4.0).looking_at(vec3(0.0, 0.5, 0.0), Vec3::Y),
    );
    commands
        .spawn((Turning, Transform::from_xyz(0.3, 0.0, 0.0), Visibility::default()))
        .with_child(camera);
    // The view of a second player.
    commands.spawn((Camera3d::default(), Camera { order: 1, ..default() }));
}

fn light_lamps(lamps: Single<&Lamps, Changed<Lamps>>, mut lights: Query<&mut PointLight>) {
    lights.iter_mut().for_each(|mut light| light.intensity = 5e4 * lamps.0);
}

fn turn(time: Res<Time>, mut turning: Single<&mut Transform, With<Turning>>) {
    turning.rotate_y(time.delta_secs());
}

/// Frames after which the faults come: while the level is made, or, of those that come once, while it
/// is measured.
const FRAMES: [u32; 2] = [3, 200];

fn misbehave(
    fault: Res<Fault>,
    lamps: Query<&Lamps>,
    mut frames: Local<u32>,
    mut exit: MessageWriter<AppExit>,
) {
    *frames += 1;
    let once = std::env::var_os("SMALL_APP_ONCE").map(PathBuf::from);
    if *frames < FRAMES[usize::from(once.is_some())]
        || once.as_ref().is_some_and(|file| file.exists())
    {
        return;
    }
    if let Some(file) = once {
        std::fs::write(file, "").expect("room");
    }
    match fault.0.as_str() {
        "crashes" => panic!("the small app has crashed"),
        // At no settings but the best.
        "breaks when dimmed" if lamps.iter().any(|lamps| lamps.0 < 4.0) => {
            panic!("the small app's lamps are broken")
        }
        "hangs" => std::thread::sleep(Duration::from_secs(1000)),
        "exits" => drop(exit.write(AppExit::Success)),
        _ => {}
    }
}
