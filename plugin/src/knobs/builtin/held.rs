//! What the app authored of a component that a knob changes, so that a release restores it.

use bevy::ecs::prelude::*;

/// A component that a knob adds, changes or removes.
pub(super) trait Authored: Component + Clone {
    /// Whether two values are the same.
    fn is_same(&self, other: &Self) -> bool;

    /// Called on a value that the app has changed while the knob held it at `written`: gives the
    /// part that the knob controls its `authored` value back, unless the app changed that part. By
    /// default the knob controls the whole component.
    fn take_back(&mut self, written: &Self, authored: &Self) {
        let _ = (written, authored);
    }
}

/// The authored value of a component under a knob; `None` means that it was absent.
#[derive(Component, Clone)]
pub(super) struct Held<C: Authored> {
    authored: Option<C>,
    /// The value that the knob wrote last.
    written: Option<C>,
}

impl<C: Authored> Held<C> {
    /// Changes the component, `current`, and the record of it.
    pub(super) fn rewrite(&mut self, current: &mut C, change: impl FnOnce(&mut C)) {
        change(current);
        self.written = Some(current.clone());
    }

    /// The authored value, where `current` is in the world now.
    fn authored(&self, current: Option<C>) -> Option<C> {
        match (current, &self.written) {
            (Some(current), Some(written)) if current.is_same(written) => self.authored.clone(),
            (Some(mut current), Some(written)) => {
                if let Some(authored) = &self.authored {
                    current.take_back(written, authored);
                }
                Some(current)
            }
            // The knob has removed it, and the app has not added it since.
            (None, None) => self.authored.clone(),
            // The app has added or removed it.
            (current, _) => current,
        }
    }
}

/// The authored value of `C`, held or not.
pub(super) fn authored<C: Authored>(world: &World, camera: Entity) -> Option<C> {
    let current = world.get::<C>(camera).cloned();
    match world.get::<Held<C>>(camera) {
        Some(held) => held.authored(current),
        None => current,
    }
}

/// Gives `camera` the value that `wanted` returns for the authored one; `None` removes it.
pub(super) fn hold<C: Authored>(
    world: &mut World,
    camera: Entity,
    wanted: impl FnOnce(Option<&C>) -> Option<C>,
) {
    let authored = authored::<C>(world, camera);
    let written = wanted(authored.as_ref());
    put(world, camera, &written);
    if let Ok(mut camera) = world.get_entity_mut(camera) {
        camera.insert(Held { authored, written });
    }
}

/// Whether the component is as [`hold`] left it; true if it was never held.
pub(super) fn is_held<C: Authored>(world: &World, camera: Entity) -> bool {
    let current = world.get::<C>(camera);
    world.get::<Held<C>>(camera).is_none_or(|held| match (&held.written, current) {
        (Some(written), Some(current)) => written.is_same(current),
        (written, current) => written.is_none() && current.is_none(),
    })
}

/// Restores the authored value.
pub(super) fn release<C: Authored>(world: &mut World, camera: Entity) {
    if world.get::<Held<C>>(camera).is_none() {
        return;
    }
    let authored = authored::<C>(world, camera);
    put(world, camera, &authored);
    if let Ok(mut camera) = world.get_entity_mut(camera) {
        camera.remove::<Held<C>>();
    }
}

fn put<C: Authored>(world: &mut World, camera: Entity, value: &Option<C>) {
    let Ok(mut camera) = world.get_entity_mut(camera) else { return };
    match (value, camera.get::<C>()) {
        (Some(value), Some(current)) if value.is_same(current) => {}
        (Some(value), _) => drop(camera.insert(value.clone())),
        (None, Some(_)) => drop(camera.remove::<C>()),
        (None, None) => {}
    }
}
