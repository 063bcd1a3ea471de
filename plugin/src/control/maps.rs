//! Loaded maps, checked once, and the store that a camera's frontiers come from.

use std::collections::HashMap;
use std::sync::Arc;

use bevy::asset::{AssetEvent, AssetId, AssetServer, Assets, LoadState};
use bevy::ecs::prelude::*;

use super::{ControlStatus, FrontierSource, OffReason, PowerController};
use crate::frontier::{Frontier, FrontierMap, FrontierStore, SampleRef};
use crate::knobs::{KnobRegistry, KnobSpace};

/// Computed once per map: its knobs, shared by all cameras, or the reason why it cannot be used.
type Prepared = Result<Arc<KnobSpace>, (OffReason, String)>;

/// Cache of checked maps, so that nothing is checked or allocated per frame.
#[derive(Resource, Default)]
pub(super) struct PreparedMaps(HashMap<AssetId<FrontierMap>, Prepared>);

impl PreparedMaps {
    fn get(
        &mut self,
        id: AssetId<FrontierMap>,
        map: &FrontierMap,
        known: Option<&KnobRegistry>,
    ) -> &Prepared {
        self.0.entry(id).or_insert_with(|| {
            map.validate().map_err(|error| (OffReason::MapInvalid, error.to_string()))?;
            match unknown(&map.knobs, known) {
                Some(name) => Err((OffReason::UnknownKnobs, message_of(name))),
                None => Ok(Arc::new(map.knobs.clone())),
            }
        })
    }
}

fn unknown<'a>(space: &'a KnobSpace, known: Option<&KnobRegistry>) -> Option<&'a str> {
    known.and_then(|known| known.first_unknown(space))
}

fn message_of(unknown_knob: &str) -> String {
    format!(
        "the map sets knob `{unknown_knob}`, which this app has not registered: register it, or precompute without it"
    )
}

/// Invalidates the cache of maps that changed or were removed, and all of it when the known knobs
/// change.
pub(super) fn forget_changed_maps(
    mut events: MessageReader<AssetEvent<FrontierMap>>,
    known: Option<Res<KnobRegistry>>,
    mut prepared: ResMut<PreparedMaps>,
) {
    for event in events.read() {
        match event {
            AssetEvent::Added { id }
            | AssetEvent::Modified { id }
            | AssetEvent::Removed { id }
            | AssetEvent::Unused { id } => drop(prepared.0.remove(id)),
            AssetEvent::LoadedWithDependencies { .. } => {}
        }
    }
    if known.is_some_and(|known| known.is_changed()) {
        prepared.0.clear();
    }
}

/// The frontier from which the controller chooses at a view. Where the scene has left its map
/// ([`PowerFeedback::has_left_map`](super::PowerFeedback::has_left_map)), that is the frontier over
/// all views, since local ones no longer apply.
pub fn frontier_in_play<'a>(
    store: &'a dyn FrontierStore,
    found: SampleRef<'a>,
    has_left_map: bool,
) -> &'a Frontier {
    store.overall().filter(|_| has_left_map).unwrap_or(found.frontier)
}

/// Why a camera's frontiers cannot be used: its status, with a message unless `logged` is that
/// status already. Nothing is formatted in every frame.
pub(super) type Refusal = (ControlStatus, Option<String>);

pub(super) fn refuse(
    logged: ControlStatus,
    reason: OffReason,
    message: impl FnOnce() -> String,
) -> Refusal {
    let status = ControlStatus::Off(reason);
    (status, (status != logged).then(message))
}

/// The store of a camera's frontiers and its knob space; no message while they are loading.
pub(super) fn source_of<'a>(
    (handle, source): (Option<&PowerController>, Option<&'a FrontierSource>),
    maps: &'a Assets<FrontierMap>,
    server: Option<&AssetServer>,
    prepared: &mut PreparedMaps,
    known: Option<&KnobRegistry>,
    logged: ControlStatus,
) -> Result<(&'a dyn FrontierStore, Arc<KnobSpace>), Refusal> {
    if let Some(source) = source {
        return match unknown(source.space(), known) {
            None => Ok((source.store(), Arc::clone(source.space()))),
            Some(name) => Err(refuse(logged, OffReason::UnknownKnobs, || message_of(name))),
        };
    }
    let Some(id) = handle.map(|handle| handle.0.id()) else {
        return Err((ControlStatus::Waiting, None));
    };
    let Some(map) = maps.get(id) else {
        return Err(match server.and_then(|server| server.get_load_state(id)) {
            Some(LoadState::Failed(error)) => {
                refuse(logged, OffReason::MapNotLoaded, || error.to_string())
            }
            _ => (ControlStatus::Waiting, None),
        });
    };
    match prepared.get(id, map, known) {
        Ok(space) => Ok((map, Arc::clone(space))),
        Err((reason, message)) => Err(refuse(logged, *reason, || message.clone())),
    }
}
