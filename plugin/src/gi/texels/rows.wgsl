// The rows of a camera's reflective shadow maps, one after another.
#define_import_path bevy_frugal_gi::gi::texels::rows

struct Row {
    /// Index of its first texel among all maps' texels.
    first_texel: u32,
    /// Index of its first texel among the camera's weights.
    first_weight: u32,
    /// Texels in it.
    length: u32,
    /// Index of the first tile that it runs through.
    first_tile: u32,
    /// Index among the rows of that tile.
    row_in_tile: u32,
    /// Number of rows of that tile.
    tile_rows: u32,
    /// First column that is not sampled, and the one after the last: a finer cascade covers them.
    cut: vec2<u32>,
    /// Share of its texels' flux, 0 to 1.
    share: f32,
}

/// Whether a finer cascade covers a column.
fn is_cut(row: Row, column: u32) -> bool {
    return column >= row.cut.x && column < row.cut.y;
}

/// Columns of a tile, and most rows of one: neighbouring texels that share one visibility test from
/// each importance point.
const TILE: u32 = 16u;
