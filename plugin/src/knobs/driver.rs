//! How a knob's level becomes the app's state, and the registry of all knobs.

use std::sync::Arc;

use bevy::app::App;
use bevy::ecs::prelude::*;

use super::{Knob, KnobSpace, KnobSpaceError, Level};

/// Whose state a knob changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum KnobScope {
    /// One camera's.
    Camera,
    /// The whole app's. With several cameras, the highest level that any of them asks for holds.
    App,
}

/// Puts a knob's level into effect.
pub trait KnobDriver: Send + Sync + 'static {
    /// Name and levels.
    fn knob(&self) -> Knob;

    /// Whose state it changes.
    fn scope(&self) -> KnobScope {
        KnobScope::Camera
    }

    /// Whether the knob is only turned where somebody names it: because it changes what a picture
    /// aims at rather than how near it comes. A map, a search and the best settings leave it alone
    /// otherwise.
    fn is_by_name_only(&self) -> bool {
        false
    }

    /// Sets `level`. Called only when the level differs from the last one applied to `camera`.
    ///
    /// `camera` exists and has a camera. Must not panic when what the knob works on is missing: it
    /// then has no effect.
    fn apply(&self, world: &mut World, camera: Entity, level: &Level);
}

/// Every knob that the app has.
#[derive(Resource, Clone, Default)]
pub struct KnobRegistry {
    drivers: Vec<Arc<dyn KnobDriver>>,
}

impl KnobRegistry {
    /// Adds a knob. One of the same name is replaced, in place.
    pub fn add(&mut self, driver: impl KnobDriver) {
        let name = driver.knob().name;
        let driver: Arc<dyn KnobDriver> = Arc::new(driver);
        match self.drivers.iter_mut().find(|old| old.knob().name == name) {
            Some(old) => *old = driver,
            None => self.drivers.push(driver),
        }
    }

    /// The driver of the knob called `name`.
    pub fn get(&self, name: &str) -> Option<&Arc<dyn KnobDriver>> {
        self.drivers.iter().find(|driver| driver.knob().name == name)
    }

    /// The knobs that need not be named, in the order of registration.
    ///
    /// # Errors
    /// When there are too many, or one has no sound levels.
    pub fn space(&self) -> Result<KnobSpace, KnobSpaceError> {
        self.space_with(|_| false)
    }

    /// The same, and of the others those whose names `is_named` says are.
    ///
    /// # Errors
    /// When there are too many, or one has no sound levels.
    pub fn space_with(&self, is_named: impl Fn(&str) -> bool) -> Result<KnobSpace, KnobSpaceError> {
        let offered = self.drivers.iter().map(|driver| (driver.knob(), driver.is_by_name_only()));
        KnobSpace::new(
            offered
                .filter(|(knob, by_name)| !by_name || is_named(&knob.name))
                .map(|(knob, _)| knob)
                .collect(),
        )
    }
}

/// Registers knobs on an app.
pub trait RegisterKnob {
    /// Adds a knob of your own.
    fn register_knob(&mut self, driver: impl KnobDriver) -> &mut Self;
}

impl RegisterKnob for App {
    fn register_knob(&mut self, driver: impl KnobDriver) -> &mut Self {
        self.world_mut().get_resource_or_init::<KnobRegistry>().add(driver);
        self
    }
}
