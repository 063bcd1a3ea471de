//! Frontier maps of the examples that have one.

use std::path::Path;
use std::sync::Arc;

use bevy::prelude::*;
use bevy_frugal_gi::frontier::SceneIdentity;
use bevy_frugal_gi::prelude::*;
use frugal::scene::LoadedScene;

/// Reads the map at `path`.
///
/// # Errors
/// Why there is no map for `scene`, with the remedy, in lines of less than 80 characters or so.
pub fn read_map(path: &Path, scene: &LoadedScene) -> Result<FrontierMap, String> {
    let file = path.display();
    let text = std::fs::read_to_string(path)
        .map_err(|error| format!("no map: {file}\n{error}\n`make demo` writes one"))?;
    let map = FrontierMap::from_ron(&text).map_err(|error| format!("no map: {file}: {error}"))?;
    let fingerprint = scene.fingerprint().map_err(|error| error.to_string())?;
    let identity = SceneIdentity { name: scene.source.display().to_string(), fingerprint };
    map.matches_scene(&identity).map_err(|error| format!("no map: {file}: {error}"))?;
    Ok(map)
}

/// Range of power, and maximum error, over all points of a map.
#[derive(Clone, Copy, Debug, Default)]
pub struct BudgetRange {
    /// Power of the cheapest point, watts.
    pub least_power: Watts,
    /// Power of the most expensive point, watts.
    pub most_power: Watts,
    /// Largest error of a point, 1 − SSIM.
    pub most_error: f64,
}

impl BudgetRange {
    /// The range of `map`; zeros for a map without points.
    pub fn of(map: &FrontierMap) -> Self {
        let points = || map.octree.frontiers.iter().flat_map(|frontier| frontier.points());
        let powers = || points().map(|point| point.cost.power.0);
        Self {
            least_power: Watts(powers().reduce(f64::min).unwrap_or(0.0)),
            most_power: Watts(powers().reduce(f64::max).unwrap_or(0.0)),
            most_error: points().map(|point| point.cost.error).reduce(f64::max).unwrap_or(0.0),
        }
    }

    /// The power at `share` of the range, 0 to 1.
    pub fn power(&self, share: f64) -> Watts {
        self.least_power + (self.most_power - self.least_power) * share
    }
}

/// Puts a camera under the controller with this map, after its knobs are warmed.
#[derive(Component)]
pub struct MapWhenWarm(Handle<FrontierMap>);

/// Adds `map` to the app, and warms its knobs on `cameras`: the first switch to a level compiles
/// its shaders. After that the controller takes over, and the frame rate is held at the map's.
/// Power is energy per frame times frames per second, so the map's watts are valid at its own frame
/// rate only.
pub fn control(app: &mut App, map: FrontierMap, cameras: &[Entity]) {
    let knobs = Arc::new(map.knobs.clone());
    app.insert_resource(FrameRateLimit { hertz: Some(map.capture.frames_per_second) });
    let settings = map.settings();
    let map = app.world_mut().resource_mut::<Assets<FrontierMap>>().add(map);
    for camera in cameras {
        let warm = WarmKnobs::new(Arc::clone(&knobs)).with_settings(settings.iter().copied());
        let parts = (warm, MapWhenWarm(map.clone()));
        app.world_mut().entity_mut(*camera).insert(parts);
    }
    app.add_systems(Update, start_controller);
}

/// Puts `camera` under the map in `file`, with a power budget in the middle of its range, and holds the
/// map's frame rate. Without a map there is no budget to keep.
pub fn control_if_mapped(camera: &mut EntityCommands, file: &Path, maps: &mut Assets<FrontierMap>) {
    let text = std::fs::read_to_string(file).map_err(|error| error.to_string());
    match text.and_then(|text| FrontierMap::from_ron(&text).map_err(|error| error.to_string())) {
        Ok(map) => {
            let hertz = Some(map.capture.frames_per_second);
            camera.commands().insert_resource(FrameRateLimit { hertz });
            let budget = Budget::power(BudgetRange::of(&map).power(0.5));
            camera.insert((PowerController(maps.add(map)), budget));
        }
        Err(error) => info!("no map: {}: {error}", file.display()),
    }
}

/// Up and Down change power budgets by a tenth.
pub fn change_power_budget(keys: Res<ButtonInput<KeyCode>>, mut budgets: Query<&mut Budget>) {
    let step = if keys.just_pressed(KeyCode::ArrowUp) {
        1.1
    } else if keys.just_pressed(KeyCode::ArrowDown) {
        1.0 / 1.1
    } else {
        return;
    };
    for mut budget in &mut budgets {
        budget.power = budget.power.map(|power| Watts(power.0 * step));
    }
}

fn start_controller(
    mut commands: Commands,
    cameras: Query<(Entity, &MapWhenWarm), Without<WarmKnobs>>,
) {
    for (camera, MapWhenWarm(map)) in &cameras {
        let map = PowerController(map.clone());
        commands.entity(camera).insert(map).remove::<MapWhenWarm>();
    }
}

#[cfg(test)]
mod tests {
    use bevy::ecs::system::RunSystemOnce;

    use super::*;
    use crate::workspace_file;

    #[test]
    fn a_map_brings_its_frame_rate() {
        let file = workspace_file("docs/data/records/courtyard.pareto.ron");
        let mut world = World::new();
        world.init_resource::<Assets<FrontierMap>>();
        let control = move |mut commands: Commands, mut maps: ResMut<Assets<FrontierMap>>| {
            control_if_mapped(&mut commands.spawn_empty(), &file, &mut maps);
        };
        world.run_system_once(control).expect("a system");
        let (_, map) = world.resource::<Assets<FrontierMap>>().iter().next().expect("a map");
        let limit = world.get_resource::<FrameRateLimit>().expect("a limit");
        assert_eq!(limit.hertz, Some(map.capture.frames_per_second));
    }
}
