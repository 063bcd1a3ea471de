//! Whether there is any light to gather: where there is none, nothing is kept for it.

use bevy::ecs::prelude::*;
use bevy::ecs::system::SystemParam;

use super::rsm::RsmView;
use super::settings::FrugalGi;
use super::sources::GiEmitters;

/// What lights the scene, in the main world. Systems that ask must come after
/// [`RsmSystems::Maintain`](super::rsm::RsmSystems) and
/// [`EmittersSystems`](super::sources::EmittersSystems).
#[derive(SystemParam)]
pub(super) struct LightPresence<'w, 's> {
    maps: Query<'w, 's, (), With<RsmView>>,
    emitters: Res<'w, GiEmitters>,
}

impl LightPresence<'_, '_> {
    /// Whether a camera has light to gather, be it of lamps, of what glows, or of its environment
    /// map where it has one.
    pub fn lights(&self, gi: &FrugalGi, has_environment_map: bool) -> bool {
        !self.maps.is_empty()
            || gi.emissive && self.emitters.texel_count() > 0
            || has_environment_map && gi.environment_samples > 0
    }
}
