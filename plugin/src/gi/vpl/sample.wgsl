// Samples a camera's virtual point lights from the texels of its reflective shadow maps, in
// proportion to their weights (see `weigh.wgsl`).
//
// The sequence is fixed while something changes, so a slow camera has nearly still VPLs. At rest each
// frame has another one: shifts by the R2 sequence (Roberts 2018) spread them. Each set of VPLs (see `Plan`) is a
// Hammersley set of its own: the first coordinate stratifies rows, the radical inverse places the
// texel in its row. Sets are shifted against each other, rows by a fraction of a stratum and texels
// by multiples of the golden ratio, so that their union is one stratified set of all VPLs. Every
// VPL carries total · flux / (weight · count of its set): the expectation of the sum over a set is
// the sum over texels, without variance where weights are proportional to flux.

#import bevy_frugal_gi::gi::texels::texels::{Row, TILE, Texel, texel_normal}
#import bevy_frugal_gi::gi::vpl::vpl::{IMPORTANCE_POINTS, ImportancePoints, MAX_FLUX, Plan, Vpl, bound_of, importance_of}

@group(0) @binding(0) var<storage, read> texels: array<Texel>;
@group(0) @binding(1) var<storage, read> rows: array<Row>;
/// Weights; after the first pass, their cumulative sums along each row.
@group(0) @binding(2) var<storage, read_write> texel_cdf: array<f32>;
/// Cumulative sums of rows within chunks of them; behind them the chunks' sums.
@group(0) @binding(3) var<storage, read_write> row_cdf: array<f32>;
@group(0) @binding(4) var<storage, read_write> vpls: array<Vpl>;
@group(0) @binding(5) var<storage, read> plan: Plan;
#ifdef TILE_VISIBILITY
@group(0) @binding(6) var<storage, read> importance: ImportancePoints;
@group(0) @binding(7) var<storage, read> occluded_tiles: array<u32>;
#endif

/// Rows that are added up together.
const CHUNK: u32 = 64u;
var<workgroup> sums: array<f32, CHUNK>;

/// A lane's sum and those of the lanes before it.
fn add_up_lanes(lane: u32, own: f32) -> f32 {
    sums[lane] = own;
    workgroupBarrier();
    var sum = own;
    for (var i = 0u; i < lane; i++) {
        sum += sums[i];
    }
    return sum;
}

/// Replaces the weights of each row by their cumulative sums; one thread per row.
@compute @workgroup_size(CHUNK)
fn accumulate_rows(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(workgroup_id) chunk: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let count = arrayLength(&rows);
    let row = rows[min(id.x, count - 1u)];
    let length = select(0u, row.length, id.x < count);
    var sum = 0.0;
    for (var column = 0u; column < length; column++) {
        sum += texel_cdf[row.first_weight + column];
        texel_cdf[row.first_weight + column] = sum;
    }
    let up_to_row = add_up_lanes(lane, sum);
    if id.x < count {
        row_cdf[id.x] = up_to_row;
    }
    if lane == CHUNK - 1u {
        row_cdf[count + chunk.x] = up_to_row;
    }
}

/// Chunks that a thread adds up.
fn chunks_of_a_lane() -> u32 {
    return (arrayLength(&row_cdf) - arrayLength(&rows) + CHUNK - 1u) / CHUNK;
}

/// Makes `sums` those of all chunks up to a lane's last.
fn add_up_chunks(lane: u32) {
    let first = arrayLength(&rows) + lane * chunks_of_a_lane();
    let end = min(first + chunks_of_a_lane(), arrayLength(&row_cdf));
    var sum = 0.0;
    for (var i = first; i < end; i++) {
        sum += row_cdf[i];
    }
    let up_to_lane = add_up_lanes(lane, sum);
    workgroupBarrier();
    sums[lane] = up_to_lane;
    workgroupBarrier();
}

