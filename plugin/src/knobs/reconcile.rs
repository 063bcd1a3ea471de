//! Keeps the state of cameras and app as their settings say.
//!
//! Every frame compares what was applied with what is there, which takes some nanoseconds a knob.
//! Options:
//! 1. Apply when settings change. A component that is added or overwritten later keeps another
//!    level than the settings say, and so does a camera that was inactive.
//! 2. Apply every level in every frame. Change detection would fire for every component.
//! 3. Compare, and apply what differs.
//!
//! We use option 3. Nothing is allocated or written while nothing differs.

use std::sync::Arc;

use bevy::camera::Camera;
use bevy::ecs::prelude::*;
use bevy::log::warn_once;

use super::driver::Registered;
use super::{KnobRegistry, KnobScope, KnobSettings, KnobSpace, KnownKnobs, Level};

/// The values applied for a camera's settings. Written by [`KnobPlugin`](super::KnobPlugin).
#[derive(Component, Clone, Debug, Default)]
pub struct AppliedKnobs {
    /// The knobs of `entries`.
    space: Arc<KnobSpace>,
    /// The registry's revision that `entries` refer to.
    registry: u64,
    entries: Vec<Entry>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Entry {
    /// Index in the registry; `None` if the app lacks the knob.
    driver: Option<usize>,
    scope: KnobScope,
    value: Option<f64>,
}

impl AppliedKnobs {
    /// The applied value of the knob called `name`, in the knob's unit; `None` if the camera's
    /// settings do not contain it, or the app has not registered it. For a knob of [app
    /// scope](KnobScope::App), the highest among the active cameras, which may be above this
    /// camera's.
    pub fn value(&self, name: &str) -> Option<f64> {
        self.entries.get(self.space.index_of(name)?)?.value
    }

