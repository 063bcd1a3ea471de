//! The settings of one camera: those asked for, and those applied.

use std::sync::Arc;

use bevy::ecs::prelude::*;
use bevy::ecs::reflect::ReflectComponent;
use bevy::reflect::Reflect;

use super::{KnobLevels, KnobSpace, Level};

/// The levels of this camera's knobs, applied whenever they change. Set by the app, or by the
/// controller.
///
/// Knobs outside `space` keep the app's own setting.
#[derive(Component, Clone, Debug, PartialEq, Reflect)]
#[reflect(Component, Clone, Debug, PartialEq)]
pub struct KnobSettings {
    /// The knobs that `settings` refers to.
    pub space: Arc<KnobSpace>,
    /// One level per knob of `space`. A level beyond a knob's last counts as the last.
    pub settings: KnobLevels,
}

impl KnobSettings {
    /// The level of the `knob`-th knob.
    pub(super) fn level(&self, knob: usize) -> &Level {
        let levels = &self.space.knobs()[knob].levels;
        &levels[self.settings.level(knob).min(levels.len() - 1)]
    }
}

/// The values applied for a camera's settings. Written by [`KnobPlugin`](super::KnobPlugin).
#[derive(Component, Clone, Debug, Default)]
pub struct AppliedKnobs {
    /// The knobs of `entries`.
    pub(super) space: Arc<KnobSpace>,
    /// The registry's revision that `entries` refer to.
    pub(super) registry: u64,
    /// One per knob of `space`.
    pub(super) entries: Vec<AppliedKnob>,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct AppliedKnob {
    /// Index in the registry; `None` if the app lacks the knob.
    pub driver: Option<usize>,
    pub value: Option<f64>,
}

impl AppliedKnobs {
    /// The applied value of the knob called `name`, in the knob's unit; `None` if the camera's
    /// settings do not contain it, or the app has not registered it. For a knob of [app
    /// scope](super::KnobScope::App), the highest among the active cameras, which may be above this
    /// camera's.
    pub fn value(&self, name: &str) -> Option<f64> {
        self.entries.get(self.space.index_of(name)?)?.value
    }

    /// Records the value of the knob of a driver, by its index in the registry.
    pub(super) fn set_value(applied: &mut Mut<Self>, driver: usize, value: f64) {
        let is_it = |entry: &AppliedKnob| entry.driver == Some(driver);
        if let Some(index) = applied.entries.iter().position(is_it)
            && applied.entries[index].value != Some(value)
        {
            applied.entries[index].value = Some(value);
        }
    }
}
