//! What a camera needs to draw its VPLs.

use bevy::render::render_resource::{Buffer, BufferDescriptor, BufferInitDescriptor, BufferUsages};
use bevy::render::renderer::{RenderDevice, RenderQueue};

use crate::gi::texels::TexelRow;

/// Surface points that stand for what the camera sees.
const RECEIVERS: u64 = 32;
/// Bytes of `vpl/weigh.wgsl`'s `Receiver`. A test holds it against the shader.
pub(in crate::gi) const RECEIVER_BYTES: u64 = 32;

/// Bytes of its `Receivers`.
pub(in crate::gi) const RECEIVERS_BYTES: u64 = 16 + RECEIVERS * RECEIVER_BYTES;

/// Buffers between a camera's maps and its VPLs.
pub(in crate::gi) struct DrawingBuffers {
    /// What `row_table` holds.
    pub rows: Vec<TexelRow>,
    /// Texels in the longest row.
    pub longest_row: u32,
    pub row_table: Buffer,
    pub receivers: Buffer,
    /// Which receivers do not see a tile, by bits.
    pub hidden: Buffer,
    /// How much each texel matters to this camera, then cumulative along each row.
    pub texel_cdf: Buffer,
    /// Cumulative sums of rows.
    pub row_cdf: Buffer,
}

impl DrawingBuffers {
    /// Buffers for at least one row.
    pub fn new(device: &RenderDevice, rows: Vec<TexelRow>) -> Self {
        let empty = |label, size| {
            let usage = BufferUsages::STORAGE | BufferUsages::COPY_DST;
            device.create_buffer(&BufferDescriptor {
                label: Some(label),
                size,
                usage,
                mapped_at_creation: false,
            })
        };
        let texels = rows.iter().map(|row| u64::from(row.length)).sum::<u64>();
        Self {
            row_table: device.create_buffer_with_data(&BufferInitDescriptor {
                label: Some("bevy_frugal_gi/vpl/rows"),
                contents: bytemuck::cast_slice(&rows),
                usage: BufferUsages::STORAGE | BufferUsages::COPY_DST,
            }),
            receivers: empty("bevy_frugal_gi/vpl/receivers", RECEIVERS_BYTES),
            hidden: empty(
                "bevy_frugal_gi/vpl/hidden",
                rows.last().map_or(1, |row| u64::from(row.end_tile())) * 4,
            ),
            texel_cdf: empty("bevy_frugal_gi/vpl/texel_cdf", texels * 4),
            row_cdf: empty("bevy_frugal_gi/vpl/row_cdf", rows.len() as u64 * 4),
            longest_row: rows.iter().map(|row| row.length).max().unwrap_or(0),
            rows,
        }
    }

    /// Draws from other texels from now on, which take the [same places](crate::gi::texels::same_places).
    pub fn set_rows(&mut self, queue: &RenderQueue, rows: Vec<TexelRow>) {
        queue.write_buffer(&self.row_table, 0, bytemuck::cast_slice(&rows));
        self.rows = rows;
    }

    /// Bytes held on the GPU.
    pub fn bytes(&self) -> u64 {
        [&self.row_table, &self.receivers, &self.hidden, &self.texel_cdf, &self.row_cdf]
            .map(|buffer| buffer.size())
            .iter()
            .sum()
    }
}
