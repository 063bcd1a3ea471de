// Picks some of a camera's patches to stand for all: what they could receive of a texel decides how
// likely it is to light patches (`vpl/weigh.wgsl`).
//
// Flux alone would not do: most of the sun's light falls on what no patch sees, or only patches far
// away.

#import bevy_frugal_gi::gi::bounces::patch::Patch
#import bevy_frugal_gi::gi::texels::texel::{Texel, texel_normal}
#import bevy_frugal_gi::gi::vpl::importance::{IMPORTANCE_POINTS, ImportancePoints, Receiver}

@group(0) @binding(0) var<storage, read> patches: array<Patch>;
@group(0) @binding(1) var<storage, read_write> importance: ImportancePoints;

/// How much of the surface around a patch it stands for here, as a share of what all patches
/// between two that are picked cover: they lie along many surfaces.
const REACH: f32 = 0.1;

/// One thread per receiver. Patches lie surface by surface and along a curve through each, denser
/// near the camera: equal steps spread over all.
@compute @workgroup_size(IMPORTANCE_POINTS)
fn pick_patches(@builtin(local_invocation_index) index: u32) {
    let step = arrayLength(&patches) / IMPORTANCE_POINTS;
    let own = patches[index * step + step / 2u];
    var texel: Texel;
    texel.packed_normal = own.packed_normal;
    var point: Receiver;
    point.position = own.position;
    point.normal = texel_normal(texel);
    point.radius_squared = select(0.0, clamp(own.area * f32(step) * REACH, 1e-12, 1e18), own.area > 0.0);
    point.pixel_width = 0.0;
    importance.points[index] = point;
}
