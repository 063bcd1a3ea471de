// Draws a camera's virtual point lights from the texels of its reflective shadow maps, in proportion to flux.
//
// The sequence is fixed (Hammersley), so a still scene has still VPLs. Rows are stratified by the first coordinate; the radical inverse places
// the texel in its row. Every VPL carries total · flux / (weight · count): the sum over VPLs is the sum over texels.

#import bevy_frugal_gi::gi::rsm::texel::Texel
#import bevy_frugal_gi::gi::vpl::vpl::Vpl

/// A row of one of the camera's maps.
struct Row {
    /// Index into the row sums.
    row: u32,
    /// Index of its first texel.
    first_texel: u32,
    /// Texels in it.
    length: u32,
}

@group(0) @binding(0) var<storage, read> texels: array<Texel>;
@group(0) @binding(1) var<storage, read> texel_cdf: array<f32>;
@group(0) @binding(2) var<storage, read> row_sums: array<f32>;
@group(0) @binding(3) var<storage, read> rows: array<Row>;
@group(0) @binding(4) var<storage, read_write> row_cdf: array<f32>;
@group(0) @binding(5) var<storage, read_write> vpls: array<Vpl>;

const LANES: u32 = 64u;
var<workgroup> lane_sums: array<f32, LANES>;

/// Cumulative sums over all rows of the camera's maps, in one workgroup: each lane sums a run of rows, then adds what lies before it.
@compute @workgroup_size(64)
fn accumulate_maps(@builtin(local_invocation_index) lane: u32) {
    let count = arrayLength(&row_cdf);
    let run = (count + LANES - 1u) / LANES;
    let first = min(lane * run, count);
    let end = min(first + run, count);
    var sum = 0.0;
    for (var i = first; i < end; i++) {
        sum += row_sums[rows[i].row];
    }
    lane_sums[lane] = sum;
    workgroupBarrier();
    var before = 0.0;
    for (var i = 0u; i < lane; i++) {
        before += lane_sums[i];
    }
    for (var i = first; i < end; i++) {
        before += row_sums[rows[i].row];
        row_cdf[i] = before;
    }
}

/// First index in [0, length) of `row_cdf` whose value exceeds `target`, or the last index.
fn find_row(wanted: f32) -> u32 {
    var low = 0u;
    var high = arrayLength(&row_cdf) - 1u;
    while low < high {
        let middle = (low + high) / 2u;
        if row_cdf[middle] > wanted {
            high = middle;
        } else {
            low = middle + 1u;
        }
    }
    return low;
}

/// The same within a row.
fn find_texel(first: u32, length: u32, wanted: f32) -> u32 {
    var low = first;
    var high = first + length - 1u;
    while low < high {
        let middle = (low + high) / 2u;
        if texel_cdf[middle] > wanted {
            high = middle;
        } else {
            low = middle + 1u;
        }
    }
    return low;
}

@compute @workgroup_size(64)
fn sample_vpls(@builtin(global_invocation_id) id: vec3<u32>) {
    let count = arrayLength(&vpls);
    if id.x >= count {
        return;
    }
    let total = row_cdf[arrayLength(&row_cdf) - 1u];
    let along_rows = (f32(id.x) + 0.5) / f32(count);
    // 2^-32, and never 1.
    let along_row = min(f32(reverseBits(id.x)) * 2.3283064e-10, 0.99999994);
    let row = rows[find_row(along_rows * total)];
    let texel = texels[find_texel(row.first_texel, row.length, along_row * row_sums[row.row])];

    // The last row or texel may be reached by rounding with nothing in it; then it carries nothing.
    let share = total / (max(texel.weight, 1e-30) * f32(count));
    var vpl: Vpl;
    vpl.position = texel.position;
    vpl.normal = texel.normal;
    vpl.flux = select(vec3(0.0), texel.flux * share, texel.weight > 0.0 && share < 1e30);
    vpls[id.x] = vpl;
}
