//! Rows of texels: what a camera samples VPLs from.

use bevy::ecs::prelude::*;
use bevy::render::extract_component::ExtractComponent;
use bytemuck::{Pod, Zeroable};

/// Texels of a map that another one covers more finely: nothing is drawn from them.
#[derive(Component, ExtractComponent, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(in crate::gi) struct CascadeCut {
    /// First column and the one after the last.
    pub columns: [u32; 2],
    /// The same of rows, counted from the top.
    pub rows: [u32; 2],
}

/// `texels/rows.wgsl`'s `Row`: one row of one of a camera's maps.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
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
    /// Its place among the rows of that tile, and how many they are.
    place: u32,
    tile_rows: u32,
    /// First column that nothing is drawn from, and the one after the last: another map has them.
    cut: [u32; 2],
}

/// Columns of a tile, and most rows of one, as `texels/rows.wgsl` has them.
pub(in crate::gi) const TILE: u32 = 16;

/// Texels in a row of those that no map shows: short, so that both coordinates of drawing are of
/// use.
const SCATTERED_ROW: u32 = 32;

impl TexelRow {
    /// Adds `count` rows of `length` texels, that lie beside each other and one after another in
    /// the store from `first_texel` on.
    pub fn add_map(
        rows: &mut Vec<Self>,
        first_texel: u32,
        length: u32,
        count: u32,
        cut: CascadeCut,
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
                CascadeCut::default(),
            );
        }
    }

    /// One after the last tile that it runs through.
    pub fn end_tile(&self) -> u32 {
        self.first_tile + self.length.div_ceil(TILE)
    }
}

/// Whether both take the same room, so that one's buffers serve the other.
pub(in crate::gi) fn same_places(these: &[TexelRow], those: &[TexelRow]) -> bool {
    let place = |row: &TexelRow| (row.first_weight, row.length, row.first_tile);
    these.len() == those.len() && these.iter().map(place).eq(those.iter().map(place))
}
