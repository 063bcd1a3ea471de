//! Emissive surfaces as a source of light.
//!
//! | file | world | job |
//! |---|---|---|
//! | `emission` | none | what a material emits, in nits |
//! | `surface` | none | an emissive surface as points |
//! | `emitters` | main | keeps the texels of all emissive surfaces |
//! | this file | render | writes them into the store behind the maps' |

mod emission;
mod emitters;
mod surface;

use bevy::app::{App, PostUpdate};
use bevy::camera::visibility::VisibilitySystems;
use bevy::ecs::prelude::*;
use bevy::render::extract_resource::ExtractResourcePlugin;
use bevy::render::render_resource::BufferId;
use bevy::render::renderer::RenderQueue;
use bevy::transform::TransformSystems;

use super::schedule::SceneSystems;
use super::texels::{TEXEL_BYTES, TexelRange, TexelStore};
pub use emitters::GiEmitters;

pub(super) fn build(app: &mut App) {
    app.init_resource::<GiEmitters>()
        .init_resource::<emitters::EmissiveState>()
        .add_plugins(ExtractResourcePlugin::<GiEmitters>::default())
        .add_systems(
            PostUpdate,
            // After this frame's transforms, and its changes of assets, which the set follows: a
            // surface that becomes emissive lights others in the same frame.
            (emitters::update, emitters::note_presence.run_if(resource_changed::<GiEmitters>))
                .chain()
                .in_set(SceneSystems::Emissive)
                .after(TransformSystems::Propagate)
                .after(VisibilitySystems::VisibilityPropagate),
        );
}

pub(super) fn reserve(mut store: ResMut<TexelStore>, emitters: Res<GiEmitters>) {
    store.reserve(TexelRange::Emissive, emitters.texel_count());
}

/// Uploads the texels of emissive surfaces into the store when they changed or the store did.
/// `uploaded`: the buffer that holds them, and the index of the first one.
pub(super) fn upload(
    mut uploaded: Local<Option<(BufferId, u32)>>,
    mut store: ResMut<TexelStore>,
    emitters: Res<GiEmitters>,
    queue: Res<RenderQueue>,
) {
    let Some(buffer) = store.texels.clone().filter(|_| emitters.texel_count() > 0) else {
        *uploaded = None;
        return;
    };
    let first = store.first(TexelRange::Emissive);
    let now = Some((buffer.id(), first));
    if std::mem::replace(&mut *uploaded, now) == now && !emitters.is_changed() {
        return;
    }
    let mut offset = u64::from(first) * TEXEL_BYTES;
    for texels in emitters.texels().filter(|texels| !texels.is_empty()) {
        let bytes: &[u8] = bytemuck::cast_slice(texels);
        queue.write_buffer(&buffer, offset, bytes);
        store.uploaded += bytes.len() as u64;
        offset += bytes.len() as u64;
    }
}
