//! What global illumination adds to the main thread of an app of many meshes, by what moves.
//!
//! `make bench BENCH=main_thread`, or one case and other numbers of meshes, of which those that move
//! are the tenth part: `make bench BENCH=main_thread ARGS='still 0 1000'`
//!
//! Each case has two apps without a renderer, one with GI and one without, that are updated in turn.
//! Printed are the medians of both, and the median of the differences with the range that holds half of
//! them.

use std::collections::VecDeque;
use std::time::Instant;

use bevy::DefaultPlugins;
use bevy::app::{App, PluginGroup, Update};
use bevy::asset::Assets;
use bevy::camera::{
    Camera, Camera3d, OrthographicProjection, Projection, RenderTarget, ScalingMode,
};
use bevy::ecs::component::Component;
use bevy::ecs::entity::Entity;
use bevy::ecs::query::With;
use bevy::ecs::resource::Resource;
use bevy::ecs::system::{Commands, Query, Res, ResMut};
use bevy::light::DirectionalLight;
use bevy::log::LogPlugin;
use bevy::math::{UVec2, Vec3};
use bevy::mesh::{Mesh, Mesh3d};
use bevy::pbr::{MeshMaterial3d, StandardMaterial};
use bevy::prelude::Cuboid;
use bevy::render::RenderPlugin;
use bevy::render::settings::WgpuSettings;
use bevy::time::Time;
use bevy::transform::components::Transform;
use bevy::window::WindowPlugin;
use bevy::winit::WinitPlugin;
use bevy_frugal_gi::FrugalGiPlugins;
use bevy_frugal_gi::gi::FrugalGi;
use frugal_tests::cost::{median, quantile};

/// Number of meshes where none is given.
const MESHES: usize = 10_000;
/// Updates of each app that are timed.
const UPDATES: usize = 400;
/// Number of the first update that is timed.
const WARM: usize = 101;
/// Updates from one burst to the next.
const BURST: usize = 8;

/// What changes in every frame.
#[derive(Clone, Copy, Debug)]
enum Case {
    /// Nothing.
    Still,
    /// One mesh moves.
    One,
    /// A tenth of the meshes move.
    Tenth,
    /// A tenth of the meshes go, and as many come.
    Streamed,
    /// A tenth comes in every eighth frame, and as many go four frames later.
    Burst,
    /// Nothing, and instead of GI there are two more cameras that see all: what Bevy takes to find out
    /// what two maps show.
    Views,
}

const CASES: [(&str, Case); 6] = [
    ("still", Case::Still),
    ("one", Case::One),
    ("tenth", Case::Tenth),
    ("streamed", Case::Streamed),
    ("burst", Case::Burst),
    ("views", Case::Views),
];

/// Moves in every frame.
#[derive(Component)]
struct Mover;

/// An app of `count` meshes under a sun, without a renderer. `is_subject`: with what the case adds.
fn crowd(case: Case, count: usize, is_subject: bool) -> App {
    let mut app = App::new();
    let nowhere = WgpuSettings { backends: None, ..Default::default() };
    app.add_plugins(
        DefaultPlugins
            .set(RenderPlugin { render_creation: nowhere.into(), ..Default::default() })
            .set(WindowPlugin { primary_window: None, ..Default::default() })
            .disable::<WinitPlugin>()
            .disable::<LogPlugin>(),
    );
    let (has_gi, has_views) = match case {
        Case::Views => (false, is_subject),
        _ => (is_subject, false),
    };
    if has_gi {
        app.add_plugins(FrugalGiPlugins);
    }
    app.add_systems(Update, (move_all, stream));
    app.finish();
    app.cleanup();
    let world = app.world_mut();
    let mesh = world.resource_mut::<Assets<Mesh>>().add(Cuboid::new(0.5, 0.5, 0.5));
    let mut materials = world.resource_mut::<Assets<StandardMaterial>>();
    let materials: Vec<_> = (0..16).map(|_| materials.add(StandardMaterial::default())).collect();
    let side = count.isqrt();
    let moving = match case {
        Case::One => 1,
        Case::Tenth => count / 10,
        Case::Still | Case::Streamed | Case::Burst | Case::Views => 0,
    };
    let mut meshes = VecDeque::new();
    for index in 0..count {
        let place = Transform::from_xyz((index % side) as f32, 0.0, (index / side) as f32);
        let material = MeshMaterial3d(materials[index % materials.len()].clone());
        let mut mesh = world.spawn((Mesh3d(mesh.clone()), material, place));
        if index < moving {
            mesh.insert(Mover);
        }
        meshes.push_back(mesh.id());
    }
    let (count, every) = match case {
        Case::Streamed => (count / 10, 1),
        Case::Burst => (count / 10, BURST),
        _ => (0, 1),
    };
    world.insert_resource(Stream { count, every, meshes, next: 0, updates: 0 });
    let down = Transform::default().looking_to(Vec3::new(0.1, -1.0, 0.2), Vec3::X);
    world.spawn((DirectionalLight::default(), down));
    let eye = Transform::from_xyz(0.0, 3.0, 10.0);
    if has_gi {
        world.spawn((FrugalGi::default(), eye));
    } else {
        world.spawn((Camera3d::default(), eye));
    }
    for order in (0..2).filter(|_| has_views) {
        let size = side as f32;
        let above =
            Transform::from_xyz(0.5 * size, 50.0, 0.5 * size).looking_to(Vec3::NEG_Y, Vec3::X);
        let projection = OrthographicProjection {
            scaling_mode: ScalingMode::Fixed { width: 2.0 * size, height: 2.0 * size },
            ..OrthographicProjection::default_3d()
        };
        app.world_mut().spawn((
            Camera3d::default(),
            Camera { order: -1 - order, ..Default::default() },
            RenderTarget::None { size: UVec2::splat(64) },
            Projection::Orthographic(projection),
            above,
        ));
    }
    (1..WARM).for_each(|_| app.update());
    app
}

