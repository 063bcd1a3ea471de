//! A harbour at dusk, whose views differ as those of games do: `harbour [MAP]`.
//!
//! Look at the panel while the camera walks: water mirrors the evening sky, haze lies over the quay, lamps
//! light the lanes, and in the tavern burns one candle. Each asks for other settings. Up and Down change
//! a power budget, once there is a map; Space pauses the walk.
//!
//! `harbour --write-paths FOLDER` writes the walks that a map is made and judged with:
//!
//! ```sh
//! frugal precompute --app "cargo run --example harbour" --cameras target/harbour/tour.cameras \
//!     --size 96x54 --time-limit 2h -o target/harbour.pareto.ron
//! ```

mod builder;
mod paths;
mod quay;
mod sky;
mod surfaces;
mod town;

use std::path::{Path, PathBuf};

use bevy::anti_alias::smaa::Smaa;
use bevy::camera::Exposure;
use bevy::light::{CascadeShadowConfigBuilder, VolumetricFog, VolumetricLight};
use bevy::pbr::{ContactShadows, ScreenSpaceAmbientOcclusion, ScreenSpaceReflections};
use bevy::post_process::bloom::Bloom;
use bevy::prelude::*;
use bevy_frugal_gi::prelude::*;
use bevy_frugal_gi::stage::{StageCamera, on_stage};
use bevy_frugal_gi_tools::HudPlugin;
use frugal_examples::{ExamplePlugin, change_power_budget, control_if_mapped, workspace_file};

use builder::Builder;
use surfaces::Surfaces;

/// Vertical field of view, radians.
const FIELD_OF_VIEW: f32 = 1.05;
/// Far plane, metres: behind the hills on the other shore.
const FAR: f32 = 400.0;

fn main() -> AppExit {
    let mut arguments = std::env::args_os().skip(1);
    let first = arguments.next();
    if first.as_ref().is_some_and(|first| first == "--write-paths") {
        let folder =
            arguments.next().map_or_else(|| workspace_file("target/harbour"), PathBuf::from);
        return write_paths(&folder);
    }
    let map = first.map_or_else(|| workspace_file("target/harbour.pareto.ron"), PathBuf::from);
    let mut app = App::new();
    app.add_plugins((on_stage(DefaultPlugins), FrugalGiPlugins, HudPlugin))
        .add_plugins(ExamplePlugin { title: "harbour" })
        .insert_resource(GlobalAmbientLight::NONE)
        .insert_resource(Map(map))
        .insert_resource(Walk { poses: paths::tour(), seconds: 0.0, is_paused: false })
        .add_systems(Startup, (build, spawn_camera))
        .add_systems(Update, (walk, change_power_budget));
    app.run()
}

fn write_paths(folder: &Path) -> AppExit {
    match paths::write(folder, FIELD_OF_VIEW) {
        Ok(()) => AppExit::Success,
        Err(error) => {
            eprintln!("{}: {error}", folder.display());
            AppExit::error()
        }
    }
}

/// The map's file.
#[derive(Resource)]
struct Map(PathBuf);

fn build(
    commands: Commands,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
    mut images: ResMut<Assets<Image>>,
) {
    let surfaces = Surfaces::new(&mut materials, &mut images);
    let mut builder = Builder { commands, meshes: &mut meshes, surfaces };
    quay::build(&mut builder);
    town::build(&mut builder);
    let sun = DirectionalLight {
        color: Color::srgb(1.0, 0.62, 0.34),
        illuminance: 2600.0,
        shadow_maps_enabled: true,
        contact_shadows_enabled: true,
        ..default()
    };
    let cascades = CascadeShadowConfigBuilder { maximum_distance: 110.0, ..default() }.build();
    let down = Transform::default().looking_to(-sky::TO_SUN, Vec3::Y);
    builder.commands.spawn((sun, VolumetricLight, cascades, down));
}

fn spawn_camera(
    mut commands: Commands,
    map: Res<Map>,
    walk: Res<Walk>,
    mut maps: ResMut<Assets<FrontierMap>>,
    mut images: ResMut<Assets<Image>>,
) {
    let lens = PerspectiveProjection { fov: FIELD_OF_VIEW, far: FAR, ..default() };
    let place = walk.poses.first().map_or_else(Transform::default, |pose| pose.1);
    // What the map's knobs turn: a knob adds none by itself.
    let effects = (
        ScreenSpaceReflections {
            // Water is smoother than the surfaces that Bevy leaves out.
            min_perceptual_roughness: 0.02..0.05,
            linear_steps: 24,
            bisection_steps: 5,
            thickness: 1.0,
            ..default()
        },
        ContactShadows::default(),
        VolumetricFog { ambient_intensity: 0.0, ..default() },
        ScreenSpaceAmbientOcclusion::default(),
        Smaa::default(),
        Bloom::NATURAL,
    );
    let mut camera = commands.spawn((
        (Camera3d::default(), Msaa::Off, FrugalGi::default(), StageCamera, place),
        (Projection::Perspective(lens), Exposure { ev100: 7.6 }),
        sky::sky(&mut images),
        effects,
    ));
    control_if_mapped(&mut camera, &map.0, &mut maps);
}

/// The camera's walk, which begins anew at its end.
#[derive(Resource)]
struct Walk {
    /// By seconds since the start.
    poses: Vec<(f32, Transform)>,
    seconds: f32,
    is_paused: bool,
}

fn walk(
    keys: Res<ButtonInput<KeyCode>>,
    time: Res<Time>,
    mut walk: ResMut<Walk>,
    mut camera: Single<&mut Transform, With<StageCamera>>,
) {
    walk.is_paused ^= keys.just_pressed(KeyCode::Space);
    // Time stands still while the tool places the camera.
    if walk.is_paused || time.delta_secs() == 0.0 {
        return;
    }
    let end = walk.poses.last().map_or(0.0, |last| last.0);
    walk.seconds += time.delta_secs();
    if walk.seconds > end {
        walk.seconds = 0.0;
    }
    // The plugin notices the cuts between walks by itself.
    let next = walk.poses.partition_point(|pose| pose.0 <= walk.seconds).max(1);
    if let [from, to] = walk.poses[next - 1..(next + 1).min(walk.poses.len())] {
        let share = (walk.seconds - from.0) / (to.0 - from.0);
        camera.translation = from.1.translation.lerp(to.1.translation, share);
        camera.rotation = from.1.rotation.slerp(to.1.rotation, share);
    }
}
