// Picks some of a camera's patches as importance points: a texel's importance to them decides its
// probability of lighting patches (`vpl/weigh.wgsl`).
//
// Flux alone would not do: most sunlight falls on surfaces that no patch sees, or only distant
// ones.

#import bevy_frugal_gi::gi::bounces::patch::Patch
#import bevy_frugal_gi::gi::texels::texels::{Texel, texel_normal}
#import bevy_frugal_gi::gi::vpl::vpl::{IMPORTANCE_POINTS, ImportancePoints, ImportancePoint}

@group(0) @binding(0) var<storage, read> patches: array<Patch>;
@group(0) @binding(1) var<storage, read_write> importance: ImportancePoints;

/// Area that an importance point represents, as a share of the area of all patches from one picked
/// patch to the next, which lie on many surfaces.
const REACH: f32 = 0.1;

/// One thread per importance point. Patches are ordered by surface and along a space-filling curve
/// on each, denser near the camera: equal steps spread over all.
@compute @workgroup_size(IMPORTANCE_POINTS)
fn pick_patches(@builtin(local_invocation_index) index: u32) {
    let step = arrayLength(&patches) / IMPORTANCE_POINTS;
    let own = patches[index * step + step / 2u];
    var texel: Texel;
    texel.packed_normal = own.packed_normal;
    var point: ImportancePoint;
    point.position = own.position;
    point.normal = texel_normal(texel);
    point.radius_squared = select(0.0, clamp(own.area * f32(step) * REACH, 1e-12, 1e18), own.area > 0.0);
    point.pixel_width = 0.0;
    importance.points[index] = point;
}
