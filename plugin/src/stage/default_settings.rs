//! The settings of an app that sets nothing.

use bevy::app::App;
use bevy::ecs::world::World;

use crate::gi::FrugalGi;
use crate::knobs::{KnobDriver, KnobLevels, KnobPlugin, KnobRegistry, KnobSpace, Level};

/// The levels of `FrugalGi::default()`, and the best of every other knob.
pub fn default_settings(space: &KnobSpace) -> KnobLevels {
    let mut app = App::new();
    app.add_plugins(KnobPlugin);
    let registry = app.world().resource::<KnobRegistry>();
    let default = |name: &str| {
        let driver = registry.get(name)?;
        let mut levels = driver.knob().levels;
        let count = levels.len();
        levels.retain(|level| leaves_the_default(&**driver, level));
        // What is no field of the component is left by every level.
        (levels.len() < count).then(|| levels.first().map(|level| level.value)).flatten()
    };
    space.from_levels(|_, knob| {
        let is_default = |value: f64| knob.levels.iter().position(|level| level.value == value);
        default(&knob.name).and_then(is_default).unwrap_or(knob.levels.len() - 1)
    })
}

/// Whether `level` leaves a camera's `FrugalGi::default()` as it is.
fn leaves_the_default(driver: &dyn KnobDriver, level: &Level) -> bool {
    let mut world = World::new();
    let camera = world.spawn(FrugalGi::default()).id();
    driver.apply(&mut world, camera, level);
    world.get::<FrugalGi>(camera) == Some(&FrugalGi::default())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_is_the_component_s_own_and_the_best_of_all_else() {
        let mut app = App::new();
        app.add_plugins(KnobPlugin);
        let registry = app.world().resource::<KnobRegistry>();
        let space = registry.space_with(|_| true).expect("the built-in knobs");
        let text = space.describe(default_settings(&space));
        for part in [
            "gi_vpl_count=1024",
            "gi_pixel_fraction=1/4",
            "gi_interleave=4x4",
            "gi_visibility=coarse",
            "gi_environment_samples=16",
            "rsm_resolution=128",
            "gi_bounces=3",
            "gi_refresh_period=1",
            "resolution_scale=100%",
        ] {
            assert!(text.contains(part), "{part} in {text}");
        }
    }

    #[test]
    fn every_value_of_the_component_is_a_level_of_its_knob() {
        let mut app = App::new();
        app.add_plugins(KnobPlugin);
        let registry = app.world().resource::<KnobRegistry>();
        for name in registry.names() {
            let driver = registry.get(name).expect("a driver");
            let levels = driver.knob().levels;
            let left = levels.iter().filter(|level| leaves_the_default(&**driver, level)).count();
            assert!(left == 1 || left == levels.len(), "{name}: {left}");
        }
    }
}
