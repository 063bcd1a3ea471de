// Texels, from which virtual point lights are sampled: 32 bytes each, since they take most of GI's
// memory. Rows of them: those of a camera's reflective shadow maps, one after another.
#define_import_path bevy_frugal_gi::gi::texels::texels

#import bevy_pbr::utils::{octahedral_decode, octahedral_encode}
#import bevy_frugal_gi::gi::view::noise::luminance

struct Texel {
    /// World space, metres.
    position: vec3<f32>,
    /// Area of the surface that the texel covers, m².
    area: f32,
    /// Reflected or emitted flux, lumens. 0 where nothing is lit, or where a value was not finite.
    flux: vec3<f32>,
    /// See `texel_normal`.
    packed_normal: u32,
}

/// Octahedral, 16 bits per axis: 16 times as fine as the G-buffer.
fn pack_normal(normal: vec3<f32>) -> u32 {
    return pack2x16unorm(octahedral_encode(normal));
}

/// World space, unit length.
fn texel_normal(texel: Texel) -> vec3<f32> {
    return octahedral_decode(unpack2x16unorm(texel.packed_normal));
}

/// Luminance of the flux.
fn texel_luminance(texel: Texel) -> f32 {
    return luminance(texel.flux);
}

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
