//! A knob that writes fields of components or resources.

use bevy::ecs::component::Mutable;
use bevy::ecs::prelude::*;

use super::overrides::Field;
use super::{Knob, KnobDriver, Level};

/// A field of a component or resource `C`, of type `T`, that a knob writes.
pub struct KnobField<C, T> {
    field: Field<C, T>,
    value: fn(&Level, T) -> T,
    /// The component at a level, from the authored one.
    wanted: fn(&Self, &Level, Option<C>) -> Option<C>,
    /// The entity with the component, from the camera.
    owner: fn(&World, Entity) -> Option<Entity>,
    is_app_wide: bool,
}

impl<C: Component<Mutability = Mutable> + Clone, T: PartialEq + Clone + 'static> KnobField<C, T> {
    /// A field of the camera's component `C`; without effect on a camera that lacks it.
    ///
    /// `field` borrows the field. It is called on a clone once per frame, so `C` should be cheap to
    /// clone. `value` takes a level and the value that the app authored, and returns the value to
    /// write: the smaller of both, for example, or a share of the authored one.
    pub fn new(field: fn(&mut C) -> &mut T, value: fn(&Level, T) -> T) -> Self {
        Self {
            field: Field(field),
            value,
            wanted: |field, level, authored| Some(field.at(level, authored?)),
            owner: |_, camera| Some(camera),
            is_app_wide: false,
        }
    }

    /// Levels of value 0 remove the component.
    #[must_use]
    pub fn removed_at_zero(mut self) -> Self {
        self.wanted = |field, level, authored| {
            let authored = authored.filter(|_| level.value != 0.0)?;
            Some(field.at(level, authored))
        };
        self
    }

    /// Adds the component's default to a camera that lacks it.
    #[must_use]
    pub fn added(mut self) -> Self
    where
        C: Default,
    {
        self.wanted = |field, level, authored| Some(field.at(level, authored.unwrap_or_default()));
        self
    }

    /// `C` is a resource, and the knob is [app-wide](KnobDriver::is_app_wide). Without effect in an
    /// app that lacks it.
    #[must_use]
    pub fn of_resource(mut self) -> Self
    where
        C: Resource,
    {
        self.owner = |world, _| world.resource_entities().get(world.component_id::<C>()?);
        self.is_app_wide = true;
        self
    }

    fn at(&self, level: &Level, mut component: C) -> C {
        let field = (self.field.0)(&mut component);
        *field = (self.value)(level, field.clone());
        component
    }
}

/// A field of any type.
trait AnyField: Send + Sync {
    fn is_app_wide(&self) -> bool;
    fn apply(&self, world: &mut World, camera: Entity, level: &Level);
    fn is_applied(&self, world: &World, camera: Entity) -> bool;
    fn release(&self, world: &mut World, camera: Entity);
}

impl<C: Component<Mutability = Mutable> + Clone, T: PartialEq + Clone> AnyField
    for KnobField<C, T>
{
    fn is_app_wide(&self) -> bool {
        self.is_app_wide
    }

    fn apply(&self, world: &mut World, camera: Entity, level: &Level) {
        if let Some(owner) = (self.owner)(world, camera) {
            self.field.set(world, owner, |authored| (self.wanted)(self, level, authored));
        }
    }

    fn is_applied(&self, world: &World, camera: Entity) -> bool {
        (self.owner)(world, camera).is_none_or(|owner| self.field.is_set(world, owner))
    }

    fn release(&self, world: &mut World, camera: Entity) {
        if let Some(owner) = (self.owner)(world, camera) {
            self.field.release(world, owner);
        }
    }
}

/// A knob that writes [fields](KnobField) of components or resources, and restores what the app
/// authored.
///
/// ```
/// use bevy::prelude::*;
/// use bevy_frugal_gi::knobs::{FieldKnob, Knob, KnobField};
///
/// #[derive(Component, Clone)]
/// struct Grass {
///     blades: u32,
/// }
///
/// let knob = FieldKnob::new(
///     Knob::new("grass", [0.0, 1000.0, 8000.0]),
///     KnobField::new(
///         |grass: &mut Grass| &mut grass.blades,
///         |level, authored| authored.min(level.value as u32),
///     ),
/// );
/// ```
pub struct FieldKnob {
    knob: Knob,
    is_opt_in: bool,
    fields: Vec<Box<dyn AnyField>>,
}

impl FieldKnob {
    /// A knob that writes `field`.
    pub fn new<C, T>(knob: Knob, field: KnobField<C, T>) -> Self
    where
        C: Component<Mutability = Mutable> + Clone,
        T: PartialEq + Clone + 'static,
    {
        Self { knob, is_opt_in: false, fields: Vec::new() }.and(field)
    }

    /// Writes `field`, too. Fields of one knob should have the same scope.
    #[must_use]
    pub fn and<C, T>(mut self, field: KnobField<C, T>) -> Self
    where
        C: Component<Mutability = Mutable> + Clone,
        T: PartialEq + Clone + 'static,
    {
        self.fields.push(Box::new(field));
        self
    }

    /// Makes the knob [opt-in](KnobDriver::is_opt_in).
    #[must_use]
    pub fn opt_in(mut self) -> Self {
        self.is_opt_in = true;
        self
    }
}

impl KnobDriver for FieldKnob {
    fn knob(&self) -> Knob {
        self.knob.clone()
    }

    fn is_app_wide(&self) -> bool {
        self.fields.iter().any(|field| field.is_app_wide())
    }

    fn is_opt_in(&self) -> bool {
        self.is_opt_in
    }

    fn apply(&self, world: &mut World, camera: Entity, level: &Level) {
        self.fields.iter().for_each(|field| field.apply(world, camera, level));
    }

    fn is_applied(&self, world: &World, camera: Entity, _: &Level) -> bool {
        self.fields.iter().all(|field| field.is_applied(world, camera))
    }

    fn release(&self, world: &mut World, camera: Entity) {
        self.fields.iter().for_each(|field| field.release(world, camera));
    }
}
