//! The settings of a stage's next frame.

use std::sync::Arc;

use bevy::diagnostic::FrameCount;

use super::default_settings::default_settings;
use super::level::Held;
use super::{Stage, StageError, camera};
use crate::gi::CameraCut;
use crate::knobs::{KnobLevels, KnobRegistry, KnobSettings, KnobSpace, KnobSpaceError};

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
        Held::settings(world, &wanted);
        let mut camera = world.entity_mut(self.camera);
        if camera.get::<KnobSettings>() != Some(&wanted) {
            camera.insert(wanted);
        }
        Ok(())
    }
}
