//! Drivers, which apply a knob's level to the app's state, and the registry of all knobs.

use std::sync::Arc;

use bevy::app::App;
use bevy::ecs::prelude::*;

use super::{Knob, KnobSpace, KnobSpaceError, Level};

/// Applies a knob's levels.
pub trait KnobDriver: Send + Sync + 'static {
    /// The knob's name, levels and dependency. Must return the same knob at every call.
    fn knob(&self) -> Knob;

    /// Whether it changes state of the whole app, to which the highest level of all active cameras is
    /// applied; by default that of one camera.
    fn is_app_wide(&self) -> bool {
        false
    }

    /// Whether the knob is opt-in: part of a space only where it is named explicitly. For knobs
    /// that change the target image, not the approximation quality. Maps, searches and the best
    /// settings leave it unchanged otherwise. Default: false.
    fn is_opt_in(&self) -> bool {
        false
    }

    /// Applies `level`. Called when its value differs from the one last applied to `camera`, or to
    /// the app for an [app-wide](Self::is_app_wide) knob, and when [`is_applied`](Self::is_applied) is
    /// false.
    ///
    /// `camera` is an existing entity with a `Camera`. Must not panic when the component or
    /// resource that the knob changes is missing: the knob then has no effect. Should add no effect
    /// that the app did not author, such as bloom on a camera without it.
    fn apply(&self, world: &mut World, camera: Entity, level: &Level);

    /// Whether the state is as [`apply`](Self::apply) left it at `level`: false where the app has
    /// added or overwritten the component that the knob changes. Called once per camera and frame,
    /// so it should take some nanoseconds and must not allocate. True by default.
    fn is_applied(&self, world: &World, camera: Entity, level: &Level) -> bool {
        let _ = (world, camera, level);
        true
    }

    /// Restores what the app had authored, when the camera's settings no longer contain the knob.
    /// For an [app-wide](Self::is_app_wide) knob, when no active camera's do; `camera`, which had the
    /// highest level, may then no longer exist. Leaves the last level by default.
    fn release(&self, world: &mut World, camera: Entity) {
        let _ = (world, camera);
    }
}

/// A driver, with its name and whether it is app-wide, which are asked for once.
#[derive(Clone)]
pub(super) struct Registered {
    pub name: String,
    pub is_app_wide: bool,
    pub driver: Arc<dyn KnobDriver>,
}

/// All knobs of the app, in the order of registration. A map that sets other knobs is rejected
/// ([`OffReason::UnknownKnobs`](crate::control::OffReason::UnknownKnobs)). Without this resource
/// every map is accepted.
#[derive(Resource, Clone, Default)]
pub struct KnobRegistry {
    /// Shared, so that systems can keep it while drivers have the world.
    drivers: Arc<Vec<Registered>>,
    /// Number of additions and replacements.
    revision: u64,
}

impl KnobRegistry {
    /// Adds a knob. Replaces a knob of the same name, in place.
    pub fn add(&mut self, driver: impl KnobDriver) {
        let new = Registered {
            name: driver.knob().name,
            is_app_wide: driver.is_app_wide(),
            driver: Arc::new(driver),
        };
        let drivers = Arc::make_mut(&mut self.drivers);
        match drivers.iter_mut().find(|old| old.name == new.name) {
            Some(old) => *old = new,
            None => drivers.push(new),
        }
        self.revision += 1;
    }

    /// The driver of the knob called `name`; `None` if none is registered.
    pub fn get(&self, name: &str) -> Option<&Arc<dyn KnobDriver>> {
        self.drivers.iter().find(|known| known.name == name).map(|known| &known.driver)
    }

    /// Names of all knobs, opt-in ones included, in the order of registration.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.drivers.iter().map(|known| known.name.as_str())
    }

    /// The first knob of `space` that this app has not registered; `None` when all are known.
    pub fn first_unknown<'a>(&self, space: &'a KnobSpace) -> Option<&'a str> {
        let mut names = space.knobs().iter().map(|knob| knob.name.as_str());
        names.find(|name| self.get(name).is_none())
    }

    /// Whether a knob called `name` is registered and [app-wide](KnobDriver::is_app_wide).
    pub(crate) fn is_app_wide(&self, name: &str) -> bool {
        self.drivers.iter().any(|known| known.name == name && known.is_app_wide)
    }

    pub(super) fn drivers(&self) -> &[Registered] {
        &self.drivers
    }

    pub(super) fn revision(&self) -> u64 {
        self.revision
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
        KnobSpace::new(
            self.drivers
                .iter()
                .filter(|known| !known.driver.is_opt_in() || is_named(&known.name))
                .map(|known| known.driver.knob())
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
