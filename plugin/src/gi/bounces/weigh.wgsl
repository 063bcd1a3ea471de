// Weighs the texels of a camera's reflective shadow maps for light that goes on to any surface, not only to those in view: by their flux, and by
// how dense patches are there.

#import bevy_frugal_gi::gi::bounces::patch::Around
#import bevy_frugal_gi::gi::rsm::texel::{Texel, texel_luminance}
#import bevy_frugal_gi::gi::vpl::rows::{Row, is_cut}

@group(0) @binding(0) var<storage, read> texels: array<Texel>;
@group(0) @binding(1) var<storage, read> rows: array<Row>;
@group(0) @binding(2) var<storage, read_write> weights: array<f32>;
@group(0) @binding(3) var<uniform> around: Around;

/// Light comes from farther away than it is worth dividing finely: beyond ten times the radius the density falls no more.
const FARTHEST: f32 = 100.0;

/// One thread per texel, a row of workgroups for each row.
@compute @workgroup_size(64)
fn weigh_flux(@builtin(global_invocation_id) id: vec3<u32>) {
    let row = rows[id.y];
    if id.x >= row.length {
        return;
    }
    // Within what a sum over all texels can hold, whatever the flux.
    let texel = texels[row.first_texel + id.x];
    let luminance = texel_luminance(texel);
    let steps = (texel.position - around.center) / around.near;
    let density = 1.0 / (1.0 + clamp(dot(steps, steps), 0.0, FARTHEST));
    weights[row.first_weight + id.x] = select(0.0, clamp(luminance * density, 1e-36, 1e30), luminance > 0.0 && !is_cut(row, id.x));
}