    /// Whether the entries refer to `space` and `registry`.
    fn is_for(&self, space: &Arc<KnobSpace>, registry: &KnobRegistry) -> bool {
        Arc::ptr_eq(&self.space, space) && self.registry == registry.revision()
    }
}

/// A knob of app scope.
struct AppKnob {
    driver: usize,
    /// The camera with the highest level, and that level's value.
    wanted: Option<(Entity, f64)>,
    /// The camera whose level was applied, and its value.
    applied: Option<(Entity, f64)>,
}

/// What [`reconcile`] keeps from frame to frame.
#[derive(Default)]
pub(super) struct Reconciled {
    /// The active cameras of this frame.
    active: Vec<(Entity, KnobSettings)>,
    app: Vec<AppKnob>,
    registry: u64,
}

/// Whether a camera has settings, or had some in the last frame, or there is a new knob. An exclusive
/// system waits for all others, so it does not run for nothing.
pub(super) fn is_needed(
    cameras: Query<(), Or<(With<KnobSettings>, With<AppliedKnobs>)>>,
    registry: Res<KnobRegistry>,
    mut had_any: Local<bool>,
) -> bool {
    let has_any = !cameras.is_empty();
    std::mem::replace(&mut *had_any, has_any) || has_any || registry.is_changed()
}

/// Applies what differs from the settings of active cameras, and releases what no settings contain
/// any more.
pub(super) fn reconcile(
    world: &mut World,
    cameras: &mut QueryState<(Entity, &KnobSettings, &Camera)>,
    abandoned: &mut QueryState<Entity, (With<AppliedKnobs>, Without<KnobSettings>)>,
    mut state: Local<Reconciled>,
) {
    let state = &mut *state;
    let released: Vec<Entity> = abandoned.iter(world).collect();
    for camera in released {
        release_camera(world, camera);
    }
    state.active.clear();
    for (entity, settings, camera) in cameras.iter(world) {
        if camera.is_active {
            state.active.push((entity, settings.clone()));
        }
    }
    for (entity, settings) in &state.active {
        if !is_camera_current(world, *entity, settings) {
            apply_to_camera(world, *entity, settings);
        }
    }
    reconcile_app(world, state);
}

/// The level of the `knob`-th knob of `settings`; those beyond its last count as the last.
fn level_of(settings: &KnobSettings, knob: usize) -> &Level {
    let levels = &settings.space.knobs()[knob].levels;
    &levels[settings.settings.level(knob).min(levels.len() - 1)]
}

fn is_camera_current(world: &World, camera: Entity, settings: &KnobSettings) -> bool {
    let registry = world.resource::<KnobRegistry>();
    let Some(applied) = world.get::<AppliedKnobs>(camera) else { return false };
    applied.is_for(&settings.space, registry)
        && applied.entries.iter().enumerate().all(|(knob, entry)| {
            let Some(driver) = entry.driver else { return true };
            let level = level_of(settings, knob);
            entry.scope == KnobScope::App
                || (entry.value == Some(level.value)
                    && registry.drivers()[driver].driver.is_applied(world, camera, level))
        })
}

fn apply_to_camera(world: &mut World, camera: Entity, settings: &KnobSettings) {
    let registry = world.resource::<KnobRegistry>().clone();
    let mut applied = world.get::<AppliedKnobs>(camera).cloned().unwrap_or_default();
    if !applied.is_for(&settings.space, &registry) {
        applied = adopt(world, camera, &applied, &settings.space, &registry);
    }
    for (knob, entry) in applied.entries.iter_mut().enumerate() {
        let (Some(driver), KnobScope::Camera) = (entry.driver, entry.scope) else { continue };
        let (level, driver) = (level_of(settings, knob), &registry.drivers()[driver].driver);
        if entry.value != Some(level.value) || !driver.is_applied(world, camera, level) {
            driver.apply(world, camera, level);
            entry.value = Some(level.value);
        }
    }
    if let Ok(mut camera) = world.get_entity_mut(camera) {
        camera.insert(applied);
    }
}

/// The entries of `old` for the knobs of `space`; the other knobs are released.
fn adopt(
    world: &mut World,
    camera: Entity,
    old: &AppliedKnobs,
    space: &Arc<KnobSpace>,
    registry: &KnobRegistry,
) -> AppliedKnobs {
    // Another driver of the same name has applied nothing yet.
    let same_drivers = old.registry == registry.revision();
    let entry = |name: &str| {
        let driver = registry.drivers().iter().position(|known| known.name == name);
        if driver.is_none() {
            warn_once!("knob `{name}` is not registered in this app and is ignored");
        }
        let scope = driver.map_or(KnobScope::Camera, |driver| registry.drivers()[driver].scope);
        let value = old.value(name).filter(|_| same_drivers);
        Entry { driver, scope, value }
    };
    let entries = space.knobs().iter().map(|knob| entry(&knob.name)).collect();
    for (knob, entry) in old.space.knobs().iter().zip(&old.entries) {
        if space.index_of(&knob.name).is_none() && entry.scope == KnobScope::Camera {
            release(world, camera, registry, &knob.name, entry);
        }
    }
    AppliedKnobs { space: Arc::clone(space), registry: registry.revision(), entries }
}

fn release(world: &mut World, camera: Entity, registry: &KnobRegistry, name: &str, entry: &Entry) {
    if entry.value.is_some()
        && let Some(driver) = registry.get(name)
    {
        driver.release(world, camera);
    }
}

/// Restores what was authored of a camera without settings.
fn release_camera(world: &mut World, camera: Entity) {
    let registry = world.resource::<KnobRegistry>().clone();
    let Some(applied) = world.entity_mut(camera).take::<AppliedKnobs>() else { return };
    for (knob, entry) in applied.space.knobs().iter().zip(&applied.entries) {
        if entry.scope == KnobScope::Camera {
            release(world, camera, &registry, &knob.name, entry);
        }
    }
}

/// Applies, for every knob of app scope, the highest level among the active cameras.
fn reconcile_app(world: &mut World, state: &mut Reconciled) {
    let Reconciled { active, app, registry: revision } = state;
    let registry = world.resource::<KnobRegistry>();
    if *revision != registry.revision() {
        *revision = registry.revision();
        let is_app = |(_, known): &(usize, &Registered)| known.scope == KnobScope::App;
        let of_app = registry.drivers().iter().enumerate().filter(is_app);
        *app = of_app.map(|(driver, _)| AppKnob { driver, wanted: None, applied: None }).collect();
        let known = KnownKnobs::of(registry);
        if world.get_resource::<KnownKnobs>().is_some_and(|old| *old != known) {
            world.insert_resource(known);
        }
    }
    for knob in app.iter_mut() {
        knob.wanted = None;
    }
    for (camera, settings) in active.iter() {
        let Some(applied) = world.get::<AppliedKnobs>(*camera) else { continue };
        for (index, entry) in applied.entries.iter().enumerate() {
            if entry.scope == KnobScope::Camera {
                continue;
            }
            let value = level_of(settings, index).value;
            let asked = app.iter_mut().find(|knob| Some(knob.driver) == entry.driver);
            if let Some(knob) = asked
                && knob.wanted.is_none_or(|(_, other)| value > other)
            {
                knob.wanted = Some((*camera, value));
            }
        }
    }
    for knob in app.iter_mut() {
        reconcile_app_knob(world, active, knob);
    }
}

fn reconcile_app_knob(world: &mut World, active: &[(Entity, KnobSettings)], knob: &mut AppKnob) {
    let known = &world.resource::<KnobRegistry>().drivers()[knob.driver];
    let Some((camera, value)) = knob.wanted else {
        if let Some((camera, _)) = knob.applied.take() {
            let driver = Arc::clone(&known.driver);
            driver.release(world, camera);
        }
        return;
    };
    let level = active
        .iter()
        .find(|(entity, _)| *entity == camera)
        .and_then(|(_, settings)| Some(level_of(settings, settings.space.index_of(&known.name)?)));
    let Some(level) = level else { return };
    if knob.applied.map(|(_, value)| value) != Some(value)
        || !known.driver.is_applied(world, camera, level)
    {
        let driver = Arc::clone(&known.driver);
        driver.apply(world, camera, level);
    }
    knob.applied = Some((camera, value));
    for (camera, _) in active {
        let Some(mut applied) = world.get_mut::<AppliedKnobs>(*camera) else { continue };
        let entry = applied.entries.iter().position(|entry| entry.driver == Some(knob.driver));
        if let Some(entry) = entry
            && applied.entries[entry].value != Some(value)
        {
            applied.entries[entry].value = Some(value);
        }
    }
}

#[cfg(test)]
#[path = "reconcile_tests.rs"]
mod tests;
