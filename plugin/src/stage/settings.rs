//! The settings of a stage's next frame.

use std::sync::Arc;

use bevy::app::App;
use bevy::diagnostic::FrameCount;
use bevy::ecs::world::World;

use super::level::Held;
use super::{Stage, StageError, camera};
use crate::gi::{CameraCut, FrugalGi};
use crate::knobs::{
    KnobDriver, KnobLevels, KnobPlugin, KnobRegistry, KnobSettings, KnobSpace, KnobSpaceError,
    Level,
};

/// Number of the first frame of a clip or run. More frames than any app has loaded with: Bevy takes an
/// object whose last change has a frame's number for one that moved in that frame.
const FIRST_FRAME: u32 = 1 << 20;

/// The space of the knobs called `names`, opt-in ones included.
///
/// # Errors
/// When a name is unknown: the error lists the opt-in knobs, too.
pub(super) fn named<'a>(
    registry: &KnobRegistry,
    names: impl IntoIterator<Item = &'a str>,
) -> Result<KnobSpace, KnobSpaceError> {
    let names: Vec<&str> = names.into_iter().collect();
    let is_known = |name: &str| registry.names().any(|known| known == name);
    if let Some(unknown) = names.iter().find(|name| !is_known(name)) {
        registry.space_with(|_| true)?.subset([*unknown])?;
    }
    registry.space_with(|name| names.contains(&name))?.subset(names.iter().copied())
}

impl Stage {
    /// Sets the knobs on offer, with a camera cut: the next frame has no temporal history.
    pub fn apply(&mut self, settings: KnobLevels) {
        self.switch(settings);
        self.cut();
    }

    /// Makes the next frame a camera cut.
    fn cut(&mut self) {
        self.app.world_mut().entity_mut(self.camera).insert(CameraCut);
        // Effects that draw random numbers by the frame's number draw the same in every clip and run.
        self.app.world_mut().insert_resource(FrameCount(FIRST_FRAME));
    }

    /// Sets the knobs on offer without a cut, as a controller does.
    pub fn switch(&mut self, settings: KnobLevels) {
        let space = Arc::clone(&self.space);
        // The space was checked when the stage was opened.
        let _ = self.insert_settings(space, settings);
    }

    /// Sets knobs from text with a camera cut: `max`, `min`, `default`, or `knob=level` pairs; the
    /// others on offer are set to their best. The text may name opt-in knobs. `default`: the levels of
    /// `FrugalGi::default()`.
    ///
    /// # Errors
    /// When the text has another form, or names an unknown knob or level.
    pub fn apply_text(&mut self, text: &str) -> Result<(), StageError> {
        self.switch_text(text)?;
        self.cut();
        Ok(())
    }

    /// As [`apply_text`](Self::apply_text), without a cut.
    ///
    /// # Errors
    /// As [`apply_text`](Self::apply_text).
    pub fn switch_text(&mut self, text: &str) -> Result<(), StageError> {
        let registry = self.app.world().resource::<KnobRegistry>();
        let offered = self.space.knobs().iter().map(|knob| knob.name.as_str());
        let names = text.split(',').filter_map(|part| Some(part.split_once('=')?.0.trim()));
        let space = named(registry, offered.chain(names))?;
        let parts = text.split(',').map(|part| match part.trim() {
            "default" => space.describe(default_settings(&space)),
            part => part.to_owned(),
        });
        let settings = space.parse(&parts.collect::<Vec<_>>().join(","))?;
        self.insert_settings(Arc::new(space), settings)
    }

    /// Applies `settings`, and the best levels of all knobs outside `space`: without them, those
    /// would return to what the camera was spawned with.
    pub(super) fn insert_settings(
        &mut self,
        space: Arc<KnobSpace>,
        settings: KnobLevels,
    ) -> Result<(), StageError> {
        let registry = self.app.world().resource::<KnobRegistry>();
        let all = registry.space_with(|name| space.index_of(name).is_some())?;
        let held = camera::overridden_knobs(&self.options);
        let names = all.knobs().iter().map(|knob| knob.name.as_str());
        let applied = all.subset(names.filter(|name| !held.contains(name)))?;
        let levels = applied.from_levels(|_, knob| {
            space.index_of(&knob.name).map_or(knob.levels.len() - 1, |index| settings.level(index))
        });
        let wanted = KnobSettings { space: Arc::new(applied), settings: levels };
        let world = self.app.world_mut();
        if let Some(mut held) = world.get_resource_mut::<Held>() {
            held.settings = Some(wanted.clone());
        }
        let mut camera = world.entity_mut(self.camera);
        if camera.get::<KnobSettings>() != Some(&wanted) {
            camera.insert(wanted);
        }
        Ok(())
    }
}

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
            "gi_bounces=all",
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
