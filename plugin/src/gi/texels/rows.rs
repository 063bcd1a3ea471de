//! Rows of texels, from which a camera samples VPLs.

use bytemuck::{Pod, Zeroable};

/// Texels of a cascade that a finer one covers: they are not sampled.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(in crate::gi) struct CascadeCut {
    /// First column and the one after the last.
    pub columns: [u32; 2],
    /// First row and the one after the last, counted from the top.
    pub rows: [u32; 2],
}

/// `texels/texels.wgsl`'s `Row`: one row of one of a camera's maps.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(in crate::gi) struct TexelRow {
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
pub(in crate::gi) const TILE: u32 = 16;

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
pub(in crate::gi) fn same_layout(these: &[TexelRow], those: &[TexelRow]) -> bool {
    let layout = |row: &TexelRow| (row.first_weight, row.length, row.first_tile);
    these.len() == those.len() && these.iter().map(layout).eq(those.iter().map(layout))
}