/// First row up to which the sum exceeds `threshold`. Rounding may end a search at a last row, of any
/// weight.
fn find_row(threshold: f32) -> u32 {
    var lane = 0u;
    while lane < CHUNK - 1u && sums[lane] <= threshold {
        lane++;
    }
    var left = threshold - select(0.0, sums[max(lane, 1u) - 1u], lane > 0u);
    let count = arrayLength(&rows);
    let chunks = arrayLength(&row_cdf) - count;
    var chunk = min(lane * chunks_of_a_lane(), chunks - 1u);
    let last = min(chunk + chunks_of_a_lane(), chunks) - 1u;
    while chunk < last && row_cdf[count + chunk] <= left {
        left -= row_cdf[count + chunk];
        chunk++;
    }
    var low = chunk * CHUNK;
    var high = min(low + CHUNK, count) - 1u;
    while low < high {
        let middle = (low + high) / 2u;
        if row_cdf[middle] > left {
            high = middle;
        } else {
            low = middle + 1u;
        }
    }
    return low;
}

/// The same within a row.
fn find_texel(first: u32, length: u32, threshold: f32) -> u32 {
    var low = first;
    var high = first + length - 1u;
    while low < high {
        let middle = (low + high) / 2u;
        if texel_cdf[middle] > threshold {
            high = middle;
        } else {
            low = middle + 1u;
        }
    }
    return low;
}

#ifdef TILE_VISIBILITY
/// Least guess: where it is wrong, one ray brings up to so many times its share.
const LEAST_VISIBILITY: f32 = 0.05;

/// Share of a texel's importance to points that see its tile.
fn visibility_of(tile: u32, position: vec3<f32>, normal: vec3<f32>) -> f32 {
    let occluded = occluded_tiles[tile];
    var all = 0.0;
    var seen = 0.0;
    for (var i = 0u; i < IMPORTANCE_POINTS; i++) {
        let own = importance_of(importance.points[i], position, normal);
        all += own;
        seen += select(own, 0.0, (occluded & (1u << i)) != 0u);
    }
    return select(1.0, clamp(seen / all, LEAST_VISIBILITY, 1.0), all > 1e-30);
}
#endif

@compute @workgroup_size(CHUNK)
fn sample_vpls(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    add_up_chunks(lane);
    if id.x >= plan.sets * plan.per_set {
        return;
    }
    let which = id.x / plan.per_set;
    let member = id.x % plan.per_set;
    let total = sums[CHUNK - 1u];
    let count = f32(plan.per_set);
    let shift = f32(plan.sequence) * vec2(0.7548777, 0.5698403);
    let along_rows = (f32(member) + fract((f32(which) + 0.5) / f32(plan.sets) + shift.x)) / count;
    // 2^-32; and never 1.
    let along_row = min(fract(f32(reverseBits(member)) * 2.3283064e-10 + f32(which) * 0.618034 + shift.y), 0.99999994);
    let row = rows[find_row(along_rows * total)];
    let last = row.first_weight + row.length - 1u;
    let index = find_texel(row.first_weight, row.length, along_row * texel_cdf[last]);
    let texel = texels[row.first_texel + index - row.first_weight];
    // The step of the cumulative sum, not the weight that was added: this is the probability with
    // which the texel was sampled, rounding included.
    let weight = texel_cdf[index] - select(0.0, texel_cdf[max(index, 1u) - 1u], index > row.first_weight);

    // Rounding may reach a last row or texel of weight 0: its VPL carries no flux.
    let share = total / (max(weight, 1e-36) * count);
    let carries = weight > 0.0 && share < 1e30;
    var vpl: Vpl;
    vpl.position = texel.position;
    vpl.normal = texel_normal(texel);
    vpl.texel_width = sqrt(clamp(texel.area, 0.0, 1e18));
    // All texels that the VPL stands for among all sets' VPLs, at least its own.
    vpl.largest_geometry_term = bound_of(texel.area * max(share / f32(plan.sets), 1.0));
    vpl.flux = select(vec3(0.0), min(texel.flux * (row.share * share), vec3(MAX_FLUX)), carries);
    vpl.visibility = 1.0;
#ifdef TILE_VISIBILITY
    vpl.visibility = visibility_of(row.first_tile + (index - row.first_weight) / TILE, vpl.position, vpl.normal);
#endif
    vpls[id.x] = vpl;
}
