// Tile visibility: one ray from each importance point to each tile of a camera's reflective shadow
// maps.
//
// From indoors nearly all sunlit texels are occluded. Weights without visibility spend VPLs, and
// then the rays to them, on light that never arrives. A tile is visible from an importance point
// where the ray to one of its texels is free; other points test other texels of it. That is coarse,
// but it affects only weights: as long as none is 0, the estimate stays unbiased.

#import bevy_render::view::View
#import bevy_frugal_gi::gi::texels::texels::{Row, TILE, Texel, is_cut, texel_luminance, texel_normal}
#import bevy_frugal_gi::gi::view::surface::apparent_distance
#import bevy_frugal_gi::gi::trace::trace::{begin_trace, is_occluded, surface_offset}
#import bevy_frugal_gi::gi::vpl::vpl::{IMPORTANCE_POINTS, ImportancePoints, importance_of}

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> texels: array<Texel>;
@group(0) @binding(2) var<storage, read> rows: array<Row>;
@group(0) @binding(3) var<storage, read> importance: ImportancePoints;
/// A bit for each importance point and tile: set where the tile is occluded.
@group(0) @binding(4) var<storage, read_write> occluded_tiles: array<atomic<u32>>;

/// Texels that are tried until one is lit.
const TRIES: u32 = 4u;

/// Tiles and rows of a workgroup. The smallest maps have rows of one or two tiles: a workgroup for
/// each row would leave most threads idle.
const GROUP_TILES: u32 = 2u;
const GROUP_ROWS: u32 = 16u;

/// Most rays of a thread: a ray takes long.
const POINTS: u32 = 4u;

/// Tiles above which neighbouring importance points share a ray, and how many then.
const MANY: u32 = 1280u;
const SHARING: u32 = 4u;

/// Threads for each row and tile's width of it. The rows of a tile divide the rays among them, and so do
/// a row's threads along z.
@compute @workgroup_size(GROUP_TILES, GROUP_ROWS)
fn trace_tiles(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    begin_trace(thread);
    if id.y >= arrayLength(&rows) {
        return;
    }
    let row = rows[id.y];
    let first = id.x * TILE;
    if first >= row.length {
        return;
    }
    let width = min(row.length - first, TILE);
    var found = 0u;
    let sharing = select(1u, SHARING, arrayLength(&occluded_tiles) > MANY);
    let first_ray = row.row_in_tile + id.z * POINTS * row.tile_rows;
    let end = min(first_ray + POINTS * row.tile_rows, IMPORTANCE_POINTS / sharing);
    for (var ray = first_ray; ray < end; ray += row.tile_rows) {
        // Another of those that share it for each tile.
        let i = ray * sharing + (row.first_tile + id.x) % sharing;
        let point = importance.points[i];
        for (var j = 0u; j < TRIES; j++) {
            // Any four columns, different ones for each importance point.
            let column = (i * 7u + id.x * 3u + row.row_in_tile * 5u + j * 11u) % width;
            let texel = texels[row.first_texel + first + column];
            if texel_luminance(texel) > 0.0 && !is_cut(row, first + column) {
                let normal = texel_normal(texel);
                // A texel below the point's horizon, or facing away, says nothing of the rest of
                // the tile.
                if importance_of(point, texel.position, normal) > 0.0 {
                    let start = point.position + point.normal * offset_at(point.position, point.pixel_width);
                    let target_point = texel.position + normal * offset_at(texel.position, sqrt(texel.area));
                    let all = ((1u << sharing) - 1u) << (ray * sharing);
                    found |= select(0u, all, is_occluded(start, target_point));
                }
                break;
            }
        }
    }
    if found != 0u {
        atomicOr(&occluded_tiles[row.first_tile + id.x], found);
    }
}

fn offset_at(position: vec3<f32>, width: f32) -> f32 {
    return surface_offset(position, apparent_distance(view.clip_from_view, distance(position, view.world_position)), width);
}
