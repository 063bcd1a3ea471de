//! Drivers, which apply a knob's level to the app's state, and the registry of all knobs.

use std::sync::Arc;

use bevy::app::App;
use bevy::ecs::prelude::*;

use super::{Knob, KnobSpace, KnobSpaceError, Level};

/// Scope of the state that a knob changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum KnobScope {
    /// One camera.
    Camera,
    /// The whole app. With several active cameras, the highest of their levels is applied.
    App,
}

/// Applies a knob's levels.
pub trait KnobDriver: Send + Sync + 'static {
    /// The knob's name, levels and dependency. Must return the same knob at every call.
    fn knob(&self) -> Knob;

    /// Scope of the state that it changes; one camera by default.
    fn scope(&self) -> KnobScope {
        KnobScope::Camera
    }

    /// Whether the knob is opt-in: part of a space only where it is named explicitly. For knobs
    /// that change the target image, not the approximation quality. Maps, searches and the best
    /// settings leave it unchanged otherwise. Default: false.
    fn is_opt_in(&self) -> bool {
        false
    }

    /// Applies `level`, one of [`knob`](Self::knob)'s. Called only when it differs from the level
    /// last applied to `camera`, or to the app for a knob of [app scope](KnobScope::App).
    ///
    /// `camera` is an existing entity with a `Camera`. Must not panic when the component or
    /// resource that the knob changes is missing: the knob then has no effect.
    fn apply(&self, world: &mut World, camera: Entity, level: &Level);
}

/// All knobs of the app, in the order of registration.
#[derive(Resource, Clone, Default)]
pub struct KnobRegistry {
    drivers: Vec<Arc<dyn KnobDriver>>,
}

impl KnobRegistry {
    /// Adds a knob. Replaces a knob of the same name, in place.
    pub fn add(&mut self, driver: impl KnobDriver) {
        let name = driver.knob().name;
        let driver: Arc<dyn KnobDriver> = Arc::new(driver);
        match self.drivers.iter_mut().find(|old| old.knob().name == name) {
            Some(old) => *old = driver,
            None => self.drivers.push(driver),
        }
    }

    /// The driver of the knob called `name`; `None` if none is registered.
    pub fn get(&self, name: &str) -> Option<&Arc<dyn KnobDriver>> {
        self.drivers.iter().find(|driver| driver.knob().name == name)
    }

    /// The space of all knobs that are not opt-in, in the order of registration.
    ///
    /// # Errors
    /// [`KnobSpaceError`] when there are more knobs than settings can pack, or one has invalid
    /// levels.
    pub fn space(&self) -> Result<KnobSpace, KnobSpaceError> {
        self.space_with(|_| false)
    }

    /// The space of all knobs that are not opt-in, and of the opt-in knobs for which `is_named` is
    /// true, in the order of registration.
    ///
    /// # Errors
    /// [`KnobSpaceError`] when there are more knobs than settings can pack, or one has invalid
    /// levels.
    pub fn space_with(&self, is_named: impl Fn(&str) -> bool) -> Result<KnobSpace, KnobSpaceError> {
        let offered = self.drivers.iter().map(|driver| (driver.knob(), driver.is_opt_in()));
        KnobSpace::new(
            offered
                .filter(|(knob, opt_in)| !opt_in || is_named(&knob.name))
                .map(|(knob, _)| knob)
                .collect(),
        )
    }
}

/// Registers knobs on an app.
pub trait RegisterKnob {
    /// Adds the knob of `driver`, or replaces the one of the same name. See [`KnobRegistry::add`].
    fn register_knob(&mut self, driver: impl KnobDriver) -> &mut Self;
}

impl RegisterKnob for App {
    fn register_knob(&mut self, driver: impl KnobDriver) -> &mut Self {
        self.world_mut().get_resource_or_init::<KnobRegistry>().add(driver);
        self
    }
}
