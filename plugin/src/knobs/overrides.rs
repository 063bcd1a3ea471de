//! What the app authored of a component that knobs write, so that a release restores it.

use bevy::ecs::component::Mutable;
use bevy::ecs::prelude::*;

/// What is kept of a component under knobs. `None` is an absent component. Of each value only the
/// fields that knobs write are up to date. The bound on `C` lets Bevy clone it with a camera.
#[derive(Component, Clone)]
pub(super) struct Override<C: Component + Clone> {
    authored: Option<C>,
    pub written: Option<C>,
    /// Whether a knob has removed the component, which was `written` then.
    is_removed: bool,
}

/// Access to a field of a component that a knob writes.
pub(super) struct Field<C, T>(pub fn(&mut C) -> &mut T);

impl<C: Component<Mutability = Mutable> + Clone, T: PartialEq + Clone> Field<C, T> {
    /// Reads from a clone, so that one accessor both reads and writes.
    fn get(&self, component: &C) -> T {
        (self.0)(&mut component.clone()).clone()
    }

    /// The record of the component. A field that differs from what was written is the app's.
    fn record(&self, world: &World, entity: Entity) -> Override<C> {
        let current = world.get::<C>(entity);
        match (current, world.get::<Override<C>>(entity)) {
            (
                Some(current),
                Some(Override { authored, written: Some(written), is_removed: false }),
            ) => {
                let (value, mut authored) = (self.get(current), authored.clone());
                if value != self.get(written) {
                    *(self.0)(authored.get_or_insert_with(|| current.clone())) = value;
                }
                Override { authored, written: Some(written.clone()), is_removed: false }
            }
            (None, Some(record)) if record.is_removed => record.clone(),
            // Not written yet, or added or removed by the app since.
            _ => Override {
                authored: current.cloned(),
                written: current.cloned(),
                is_removed: false,
            },
        }
    }

    /// The component with the authored value of the field; `None` if the app gave `entity` none.
    pub(super) fn authored(&self, world: &World, entity: Entity) -> Option<C> {
        self.authored_of(&self.record(world, entity), world.get::<C>(entity))
    }

    fn authored_of(&self, record: &Override<C>, current: Option<&C>) -> Option<C> {
        let value = self.get(record.authored.as_ref()?);
        let mut component = current.or(record.written.as_ref())?.clone();
        *(self.0)(&mut component) = value;
        Some(component)
    }

    /// Gives the field the value that it has in `wanted` of the authored component. Adds the
    /// component where it is absent, and removes it for `None`.
    pub(super) fn set(
        &self,
        world: &mut World,
        entity: Entity,
        wanted: impl FnOnce(Option<C>) -> Option<C>,
    ) {
        let mut record = self.record(world, entity);
        let wanted = wanted(self.authored_of(&record, world.get::<C>(entity)));
        let Ok(mut entity) = world.get_entity_mut(entity) else { return };
        let current = entity.get_mut::<C>();
        record.is_removed = wanted.is_none() && (current.is_some() || record.is_removed);
        match (wanted, current) {
            (Some(wanted), Some(mut current)) => {
                let value = self.get(&wanted);
                // Change detection fires only for changes.
                if self.get(&current) != value {
                    *(self.0)(&mut current) = value.clone();
                }
                *(self.0)(record.written.get_or_insert(wanted)) = value;
            }
            (Some(wanted), None) => {
                record.written = Some(wanted.clone());
                entity.insert(wanted);
            }
            (None, Some(current)) => {
                record.written = Some(current.clone());
                entity.remove::<C>();
            }
            (None, None) => {}
        }
        entity.insert(record);
    }

    /// Whether the field is as [`set`](Self::set) left it.
    pub(super) fn is_set(&self, world: &World, entity: Entity) -> bool {
        let current = world.get::<C>(entity).map(|current| self.get(current));
        let record = world.get::<Override<C>>(entity).filter(|record| !record.is_removed);
        current
            == record.and_then(|record| record.written.as_ref()).map(|written| self.get(written))
    }

    /// Restores the authored value.
    pub(super) fn release(&self, world: &mut World, entity: Entity) {
        if world.get::<Override<C>>(entity).is_some() {
            self.set(world, entity, |authored| authored);
        }
    }
}
