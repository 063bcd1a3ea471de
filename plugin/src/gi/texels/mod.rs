//! The store of texels: points of lit and emissive surfaces, from which every camera's VPLs are
//! sampled.
//!
//! Light sources reserve a [range](TexelRange) each, in every frame, and write their texels into
//! it. A camera samples the [rows](TexelRow) of those ranges that light it.

mod rows;

use bevy::app::{App, Plugin};
use bevy::ecs::prelude::*;
use bevy::math::Vec3;
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::render::{GpuResourceAppExt, Render};
use bevy::shader::load_shader_library;
use bytemuck::{Pod, Zeroable};

use super::schedule::{PrepareSystems, supported_render_app};
use super::settings::FrugalGi;
pub(super) use rows::{CascadeCut, TILE, TexelRow, same_layout};

/// Bytes of a [`Texel`]. A test compares it with the shader.
pub(super) const TEXEL_BYTES: u64 = size_of::<Texel>() as u64;

/// `texels/texels.wgsl`'s `Texel`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Texel {
    /// World space, metres.
    pub position: [f32; 3],
    /// Area of the surface that it represents, m².
    pub area: f32,
    /// Lumens.
    pub flux: [f32; 3],
    packed_normal: u32,
}

impl Texel {
    /// A texel; `normal` is a unit vector in world space.
    pub(crate) fn new(position: Vec3, area: f32, flux: Vec3, normal: Vec3) -> Self {
        Self {
            position: position.to_array(),
            area,
            flux: flux.to_array(),
            packed_normal: pack_normal(normal),
        }
    }
}

/// Octahedral coordinates (Cigolle et al. 2014) of 16 bits each, as `texels/texels.wgsl`'s function
/// of that name packs them.
pub(super) fn pack_normal(normal: Vec3) -> u32 {
    let Vec3 { x, y, z } = normal / (normal.x.abs() + normal.y.abs() + normal.z.abs());
    let folded = |own: f32, other: f32| (1.0 - other.abs()) * if own > 0.0 { 1.0 } else { -1.0 };
    let (x, y) = if z >= 0.0 { (x, y) } else { (folded(x, y), folded(y, x)) };
    let bits = |value: f32| ((value * 0.5 + 0.5).clamp(0.0, 1.0) * 65535.0).round() as u32;
    bits(x) | bits(y) << 16
}

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
        load_shader_library!(app, "texels.wgsl");
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

#[cfg(test)]
mod tests {
    use super::*;

    fn unpack(packed: u32) -> Vec3 {
        let [x, y] = [packed & 0xFFFF, packed >> 16].map(|bits| bits as f32 / 65535.0 * 2.0 - 1.0);
        let z = 1.0 - x.abs() - y.abs();
        let fold = (-z).clamp(0.0, 1.0);
        let [x, y] = [x, y].map(|value| if value >= 0.0 { value - fold } else { value + fold });
        Vec3::new(x, y, z).normalize()
    }

    #[test]
    fn a_normal_is_kept_to_a_few_hundred_thousandths() {
        for i in 0..2000 {
            let (height, turn) = (1.0 - (i as f32 + 0.5) / 1000.0, i as f32 * 2.4);
            let around = (1.0 - height * height).max(0.0).sqrt();
            let normal = Vec3::new(around * turn.cos(), height, around * turn.sin());
            assert!((unpack(pack_normal(normal)) - normal).length() < 1e-4, "{normal}");
        }
        for axis in [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z] {
            assert!((unpack(pack_normal(axis)) - axis).length() < 1e-4, "{axis}");
        }
    }
}
