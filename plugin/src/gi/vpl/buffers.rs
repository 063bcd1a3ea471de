//! The buffers with which a camera's VPLs are sampled.

use std::sync::Arc;

use bevy::render::render_resource::{Buffer, BufferDescriptor, BufferInitDescriptor, BufferUsages};
use bevy::render::renderer::{RenderDevice, RenderQueue};

use crate::gi::texels::TexelRow;

/// Surface points that stand for all surfaces in view.
pub(in crate::gi) const IMPORTANCE_POINTS: u64 = 32;
/// Bytes of `vpl/importance.wgsl`'s `ImportancePoint`. A test compares it with the shader.
pub(in crate::gi) const IMPORTANCE_POINT_BYTES: u64 = 32;

/// Bytes of its `ImportancePoints`.
pub(in crate::gi) const IMPORTANCE_POINTS_BYTES: u64 =
    16 + IMPORTANCE_POINTS * IMPORTANCE_POINT_BYTES;

/// Buffers between a camera's maps and its VPLs.
pub(in crate::gi) struct SamplingBuffers {
    /// The content of `row_table`.
    pub rows: Arc<Vec<TexelRow>>,
    /// Texels in the longest row.
    pub longest_row: u32,
    pub row_table: Buffer,
    pub importance: Buffer,
    /// For each tile, a bit for each importance point from which it is occluded.
    pub occluded_tiles: Buffer,
    /// Each texel's weight for this camera, then the weights' cumulative sums along each row.
    pub texel_cdf: Buffer,
    /// Cumulative sums of rows.
    pub row_cdf: Buffer,
}

impl SamplingBuffers {
    /// Buffers for at least one row.
    pub(crate) fn new(device: &RenderDevice, rows: Arc<Vec<TexelRow>>) -> Self {
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
                contents: bytemuck::cast_slice(rows.as_slice()),
                usage: BufferUsages::STORAGE | BufferUsages::COPY_DST,
            }),
            importance: empty("bevy_frugal_gi/vpl/importance", IMPORTANCE_POINTS_BYTES),
            occluded_tiles: empty(
                "bevy_frugal_gi/vpl/occluded_tiles",
                rows.last().map_or(1, |row| u64::from(row.end_tile())) * 4,
            ),
            texel_cdf: empty("bevy_frugal_gi/vpl/texel_cdf", texels * 4),
            row_cdf: empty("bevy_frugal_gi/vpl/row_cdf", rows.len() as u64 * 4),
            longest_row: rows.iter().map(|row| row.length).max().unwrap_or(0),
            rows,
        }
    }

    /// Samples other rows from now on, of the [same layout](crate::gi::texels::same_layout).
    pub(crate) fn set_rows(&mut self, queue: &RenderQueue, rows: Arc<Vec<TexelRow>>) {
        queue.write_buffer(&self.row_table, 0, bytemuck::cast_slice(rows.as_slice()));
        self.rows = rows;
    }

    /// Bytes held on the GPU.
    pub(crate) fn bytes(&self) -> u64 {
        [&self.row_table, &self.importance, &self.occluded_tiles, &self.texel_cdf, &self.row_cdf]
            .map(|buffer| buffer.size())
            .iter()
            .sum()
    }
}
