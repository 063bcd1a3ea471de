//! Applies the settings of cameras, and releases what no settings contain any more.
//!
//! Every frame compares what was applied with what is there, so that a component that the app adds
//! or overwrites, and a camera that becomes active, get their levels. Nothing is allocated or
//! written while nothing differs.

use std::sync::Arc;

use bevy::camera::Camera;
use bevy::ecs::prelude::*;
use bevy::log::warn_once;

use super::{AppliedKnob, AppliedKnobs, KnobRegistry, KnobSettings};

/// What [`reconcile`] keeps from frame to frame.
#[derive(Default)]
pub(super) struct Reconciled {
    /// The active cameras of this frame.
    active: Vec<(Entity, KnobSettings)>,
    /// The camera whose level was applied, and its value, for each knob of app scope; by the index
    /// in the registry.
    app: Vec<Option<(Entity, f64)>>,
    /// The registry's revision that `app` refers to.
    registry: u64,
}

/// Whether a camera has settings, or had some in the last frame, or there is a new knob. An
/// exclusive system waits for all others, so it does not run for nothing.
pub(super) fn is_needed(
    cameras: Query<(), Or<(With<KnobSettings>, With<AppliedKnobs>)>>,
    registry: Res<KnobRegistry>,
    mut had_any: Local<bool>,
) -> bool {
    let has_any = !cameras.is_empty();
    std::mem::replace(&mut *had_any, has_any) || has_any || registry.is_changed()
}

pub(super) fn reconcile(
    world: &mut World,
    cameras: &mut QueryState<(Entity, &KnobSettings, &Camera)>,
    abandoned: &mut QueryState<Entity, (With<AppliedKnobs>, Without<KnobSettings>)>,
    mut state: Local<Reconciled>,
) {
    let registry = world.resource::<KnobRegistry>().clone();
    let abandoned: Vec<Entity> = abandoned.iter(world).collect();
    for camera in abandoned {
        if let Some(applied) = world.entity_mut(camera).take::<AppliedKnobs>() {
            release(world, &registry, camera, &applied, |_| true);
        }
    }
    state.active.clear();
    let active = cameras.iter(world).filter(|(.., camera)| camera.is_active);
    state.active.extend(active.map(|(entity, settings, _)| (entity, settings.clone())));
    for (camera, settings) in &state.active {
        reconcile_camera(world, &registry, *camera, settings);
    }
    reconcile_app(world, &registry, &mut state);
}

/// Applies the knobs of one camera.
fn reconcile_camera(
    world: &mut World,
    registry: &KnobRegistry,
    camera: Entity,
    settings: &KnobSettings,
) {
    let applied = world.get::<AppliedKnobs>(camera);
    if !applied.is_some_and(|applied| {
        Arc::ptr_eq(&applied.space, &settings.space) && applied.registry == registry.revision()
    }) {
        let old = applied.cloned().unwrap_or_default();
        let new = adopt(registry, &old, settings);
        release(world, registry, camera, &old, |name| new.space.index_of(name).is_none());
        if let Ok(mut camera) = world.get_entity_mut(camera) {
            camera.insert(new);
        }
    }
    for knob in 0..settings.space.len() {
        // A driver may have despawned the camera.
        let Some(applied) = world.get::<AppliedKnobs>(camera) else { return };
        let AppliedKnob { driver: Some(index), value } = applied.entries[knob] else { continue };
        let (known, level) = (&registry.drivers()[index], settings.level(knob));
        let is_current = value == Some(level.value);
        if known.is_app_wide || (is_current && known.driver.is_applied(world, camera, level)) {
            continue;
        }
        known.driver.apply(world, camera, level);
        if let Some(mut applied) = world.get_mut::<AppliedKnobs>(camera) {
            AppliedKnobs::set_value(&mut applied, index, level.value);
        }
    }
}

/// The entries of `old` for the knobs of `settings`.
fn adopt(registry: &KnobRegistry, old: &AppliedKnobs, settings: &KnobSettings) -> AppliedKnobs {
    // Another driver of the same name has applied nothing yet.
    let same_drivers = old.registry == registry.revision();
    let entry = |name: &str| {
        let driver = registry.drivers().iter().position(|known| known.name == name);
        if driver.is_none() {
            warn_once!("knob `{name}` is not registered in this app and is ignored");
        }
        AppliedKnob { driver, value: old.value(name).filter(|_| same_drivers) }
    };
    AppliedKnobs {
        space: Arc::clone(&settings.space),
        registry: registry.revision(),
        entries: settings.space.knobs().iter().map(|knob| entry(&knob.name)).collect(),
    }
}

/// Restores what was authored of the knobs of one camera for whose name `is_released` is true.
fn release(
    world: &mut World,
    registry: &KnobRegistry,
    camera: Entity,
    applied: &AppliedKnobs,
    is_released: impl Fn(&str) -> bool,
) {
    for known in registry.drivers() {
        if !known.is_app_wide && applied.value(&known.name).is_some() && is_released(&known.name) {
            known.driver.release(world, camera);
        }
    }
}

/// Applies, for every knob of app scope, the highest level among the active cameras.
fn reconcile_app(world: &mut World, registry: &KnobRegistry, state: &mut Reconciled) {
    if state.registry != registry.revision() {
        state.registry = registry.revision();
        state.app = vec![None; registry.drivers().len()];
    }
    for (index, known) in registry.drivers().iter().enumerate() {
        if !known.is_app_wide {
            continue;
        }
        let applied = &mut state.app[index];
        let wanted = state.active.iter().filter_map(|(camera, settings)| {
            Some((*camera, settings.level(settings.space.index_of(&known.name)?)))
        });
        let wanted = wanted.reduce(|a, b| if b.1.value > a.1.value { b } else { a });
        let Some((camera, level)) = wanted else {
            if let Some((camera, _)) = applied.take() {
                known.driver.release(world, camera);
            }
            continue;
        };
        if applied.is_none_or(|(_, value)| value != level.value)
            || !known.driver.is_applied(world, camera, level)
        {
            known.driver.apply(world, camera, level);
        }
        *applied = Some((camera, level.value));
        for (camera, _) in &state.active {
            if let Some(mut applied) = world.get_mut::<AppliedKnobs>(*camera) {
                AppliedKnobs::set_value(&mut applied, index, level.value);
            }
        }
    }
}

#[cfg(test)]
#[path = "reconcile_tests.rs"]
mod tests;
