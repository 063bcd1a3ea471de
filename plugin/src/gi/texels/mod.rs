//! The store of texels: points of lit and emissive surfaces, from which every camera's VPLs are
//! sampled.
//!
//! Light sources reserve a [range](TexelRange) each, in every frame, and write their texels into
//! it. A camera samples the [rows](TexelRow) of those ranges that light it.

mod rows;
mod texel;

use bevy::app::{App, Plugin};
use bevy::ecs::prelude::*;
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::render::{GpuResourceAppExt, Render};
use bevy::shader::load_shader_library;

use super::schedule::{PrepareSystems, supported_render_app};
use super::settings::FrugalGi;
pub(super) use rows::{CascadeCut, TILE, TexelRow, same_layout};
pub(super) use texel::{TEXEL_BYTES, Texel, pack_normal};

/// Ranges of the store by source, in this order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum TexelRange {
    /// Of reflective shadow maps.
    Maps,
    /// Of emissive surfaces.
    Emissive,
    /// Of cameras' patches.
    Patches,
}

/// The texels of all sources. A resource of the render world.
#[derive(Resource, Default)]
pub(super) struct TexelStore {
    /// An array of `Texel`; present while there are texels, and a GI camera.
    pub texels: Option<Buffer>,
    counts: [u32; 3],
    /// Texels of maps in the buffer.
    map_texels: u32,
    /// Bytes of texels and of patches written by the CPU in this frame.
    pub uploaded: u64,
}

impl TexelStore {
    /// Reserves `count` texels in this frame.
    pub(crate) fn reserve(&mut self, range: TexelRange, count: usize) {
        self.counts[range as usize] = count as u32;
    }

    /// Index of a range's first texel.
    pub(crate) fn first(&self, range: TexelRange) -> u32 {
        self.counts[..range as usize].iter().sum()
    }

    /// Bytes held on the GPU.
    pub(crate) fn bytes(&self) -> u64 {
        self.texels.as_ref().map_or(0, |texels| texels.size())
    }
}

pub(super) struct TexelPlugin;

impl Plugin for TexelPlugin {
    fn build(&self, app: &mut App) {
        load_shader_library!(app, "texel.wgsl");
        load_shader_library!(app, "rows.wgsl");
    }

    fn finish(&self, app: &mut App) {
        let Some(render_app) = supported_render_app(app) else { return };
        render_app
            .init_gpu_resource::<TexelStore>()
            .add_systems(Render, allocate.in_set(PrepareSystems::Texels));
    }
}

/// Resizes the buffer to the reserved texels, and drops it where there are none.
fn allocate(
    mut store: ResMut<TexelStore>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    cameras: Query<(), With<FrugalGi>>,
) {
    store.uploaded = 0;
    let (texels, map_texels) =
        (store.counts.iter().map(|count| u64::from(*count)).sum::<u64>(), store.counts[0]);
    let kept = std::mem::replace(&mut store.map_texels, map_texels).min(map_texels);
    if texels == 0 || cameras.is_empty() {
        store.texels = None;
        return;
    }
    let size = texels * TEXEL_BYTES;
    if store.texels.as_ref().is_some_and(|old| old.size() == size) {
        return;
    }
    let new = device.create_buffer(&BufferDescriptor {
        label: Some("frugal_gi/texels"),
        size,
        usage: BufferUsages::STORAGE | BufferUsages::COPY_SRC | BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    // Keeps the maps' texels, which stay in place while ranges grow or shrink, so that the maps need
    // not be rendered again.
    if let Some(old) = store.texels.as_ref().filter(|_| kept > 0) {
        let label = Some("frugal_gi/texels/keep");
        let mut encoder = device.create_command_encoder(&CommandEncoderDescriptor { label });
        encoder.copy_buffer_to_buffer(old, 0, &new, 0, u64::from(kept) * TEXEL_BYTES);
        queue.submit([encoder.finish()]);
    }
    store.texels = Some(new);
}
