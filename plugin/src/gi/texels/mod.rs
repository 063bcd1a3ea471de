//! The store of texels: points of lit and emissive surfaces, from which every camera's VPLs are
//! sampled.
//!
//! Light sources reserve a [range](TexelRange) each, in every frame, and write their texels into
//! it. A camera samples the [rows](TexelRow) of those ranges that light it.

use bevy::app::{App, SubApp};
use bevy::ecs::prelude::*;
use bevy::math::Vec3;
use bevy::render::GpuResourceAppExt;
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::shader::load_shader_library;
use bytemuck::{Pod, Zeroable};

use super::compute::empty_buffer;
use super::settings::FrugalGi;

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

pub(super) fn build(app: &mut App) {
    load_shader_library!(app, "texels.wgsl");
}

pub(super) fn finish(render_app: &mut SubApp) {
    render_app.init_gpu_resource::<TexelStore>();
}

/// Resizes the buffer to the reserved texels, and drops it where there are none.
pub(super) fn allocate(
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
    let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC | BufferUsages::COPY_DST;
    let new = empty_buffer(&device, "frugal_gi/texels", size, usage);
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

/// Texels of a cascade that a finer one covers: they are not sampled.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct CascadeCut {
    /// First column and the one after the last.
    pub columns: [u32; 2],
    /// First row and the one after the last, counted from the top.
    pub rows: [u32; 2],
}

/// `texels/texels.wgsl`'s `Row`: one row of one of a camera's maps.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(super) struct TexelRow {
    /// Index of its first texel among all maps' texels.
    pub first_texel: u32,
    /// Index of its first texel among the camera's weights.
    pub first_weight: u32,
    /// Texels in it.
    pub length: u32,
    /// Index of the first tile that it runs through.
    first_tile: u32,
    /// Index among the rows of that tile.
    row_in_tile: u32,
    /// Number of rows of that tile.
    tile_rows: u32,
    /// First column that is not sampled, and the one after the last: a finer cascade covers them.
    cut: [u32; 2],
    /// Share of its texels' flux, 0 to 1.
    share: f32,
    padding: u32,
}

/// Columns of a tile, and most rows of one.
pub(super) const TILE: u32 = 16;

/// Texels in a row of those without a map: short, so that both sample coordinates stratify.
const SCATTERED_ROW: u32 = 32;

impl TexelRow {
    /// Adds the `count` rows of a map, of `length` texels each, consecutive in the store from
    /// `first_texel` on, but for its cut, with a share of their flux.
    pub(crate) fn add_map(
        rows: &mut Vec<Self>,
        first_texel: u32,
        length: u32,
        count: u32,
        (cut, share): (CascadeCut, f32),
    ) {
        let (first_weight, first_tile) =
            rows.last().map_or((0, 0), |row| (row.first_weight + row.length, row.end_tile()));
        rows.extend((0..count).map(|index| {
            let tile_row = index / TILE;
            Self {
                first_texel: first_texel + index * length,
                first_weight: first_weight + index * length,
                length,
                first_tile: first_tile + tile_row * length.div_ceil(TILE),
                row_in_tile: index % TILE,
                tile_rows: (count - tile_row * TILE).min(TILE),
                cut: if (cut.rows[0]..cut.rows[1]).contains(&index) { cut.columns } else { [0; 2] },
                share,
                padding: 0,
            }
        }));
    }

    /// Adds rows for `count` consecutive texels of the store without a map. Each row has tiles of
    /// its own, since the next one may lie in another room.
    pub(crate) fn add_scattered(rows: &mut Vec<Self>, first_texel: u32, count: u32) {
        for row in (0..count).step_by(SCATTERED_ROW as usize) {
            Self::add_map(
                rows,
                first_texel + row,
                SCATTERED_ROW.min(count - row),
                1,
                (CascadeCut::default(), 1.0),
            );
        }
    }

    /// Index after the last tile that it runs through.
    pub(crate) fn end_tile(&self) -> u32 {
        self.first_tile + self.length.div_ceil(TILE)
    }
}

/// Whether both have the same layout, so that one's buffers serve the other.
pub(super) fn same_layout(these: &[TexelRow], those: &[TexelRow]) -> bool {
    let layout = |row: &TexelRow| (row.first_weight, row.length, row.first_tile);
    these.len() == those.len() && these.iter().map(layout).eq(those.iter().map(layout))
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
