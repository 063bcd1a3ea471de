//! What a camera needs to draw its VPLs.

use bevy::render::render_resource::{Buffer, BufferDescriptor, BufferInitDescriptor, BufferUsages};
use bevy::render::renderer::RenderDevice;
use bytemuck::{Pod, Zeroable};

/// Surface points that stand for what the camera sees.
const RECEIVERS: u64 = 32;
/// Bytes of `vpl/weigh.wgsl`'s `Receiver`. A test holds it against the shader.
pub(in crate::gi) const RECEIVER_BYTES: u64 = 32;

/// Bytes of its `Receivers`.
const RECEIVERS_BYTES: u64 = 16 + RECEIVERS * RECEIVER_BYTES;

/// `vpl/rows.wgsl`'s `Row`: one row of one of a camera's maps.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub(in crate::gi) struct MapRow {
    /// Index of its first texel among all maps' texels.
    pub first_texel: u32,
    /// Index of its first texel among the camera's weights.
    pub first_weight: u32,
    /// Texels in it.
    pub length: u32,
}

/// Buffers between a camera's maps and its VPLs.
pub(in crate::gi) struct DrawingBuffers {
    /// What `row_table` holds.
    pub rows: Vec<MapRow>,
    /// Texels in the longest row.
    pub longest_row: u32,
    pub row_table: Buffer,
    pub receivers: Buffer,
    /// How much each texel matters to this camera, then cumulative along each row.
    pub texel_cdf: Buffer,
    /// Cumulative sums of rows.
    pub row_cdf: Buffer,
}

impl DrawingBuffers {
    /// Buffers for at least one row.
    pub fn new(device: &RenderDevice, rows: Vec<MapRow>) -> Self {
        let empty = |label, size| {
            device.create_buffer(&BufferDescriptor { label: Some(label), size, usage: BufferUsages::STORAGE, mapped_at_creation: false })
        };
        let texels = rows.iter().map(|row| u64::from(row.length)).sum::<u64>();
        Self {
            row_table: device.create_buffer_with_data(&BufferInitDescriptor {
                label: Some("bevy_frugal_gi/vpl/rows"),
                contents: bytemuck::cast_slice(&rows),
                usage: BufferUsages::STORAGE,
            }),
            receivers: empty("bevy_frugal_gi/vpl/receivers", RECEIVERS_BYTES),
            texel_cdf: empty("bevy_frugal_gi/vpl/texel_cdf", texels * 4),
            row_cdf: empty("bevy_frugal_gi/vpl/row_cdf", rows.len() as u64 * 4),
            longest_row: rows.iter().map(|row| row.length).max().unwrap_or(0),
            rows,
        }
    }

    /// Bytes held on the GPU.
    pub fn bytes(&self) -> u64 {
        [&self.row_table, &self.receivers, &self.texel_cdf, &self.row_cdf].map(|buffer| buffer.size()).iter().sum()
    }
}
