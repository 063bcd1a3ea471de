//! Uploads the texels of emissive surfaces into the store.

use std::sync::Arc;

use bevy::ecs::prelude::*;
use bevy::render::render_resource::BufferId;
use bevy::render::renderer::RenderQueue;

use super::emitters::GiEmitters;
use crate::gi::texels::{TEXEL_BYTES, Texel, TexelRange, TexelStore};

/// The last upload: the buffer, the index of the first texel, and the texels.
type Uploaded = (BufferId, u32, Vec<Arc<Vec<Texel>>>);

pub(super) fn reserve(mut store: ResMut<TexelStore>, emitters: Res<GiEmitters>) {
    store.reserve(TexelRange::Emissive, emitters.texel_count());
}

/// Writes the texels when they changed or the store did.
pub(super) fn upload(
    mut uploaded: Local<Option<Uploaded>>,
    mut store: ResMut<TexelStore>,
    emitters: Res<GiEmitters>,
    queue: Res<RenderQueue>,
) {
    let Some(buffer) = store.texels.clone().filter(|_| emitters.texel_count() > 0) else {
        *uploaded = None;
        return;
    };
    let first = store.first(TexelRange::Emissive);
    let is_same = |(id, old_first, sets): &Uploaded| {
        *id == buffer.id()
            && *old_first == first
            && sets.len() == emitters.texels().count()
            && sets.iter().zip(emitters.texels()).all(|(old, new)| Arc::ptr_eq(old, new))
    };
    if uploaded.as_ref().is_some_and(is_same) {
        return;
    }
    let mut offset = u64::from(first) * TEXEL_BYTES;
    for texels in emitters.texels() {
        let bytes: &[u8] = bytemuck::cast_slice(texels);
        if !bytes.is_empty() {
            queue.write_buffer(&buffer, offset, bytes);
            store.uploaded += bytes.len() as u64;
        }
        offset += bytes.len() as u64;
    }
    *uploaded = Some((buffer.id(), first, emitters.texels().map(Arc::clone).collect()));
}
