//! The knobs that an app has, by name.

use std::collections::BTreeSet;

use bevy::ecs::prelude::*;
use bevy::ecs::reflect::ReflectResource;
use bevy::prelude::ReflectDefault;
use bevy::reflect::Reflect;

use super::{KnobRegistry, KnobSpace};

/// Names of the knobs that this app has registered. A map that sets other knobs is rejected
/// ([`OffReason::UnknownKnobs`](crate::control::OffReason::UnknownKnobs)). Without this resource every map is accepted.
#[derive(Resource, Clone, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Resource, Default, Clone, Debug, PartialEq)]
pub struct KnownKnobs(pub BTreeSet<String>);

impl KnownKnobs {
    /// The names of all knobs of `registry`.
    pub fn of(registry: &KnobRegistry) -> Self {
        Self(registry.names().map(str::to_owned).collect())
    }

    /// The first knob of `space` that this app has not registered; `None` when all are known.
    pub fn first_unknown<'a>(&self, space: &'a KnobSpace) -> Option<&'a str> {
        space.knobs().iter().map(|knob| knob.name.as_str()).find(|name| !self.0.contains(*name))
    }
}