fn move_all(time: Res<Time>, mut movers: Query<&mut Transform, With<Mover>>) {
    for mut transform in &mut movers {
        transform.translation.y = (3.0 * time.elapsed_secs()).sin();
    }
}

/// Replaces the oldest meshes by new ones in each `every`th frame, `count` of them; the old ones go half as
/// many frames later.
#[derive(Resource)]
struct Stream {
    count: usize,
    every: usize,
    meshes: VecDeque<Entity>,
    next: usize,
    updates: usize,
}

fn stream(
    mut commands: Commands,
    mut stream: ResMut<Stream>,
    kinds: Query<(&Mesh3d, &MeshMaterial3d<StandardMaterial>)>,
) {
    let stream = &mut *stream;
    stream.updates += 1;
    // The first of the timed updates is one in which meshes come.
    let phase = (stream.updates + stream.every - WARM % stream.every) % stream.every;
    if phase == stream.every / 2 {
        for oldest in stream.meshes.drain(..stream.count) {
            commands.entity(oldest).despawn();
        }
    }
    if phase != 0 {
        return;
    }
    let Some(kind) = stream.meshes.back().and_then(|mesh| kinds.get(*mesh).ok()) else { return };
    for _ in 0..stream.count {
        let (x, z) = (stream.next % 100, stream.next / 100 % 100);
        let place = Transform::from_xyz(x as f32, 1.0, z as f32);
        stream.next += 1;
        stream.meshes.push_back(commands.spawn((kind.0.clone(), kind.1.clone(), place)).id());
    }
}

/// Milliseconds of an update.
fn timed(app: &mut App) -> f64 {
    let start = Instant::now();
    app.update();
    1e3 * start.elapsed().as_secs_f64()
}

fn main() {
    let arguments: Vec<String> =
        std::env::args().skip(1).filter(|word| !word.starts_with("--")).collect();
    let mut counts: Vec<usize> = arguments.iter().filter_map(|word| word.parse().ok()).collect();
    let is_wanted = |name: &str| {
        arguments.len() == counts.len() || arguments.iter().any(|argument| argument == name)
    };
    let cases: Vec<_> = CASES.into_iter().filter(|(name, _)| is_wanted(name)).collect();
    if counts.is_empty() {
        counts.push(MESHES);
    }
    println!("milliseconds per update, medians of {UPDATES}");
    println!("  meshes            without     with  GI adds  half of the differences");
    for (count, (name, case)) in
        counts.into_iter().flat_map(|count| cases.iter().map(move |case| (count, *case)))
    {
        let times = compare(case, count);
        let differences = times[2].clone();
        let [without, with, added] =
            times.map(|mut times| [0.25, 0.5, 0.75].map(|share| quantile(&mut times, share)));
        println!(
            "{count:8} {name:8} {:8.3} {:8.3} {:8.3}  {:.3} to {:.3}",
            without[1], with[1], added[1], added[0], added[2]
        );
        if matches!(case, Case::Burst) {
            let by_update = (0..BURST).map(|update| {
                let times = differences.iter().skip(update).step_by(BURST).copied();
                format!("{:.3}", median(times.collect()))
            });
            println!(
                "  GI adds in each update after a burst: {}",
                by_update.collect::<Vec<_>>().join(", ")
            );
        }
    }
}

/// Times of updates without GI, with it, and their differences, milliseconds.
fn compare(case: Case, count: usize) -> [Vec<f64>; 3] {
    let (mut without, mut with) = (crowd(case, count, false), crowd(case, count, true));
    let mut times = [const { Vec::new() }; 3];
    for update in 0..UPDATES {
        let (before, after) = if update % 2 == 0 {
            let before = timed(&mut without);
            (before, timed(&mut with))
        } else {
            let after = timed(&mut with);
            (timed(&mut without), after)
        };
        for (times, time) in times.iter_mut().zip([before, after, after - before]) {
            times.push(time);
        }
    }
    times
}
