//! Two cameras side by side under one power limit: `split_screen [SCENE] [MAP]`.
//!
//! Look at the two panels: each camera has a frontier and settings of its own, and the sum of their
//! predicted powers is within the app's limit. Up and Down change the limit by 5 % of its range. L
//! and R give one camera four times the other's priority, and with it a share of the other's watts;
//! E makes them equal.
//!
//! The map is that of `make demo`, or another machine's before it was run. It was made for one image of
//! the window's size, which the panels say.

use std::path::Path;

use bevy::anti_alias::smaa::Smaa;
use bevy::camera::{Exposure, Viewport};
use bevy::core_pipeline::Skybox;
use bevy::light::EnvironmentMapLight;
use bevy::pbr::ScreenSpaceAmbientOcclusion;
use bevy::post_process::bloom::Bloom;
use bevy::prelude::*;
use bevy_frugal_gi::control::CameraPriority;
use bevy_frugal_gi::prelude::*;
use bevy_frugal_gi_tools::HudPlugin;
use frugal::scene;
use frugal_examples::{
    BudgetRange, ExamplePlugin, Tour, add_ui_camera, caption, control, courtyard_map, read_map,
    run, scene_plugins,
};

fn main() -> AppExit {
    run(courtyard_map(), build)
}

fn build(scene: &Path, map: &Path) -> Result<App, String> {
    let scene = scene::load(scene).map_err(|error| error.to_string())?;
    let map = read_map(map, &scene)?;
    let mut app = App::new();
    app.add_plugins((scene_plugins(), FrugalGiPlugins, HudPlugin));
    app.add_plugins(ExamplePlugin { title: "split_screen" });
    add_ui_camera(&mut app);

    // One camera at the start of the scene's first path, the other at that of its last.
    let first = scene.paths.values().next();
    let paths = first.zip(scene.paths.values().next_back());
    let (first, last) = paths.ok_or_else(|| format!("{}: no path", scene.source.display()))?;
    let [left, right] = [("left", first), ("right", last)].map(|(name, path)| {
        let camera = (
            Camera3d::default(),
            Camera { order: isize::from(name == "right"), ..default() },
            Msaa::Off,
            FrugalGi::default(),
            (ScreenSpaceAmbientOcclusion::default(), Smaa::default(), Bloom::NATURAL),
            (Tour::new(path).transform(), Name::new(name), CameraPriority::default()),
        );
        app.world_mut().spawn((camera, Half { is_right: name == "right" })).id()
    });
    frugal::stage::populate(app.world_mut(), &scene, left).map_err(|error| error.to_string())?;
    // The scene's lens, exposure and sky, for the other camera, too.
    app.world_mut()
        .entity_mut(left)
        .clone_components::<(Projection, Exposure, EnvironmentMapLight, Skybox)>(right);

    let limit = AppLimit { range: BudgetRange::of(&map), share: 0.5 };
    control(&mut app, map, &[left, right]);
    app.world_mut().spawn(caption("Up, Down: limit   L, R, E: priority   F3: panels"));
    app.insert_resource(limit).add_systems(Update, (split, turn, change_limit, change_priority));
    Ok(app)
}

/// Which half of the window a camera has.
#[derive(Component)]
struct Half {
    is_right: bool,
}

fn split(window: Single<&Window, Changed<Window>>, mut cameras: Query<(&mut Camera, &Half)>) {
    let [width, height] = window.physical_size().to_array();
    // A minimised window has no pixels.
    if width < 2 || height == 0 {
        return;
    }
    for (mut camera, half) in &mut cameras {
        camera.viewport = Some(Viewport {
            physical_position: UVec2::new(if half.is_right { width / 2 } else { 0 }, 0),
            physical_size: UVec2::new(width / 2, height),
            ..default()
        });
    }
}

/// Turns the right camera, so that its frontier changes.
fn turn(time: Res<Time>, mut cameras: Query<(&mut Transform, &Half), Without<WarmKnobs>>) {
    for (mut transform, half) in &mut cameras {
        if half.is_right {
            transform.rotate_y(0.3 * time.delta_secs());
        }
    }
}

/// The power limit of both cameras together.
#[derive(Resource)]
struct AppLimit {
    range: BudgetRange,
    /// Position in the range, 0 to 1.
    share: f64,
}

fn change_limit(
    keys: Res<ButtonInput<KeyCode>>,
    mut limit: ResMut<AppLimit>,
    mut budget: ResMut<AppBudget>,
) {
    if keys.just_pressed(KeyCode::ArrowUp) {
        limit.share = (limit.share + 0.05).min(1.0);
    }
    if keys.just_pressed(KeyCode::ArrowDown) {
        limit.share = (limit.share - 0.05).max(0.0);
    }
    budget.set_if_neq(AppBudget { power: Some(limit.range.power(limit.share) * 2.0) });
}

fn change_priority(
    keys: Res<ButtonInput<KeyCode>>,
    mut cameras: Query<(&mut CameraPriority, &Half)>,
) {
    let [left, right] = match keys.get_just_pressed().next() {
        Some(KeyCode::KeyL) => [4.0, 1.0],
        Some(KeyCode::KeyR) => [1.0, 4.0],
        Some(KeyCode::KeyE) => [1.0, 1.0],
        _ => return,
    };
    for (mut priority, half) in &mut cameras {
        priority.0 = if half.is_right { right } else { left };
    }
}
