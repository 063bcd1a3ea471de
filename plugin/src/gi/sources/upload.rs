//! Texels of what glows, on their way into the store.

use std::sync::Arc;

use bevy::ecs::prelude::*;
use bevy::render::render_resource::BufferId;
use bevy::render::renderer::RenderQueue;

use super::emissive::GiEmitters;
use crate::gi::rsm::{RsmStore, TEXEL_BYTES, Texel};

/// What the store was last given: which buffer, behind how many texels of maps, and what.
type Given = (BufferId, u32, Vec<Arc<Vec<Texel>>>);

/// Writes texels of what glows behind those of the maps, when they changed or the store did.
pub(in crate::gi) fn upload_emitters(
    mut given: Local<Option<Given>>,
    store: Res<RsmStore>,
    emitters: Res<GiEmitters>,
    queue: Res<RenderQueue>,
) {
    let Some(buffer) = store.texels.as_ref().filter(|_| emitters.texel_count() > 0) else {
        *given = None;
        return;
    };
    let is_same = |(id, first, sets): &Given| {
        *id == buffer.id()
            && *first == store.map_texels
            && sets.len() == emitters.texels().count()
            && sets.iter().zip(emitters.texels()).all(|(old, new)| Arc::ptr_eq(old, new))
    };
    if given.as_ref().is_some_and(is_same) {
        return;
    }
    let mut offset = u64::from(store.map_texels) * TEXEL_BYTES;
    for texels in emitters.texels() {
        let bytes: &[u8] = bytemuck::cast_slice(texels);
        if !bytes.is_empty() {
            queue.write_buffer(buffer, offset, bytes);
        }
        offset += bytes.len() as u64;
    }
    *given = Some((buffer.id(), store.map_texels, emitters.texels().map(Arc::clone).collect()));
}
