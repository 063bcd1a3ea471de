// Weights of the texels of a camera's reflective shadow maps: flux times importance, which is what
// the visible surfaces could receive of it.
//
// A few importance points stand for all visible surfaces. VPLs sampled by flux alone lie wherever
// the sun shines; on a large level few of them would light anything in view. As in light-path
// guiding, importance from the eye decides where light paths go. Any weight above zero keeps the
// estimate unbiased, so few points suffice, and their visibility may be known by tiles of texels
// alone (`tile_visibility.wgsl`, where rays are traced; TILE_VISIBILITY) or not at all. A
// defensive-sampling term of a quarter of the mean bounds the variance: no VPL carries more than
// four times the flux that it would carry if all were sampled by flux.

#import bevy_render::view::View
#import bevy_frugal_gi::gi::texels::texels::{Row, TILE, Texel, is_cut, texel_luminance, texel_normal}
#import bevy_frugal_gi::gi::view::surface::{apparent_distance, image_size, pixel_width, shown_at}
#import bevy_frugal_gi::gi::vpl::vpl::{IMPORTANCE_POINTS, ImportancePoint, ImportancePoints, importance_of, importance_pixel}

@group(0) @binding(0) var g_buffer: texture_2d<u32>;
@group(0) @binding(1) var depth_buffer: texture_depth_2d;
@group(0) @binding(2) var<uniform> view: View;
@group(0) @binding(3) var<storage, read> texels: array<Texel>;
@group(0) @binding(4) var<storage, read> rows: array<Row>;
@group(0) @binding(5) var<storage, read_write> importance: ImportancePoints;
@group(0) @binding(6) var<storage, read_write> weights: array<f32>;
/// Written by `tile_visibility.wgsl`.
@group(0) @binding(7) var<storage, read> occluded_tiles: array<u32>;

/// One thread per importance point.
@compute @workgroup_size(IMPORTANCE_POINTS)
fn pick_importance_points(@builtin(local_invocation_index) index: u32) {
    let size = image_size(view.viewport);
    let shown = shown_at(importance_pixel(index, size), g_buffer, depth_buffer, view.viewport, view.world_from_clip);
    var point: ImportancePoint;
    point.position = shown.position;
    point.normal = shown.normal;
    // About the surface that a rectangle of the grid covers: distances below that cannot be
    // resolved.
    let delta = point.position - view.world_position;
    let near = apparent_distance(view.clip_from_view, 1.0);
    let reach = select(dot(delta, delta), 1.0, view.clip_from_view[3][3] == 1.0) * near * near;
    point.radius_squared = select(0.0, clamp(0.02 * reach, 1e-12, 1e18), shown.depth > 0.0);
    point.pixel_width = pixel_width(view.clip_from_view, size.y, sqrt(clamp(dot(delta, delta), 0.0, 1e30)));
    importance.points[index] = point;
}

/// Share of its importance that a tile keeps for an importance point from which its tested texel is
/// occluded.
const OCCLUDED_SHARE: f32 = 0.05;

/// Importance of a texel: the sum over the importance points, 1/m². The texel lies in a column of a
/// row.
fn texel_importance(row: Row, column: u32, texel: Texel) -> f32 {
    let normal = texel_normal(texel);
#ifdef TILE_VISIBILITY
    let occluded = occluded_tiles[row.first_tile + column / TILE];
#endif
    var sum = 0.0;
    for (var i = 0u; i < IMPORTANCE_POINTS; i++) {
        let own = importance_of(importance.points[i], texel.position, normal);
#ifdef TILE_VISIBILITY
        sum += own * select(1.0, OCCLUDED_SHARE, (occluded & (1u << i)) != 0u);
#else
        sum += own;
#endif
    }
    return min(sum, 1e6);
}

const LANES: u32 = 64u;
/// Texels that each lane reads.
const TEXELS_PER_LANE: u32 = 16u;
var<workgroup> lane_flux: array<f32, LANES>;
var<workgroup> lane_weighted: array<f32, LANES>;

/// The defensive-sampling term, from a thousand texels spread over all maps; one workgroup.
@compute @workgroup_size(LANES)
fn find_defensive_term(@builtin(local_invocation_index) lane: u32) {
    let count = arrayLength(&rows);
    var flux = 0.0;
    var weighted = 0.0;
    for (var i = 0u; i < TEXELS_PER_LANE; i++) {
        let sample_index = lane * TEXELS_PER_LANE + i;
        let row = rows[sample_index * count / (LANES * TEXELS_PER_LANE)];
        let column = min(u32(fract(f32(sample_index) * 0.618034) * f32(row.length)), row.length - 1u);
        let texel = texels[row.first_texel + column];
        let luminance = select(texel_luminance(texel) * row.share * 1e-3, 0.0, is_cut(row, column));
        flux += luminance;
        weighted += luminance * texel_importance(row, column, texel);
    }
    lane_flux[lane] = flux;
    lane_weighted[lane] = weighted;
    workgroupBarrier();
    if lane == 0u {
        for (var i = 1u; i < LANES; i++) {
            flux += lane_flux[i];
            weighted += lane_weighted[i];
        }
        // Where no importance point receives light, or no texel that was read is lit, flux alone
        // decides.
        importance.defensive_term = clamp(0.25 * weighted / max(flux, 1e-36), 1e-9, 1e6);
    }
}

/// Blocks of texels of a workgroup, along rows and across them.
const GROUP_COLUMNS: u32 = 16u;
const GROUP_ROWS: u32 = 4u;

/// Texels above which neighbours share an importance, and side of the block in which they do.
const MANY: u32 = 65536u;
const BLOCK: u32 = 4u;

/// One thread per block of texels of the camera's maps: a single one where there are not many. In a larger
/// block a texel has the importance of one before, where both lie close and face alike.
@compute @workgroup_size(GROUP_COLUMNS, GROUP_ROWS)
fn weigh_texels(@builtin(global_invocation_id) id: vec3<u32>) {
    let side = select(1u, BLOCK, arrayLength(&weights) > MANY);
    // Its area is 0, so that the first texel shares nothing.
    var weighed: Texel;
    var own = 0.0;
    for (var number = id.y * side; number < min((id.y + 1u) * side, arrayLength(&rows)); number++) {
        let row = rows[number];
        for (var column = id.x * side; column < min((id.x + 1u) * side, row.length); column++) {
            let texel = texels[row.first_texel + column];
            // Clamped so that a sum over all texels stays finite, whatever the flux.
            let luminance = texel_luminance(texel) * row.share;
            var weight = 0.0;
            if luminance > 0.0 && !is_cut(row, column) {
                let step = texel.position - weighed.position;
                let near = dot(step, step) < f32(BLOCK * BLOCK) * min(texel.area, weighed.area);
                if !(near && dot(texel_normal(texel), texel_normal(weighed)) > 0.95) {
                    weighed = texel;
                    own = texel_importance(row, column, texel);
                }
                weight = clamp(luminance * (own + importance.defensive_term), 1e-36, 1e30);
            }
            weights[row.first_weight + column] = weight;
        }
    }
}
