//! The settings of an app that sets nothing.

use bevy::app::App;
use bevy_frugal_gi::gi::FrugalGi;
use bevy_frugal_gi::knobs::{KnobPlugin, KnobRegistry};
use frugal_core::knobs::{KnobLevels, KnobSpace};

/// The levels nearest to `FrugalGi::default()`, and the best of every other knob.
pub(crate) fn default_settings(space: &KnobSpace) -> KnobLevels {
    let mut app = App::new();
    app.add_plugins(KnobPlugin);
    let camera = app.world_mut().spawn(FrugalGi::default()).id();
    let world = app.world();
    let registry = world.resource::<KnobRegistry>();
    // Of a field of the component one level is applied, of all else every level or none.
    let default = |name: &str| {
        let driver = registry.get(name)?;
        let mut levels = driver.knob().levels;
        let count = levels.len();
        levels.retain(|level| driver.is_applied(world, camera, level));
        (levels.len() < count).then(|| levels.first().map(|level| level.value)).flatten()
    };
    space.from_levels(|_, knob| {
        let nearest = default(&knob.name).and_then(|value| {
            let far = |level: &usize| (knob.levels[*level].value - value).abs();
            (0..knob.levels.len()).min_by(|a, b| far(a).total_cmp(&far(b)))
        });
        nearest.unwrap_or(knob.levels.len() - 1)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_is_the_component_s_own_and_the_best_of_all_else() {
        let space = crate::stage::every_knob().expect("the built-in knobs");
        let text = space.describe(default_settings(&space));
        for part in [
            "gi_vpl_count=1024",
            "gi_pixel_fraction=1/4",
            "gi_interleave=4x4",
            "gi_visibility=coarse",
            "gi_environment_samples=16",
            "rsm_resolution=128",
            "gi_bounces=1",
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
        let camera = app.world_mut().spawn(FrugalGi::default()).id();
        let registry = app.world().resource::<KnobRegistry>();
        for name in registry.names() {
            let driver = registry.get(name).expect("a driver");
            let levels = driver.knob().levels;
            let is_applied = |level| driver.is_applied(app.world(), camera, level);
            let applied = levels.iter().filter(|level| is_applied(level)).count();
            assert!(applied == 1 || applied == levels.len(), "{name}: {applied}");
        }
    }
}
