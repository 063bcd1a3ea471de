//! What a camera needs to draw its VPLs.

use bevy::render::render_resource::{Buffer, BufferDescriptor, BufferInitDescriptor, BufferUsages};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bytemuck::{Pod, Zeroable};

use crate::gi::rsm::RsmCut;

/// Surface points that stand for what the camera sees.
const RECEIVERS: u64 = 32;
/// Bytes of `vpl/weigh.wgsl`'s `Receiver`. A test holds it against the shader.
pub(in crate::gi) const RECEIVER_BYTES: u64 = 32;

/// Bytes of its `Receivers`.
pub(in crate::gi) const RECEIVERS_BYTES: u64 = 16 + RECEIVERS * RECEIVER_BYTES;

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
    /// Index of the first tile that it runs through.
    first_tile: u32,
    /// Its place among the rows of that tile, and how many they are.
    place: u32,
    tile_rows: u32,
    /// First column that nothing is drawn from, and the one after the last: another map has them.
    cut: [u32; 2],
}

/// Columns of a tile, and most rows of one, as `vpl/rows.wgsl` has them.
pub(super) const TILE: u32 = 16;

/// Texels in a row of those that no map shows: short, so that both coordinates of drawing are of
/// use.
const SCATTERED_ROW: u32 = 32;

impl MapRow {
    /// Adds `count` rows of `length` texels, that lie beside each other and one after another in
    /// the store from `first_texel` on.
    pub fn add_map(rows: &mut Vec<Self>, first_texel: u32, length: u32, count: u32, cut: RsmCut) {
        let (first_weight, first_tile) =
            rows.last().map_or((0, 0), |row| (row.first_weight + row.length, row.end_tile()));
        rows.extend((0..count).map(|index| {
            let tile_row = index / TILE;
            Self {
                first_texel: first_texel + index * length,
                first_weight: first_weight + index * length,
                length,
                first_tile: first_tile + tile_row * length.div_ceil(TILE),
                place: index % TILE,
                tile_rows: (count - tile_row * TILE).min(TILE),
                cut: if (cut.rows[0]..cut.rows[1]).contains(&index) { cut.columns } else { [0; 2] },
            }
        }));
    }

    /// Adds rows for `count` texels one after another in the store that no map shows: each row a
    /// map of its own, since the next one may lie in another room.
    pub fn add_scattered(rows: &mut Vec<Self>, first_texel: u32, count: u32) {
        for row in (0..count).step_by(SCATTERED_ROW as usize) {
            Self::add_map(
                rows,
                first_texel + row,
                SCATTERED_ROW.min(count - row),
                1,
                RsmCut::default(),
            );
        }
    }

    /// One after the last tile that it runs through.
    fn end_tile(&self) -> u32 {
        self.first_tile + self.length.div_ceil(TILE)
    }
}

/// Buffers between a camera's maps and its VPLs.
pub(in crate::gi) struct DrawingBuffers {
    /// What `row_table` holds.
    pub rows: Vec<MapRow>,
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
    pub fn new(device: &RenderDevice, rows: Vec<MapRow>) -> Self {
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

    /// Whether `rows` take as much room as those that are held.
    pub fn fits(&self, rows: &[MapRow]) -> bool {
        let place = |row: &MapRow| (row.first_weight, row.length, row.first_tile);
        self.rows.len() == rows.len() && self.rows.iter().map(place).eq(rows.iter().map(place))
    }

    /// Draws from other texels from now on, which [`fit`](Self::fits).
    pub fn set_rows(&mut self, queue: &RenderQueue, rows: Vec<MapRow>) {
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
