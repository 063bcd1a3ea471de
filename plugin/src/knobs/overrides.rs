//! What the app authored of a component that knobs write, so that a release restores it.

use bevy::ecs::component::Mutable;
use bevy::ecs::prelude::*;

/// The authored value of a component under knobs, and the value that they wrote last; `None` is an
/// absent component. Only fields with a [`Lens`] are kept up to date.
#[derive(Component, Clone)]
pub(super) struct Override<C: Component> {
    authored: Option<C>,
    pub written: Option<C>,
}

/// A field of a component, which one knob writes. Several fields of a component may have a knob
/// each, but a component that a knob removes should have no other.
pub(super) struct Lens<C, T> {
    pub read: fn(&C) -> T,
    pub write: fn(&mut C, T),
}

impl<C: Component<Mutability = Mutable> + Clone, T: PartialEq> Lens<C, T> {
    /// The record of the component. A field that differs from what was written is the app's.
    fn record(&self, world: &World, entity: Entity) -> Override<C> {
        let current = world.get::<C>(entity);
        let new = || Override { authored: current.cloned(), written: current.cloned() };
        let Some(mut record) = world.get::<Override<C>>(entity).cloned() else { return new() };
        match (current, &record.written) {
            (Some(current), Some(written)) => {
                let value = (self.read)(current);
                if value != (self.read)(written) {
                    let authored = record.authored.get_or_insert_with(|| current.clone());
                    (self.write)(authored, value);
                }
                record
            }
            // Removed by the knob.
            (None, None) => record,
            // Added or removed by the app.
            _ => new(),
        }
    }

    /// The component with the authored value of the field; `None` if the app gave `entity` none.
    pub(super) fn authored(&self, world: &World, entity: Entity) -> Option<C> {
        self.record(world, entity).authored
    }

    /// Gives the field the value that it has in `wanted` of the authored component. Adds the
    /// component where it is absent, and removes it for `None`.
    pub(super) fn set(
        &self,
        world: &mut World,
        entity: Entity,
        wanted: impl FnOnce(Option<&C>) -> Option<C>,
    ) {
        let mut record = self.record(world, entity);
        let wanted = wanted(record.authored.as_ref());
        let Ok(mut entity) = world.get_entity_mut(entity) else { return };
        match (&wanted, entity.get_mut::<C>()) {
            (Some(wanted), Some(mut current)) => {
                let value = (self.read)(wanted);
                // Change detection fires only for changes.
                if (self.read)(&current) != value {
                    (self.write)(&mut current, value);
                }
            }
            (Some(wanted), None) => drop(entity.insert(wanted.clone())),
            (None, Some(current)) => {
                // The other fields return as they are now.
                if let Some(authored) = &mut record.authored {
                    let value = (self.read)(authored);
                    authored.clone_from(&current);
                    (self.write)(authored, value);
                }
                entity.remove::<C>();
            }
            (None, None) => {}
        }
        match (&mut record.written, wanted) {
            (Some(written), Some(wanted)) => (self.write)(written, (self.read)(&wanted)),
            (written, wanted) => *written = wanted,
        }
        entity.insert(record);
    }

    /// Whether the field is as [`set`](Self::set) left it.
    pub(super) fn is_set(&self, world: &World, entity: Entity) -> bool {
        let current = world.get::<C>(entity);
        let written = world.get::<Override<C>>(entity).and_then(|record| record.written.as_ref());
        current.map(self.read) == written.map(self.read)
    }

    /// Restores the authored value.
    pub(super) fn release(&self, world: &mut World, entity: Entity) {
        if world.get::<Override<C>>(entity).is_some() {
            self.set(world, entity, |authored| authored.cloned());
        }
    }
}
