//! Quality knobs: the available knobs ([`KnobSpace`]), a camera's levels ([`KnobSettings`]), and
//! the drivers that apply a level ([`KnobDriver`]).
//!
//! To add a knob, write a [`FieldKnob`] or a [`KnobDriver`] and register it with
//! [`RegisterKnob::register_knob`]; the built-in ones are listed in `builtin/mod.rs`.
//! [`WarmKnobs`] shows all levels behind a loading screen, so that no later switch waits for a
//! shader compiler.

mod builtin;
mod driver;
mod field;
mod overrides;
mod reconcile;
mod warm;

use std::sync::Arc;

use bevy::app::{App, Plugin, PostUpdate};
use bevy::camera::CameraUpdateSystems;
use bevy::ecs::prelude::*;
use bevy::reflect::Reflect;

pub use crate::schedule::KnobSystems;
pub use frugal_core::knobs::*;

pub(crate) use builtin::allow_authored;
pub use driver::{KnobDriver, KnobRegistry, RegisterKnob};
pub use field::{FieldKnob, KnobField};
pub use warm::WarmKnobs;
#[cfg(feature = "stage")]
pub(crate) use warm::levels_to_show;

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
    fn level(&self, knob: usize) -> &Level {
        let levels = &self.space.knobs()[knob].levels;
        &levels[self.settings.level(knob).min(levels.len() - 1)]
    }
}

/// The values applied for a camera's settings. Written by [`KnobPlugin`].
#[derive(Component, Clone, Debug, Default)]
pub struct AppliedKnobs {
    /// The knobs of `entries`.
    space: Arc<KnobSpace>,
    /// The registry's revision that `entries` refer to.
    registry: u64,
    /// One per knob of `space`.
    entries: Vec<AppliedKnob>,
}

#[derive(Clone, Copy, Debug)]
struct AppliedKnob {
    /// Index in the registry; `None` if the app lacks the knob.
    driver: Option<usize>,
    value: Option<f64>,
}

impl AppliedKnobs {
    /// The applied value of the knob called `name`, in the knob's unit; `None` if the camera's
    /// settings do not contain it, or the app has not registered it. For an
    /// [app-wide](KnobDriver::is_app_wide) knob, the highest among the active cameras, which may be
    /// above this camera's.
    pub fn value(&self, name: &str) -> Option<f64> {
        self.entries.get(self.space.index_of(name)?)?.value
    }

    /// Records the value of the knob of a driver, by its index in the registry.
    fn set_value(applied: &mut Mut<Self>, driver: usize, value: f64) {
        let is_it = |entry: &AppliedKnob| entry.driver == Some(driver);
        if let Some(index) = applied.entries.iter().position(is_it)
            && applied.entries[index].value != Some(value)
        {
            applied.entries[index].value = Some(value);
        }
    }
}

/// Registers the built-in knobs and adds the systems that apply [`KnobSettings`] and
/// [warm](WarmKnobs) them.
#[derive(Clone, Debug, Default)]
pub struct KnobPlugin;

impl Plugin for KnobPlugin {
    fn build(&self, app: &mut App) {
        app.register_type::<KnobSettings>()
            .configure_sets(PostUpdate, KnobSystems::Apply.before(CameraUpdateSystems))
            .add_systems(
                PostUpdate,
                reconcile::reconcile.run_if(reconcile::is_needed).in_set(KnobSystems::Apply),
            );
        builtin::build(app);
        warm::build(app);
    }

    fn finish(&self, app: &mut App) {
        crate::schedule::watch_pipelines(app);
    }
}
