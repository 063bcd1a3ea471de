//! Whether there is light to gather. Without light, GI holds no buffers.

use bevy::ecs::prelude::*;

use crate::gi::settings::FrugalGi;

/// The kinds of light in the scene, in the main world. Written in
/// [`SceneSystems::Maps`](crate::gi::schedule::SceneSystems) and `Emissive`.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(in crate::gi) struct LightPresence {
    /// There are reflective shadow maps.
    pub maps: bool,
    /// There are texels of emissive surfaces.
    pub emissive: bool,
}

impl LightPresence {
    /// Whether a camera has light to gather: of lights, of emissive surfaces, or of its environment
    /// map where it has one.
    pub(crate) fn lights(&self, gi: &FrugalGi, has_environment_map: bool) -> bool {
        self.maps
            || gi.emissive && self.emissive
            || has_environment_map && gi.environment_samples > 0
    }
}
