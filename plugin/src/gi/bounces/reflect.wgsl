// Patches are pieces of surface that reflect incident light.
//
// Some of a camera's become importance points: a texel's importance to them decides its probability of
// lighting patches (`vpl/weigh.wgsl`). Flux alone would not do: most sunlight falls on surfaces that no
// patch sees, or only distant ones.
//
// Then the flux that each patch reflects: a thread for each ray of a patch. In the first round patches are
// lit by bounce VPLs, sampled from the maps' texels and from emissive surfaces, and by the camera's sky where
// it is gathered (SKY). Every patch evaluates all of them: small sets would be blotchy near bright spots. In later
// rounds (FURTHER) patches light each other: each evaluates every other one, of which neighbours are alike.
// Visibility by rays as in `gather/gather.wgsl`.
//
// The sum of all rounds becomes texels behind those of the maps.

#import bevy_render::view::View
#import bevy_frugal_gi::gi::texels::texels::{Texel, texel_normal}
#import bevy_frugal_gi::gi::view::surface::{apparent_distance, scattered_share}
#import bevy_frugal_gi::gi::vpl::vpl::{
    IMPORTANCE_POINTS, ImportancePoint, ImportancePoints, MAX_FLUX, Vpl, bound_of, empty_stratum, from_vpl, update_stratum,
}
#import bevy_frugal_gi::gi::trace::trace::{begin_trace, is_occluded, is_open, surface_offset}
#ifdef SKY
#import bevy_frugal_gi::gi::sky::sky::{SKY_STRIDE, SkyLight}
#import bevy_frugal_gi::gi::vpl::vpl::Plan
#endif

struct Patch {
    /// World space, metres.
    position: vec3<f32>,
    /// m²; 0 for padding.
    area: f32,
    /// As in the G-buffer: colour and roughness, and further properties.
    color: u32,
    properties: u32,
    packed_normal: u32,
    padding: u32,
}

struct PatchRange {
    /// Index of the first patch's texel in the store.
    first_texel: u32,
    /// Largest ratio of the second round's light to the first's: 0 where rounds that are not run do not
    /// count.
    largest_ratio: f32,
}

// To pick importance points.
@group(0) @binding(0) var<storage, read> candidates: array<Patch>;
@group(0) @binding(1) var<storage, read_write> importance: ImportancePoints;
// To reflect.
@group(0) @binding(0) var<uniform> view: View;
#ifdef FURTHER
@group(0) @binding(1) var<storage, read> sources: array<Vpl>;
#else
@group(0) @binding(1) var<uniform> sources: array<Vpl, BOUNCE_VPLS>;
#endif
@group(0) @binding(2) var<storage, read> patches: array<Patch>;
/// What patches reflected in the last round, lumens.
@group(0) @binding(3) var<storage, read_write> light: array<vec3<f32>>;
#ifdef SKY
@group(0) @binding(4) var<storage, read> sky_samples: array<SkyLight>;
@group(0) @binding(5) var<storage, read> plan: Plan;
#endif
// To make VPLs of patches, and to sum up.
@group(0) @binding(1) var<storage, read_write> emitters: array<Vpl>;
@group(0) @binding(6) var<uniform> range: PatchRange;
/// Until the sum, the flux of a patch's texel is that of the rounds before the last.
@group(0) @binding(7) var<storage, read_write> texels: array<Texel>;

/// Area that an importance point represents, as a share of the area of all patches from one picked
/// patch to the next, which lie on many surfaces.
const REACH: f32 = 0.1;
/// As in `bounces/camera.rs`. Constants, so that no loop depends on a uniform.
const BOUNCE_VPLS: u32 = 1024u;
const PATCHES: u32 = 2048u;
/// All sources, and of how many neighbouring ones a patch evaluates one: as often those with itself as without.
#ifdef FURTHER
const SOURCES: u32 = PATCHES;
const OF_SOURCES: u32 = 2u;
#else
const SOURCES: u32 = BOUNCE_VPLS;
const OF_SOURCES: u32 = 1u;
#endif
/// Rays from each patch to the sky.
const SKY_RAYS: u32 = 2u;

/// Mean cosine of uniform incident light: the scattered share depends little on its direction
/// otherwise.
const MEAN_COSINE: f32 = 0.6666667;

/// Threads of a patch: each takes one of its rays.
const LANES: u32 = 8u;
/// Patches of a workgroup.
const GROUP_PATCHES: u32 = 8u;

/// Light that arrives at each patch by each of its rays.
var<workgroup> arrived: array<vec3<f32>, 64>;

/// One thread per importance point. Patches are ordered by surface and along a space-filling curve
/// on each, denser near the camera: equal steps spread over all.
@compute @workgroup_size(IMPORTANCE_POINTS)
fn pick_patches(@builtin(local_invocation_index) index: u32) {
    let step = arrayLength(&candidates) / IMPORTANCE_POINTS;
    let own = candidates[index * step + step / 2u];
    var texel: Texel;
    texel.packed_normal = own.packed_normal;
    var point: ImportancePoint;
    point.position = own.position;
    point.normal = texel_normal(texel);
    point.radius_squared = select(0.0, clamp(own.area * f32(step) * REACH, 1e-12, 1e18), own.area > 0.0);
    point.pixel_width = 0.0;
    importance.points[index] = point;
}

/// World space, unit length.
fn patch_normal(own: Patch) -> vec3<f32> {
    var texel: Texel;
    texel.packed_normal = own.packed_normal;
    return texel_normal(texel);
}

/// One thread per patch: a VPL of its light of the last round, which joins that of the rounds before.
@compute @workgroup_size(64)
fn emit_patches(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= arrayLength(&patches) {
        return;
    }
    let own = patches[id.x];
    var vpl: Vpl;
    vpl.position = own.position;
    vpl.normal = patch_normal(own);
    vpl.texel_width = sqrt(clamp(own.area, 0.0, 1e18));
    vpl.largest_geometry_term = bound_of(own.area);
    vpl.flux = light[id.x];
    vpl.visibility = 1.0;
    emitters[id.x] = vpl;
    texels[range.first_texel + id.x].flux += light[id.x];
}

@compute @workgroup_size(LANES, GROUP_PATCHES)
fn reflect_patches(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    begin_trace(thread);
    let which = id.x;
    let index = id.y;
    let own = patches[min(index, arrayLength(&patches) - 1u)];
    var incident = vec3(0.0);
    if own.area > 0.0 {
        let normal = patch_normal(own);
        let origin = own.position + normal * surface_offset(own.position, apparent_distance(view.clip_from_view, distance(own.position, view.world_position)), 0.0);
        let noise = fract(f32(index) * 0.618034);
        var stratum = empty_stratum(fract(noise + f32(which) / f32(LANES)));
        for (var i = which * OF_SOURCES + (index / 2u) % OF_SOURCES; i < SOURCES; i += LANES * OF_SOURCES) {
            var vpl = sources[i];
            // No patch receives more than a VPL's whole flux.
            vpl.largest_geometry_term = min(vpl.largest_geometry_term, 3.1415927 / max(own.area, 1e-18));
            stratum = update_stratum(stratum, i, from_vpl(vpl, own.position, normal));
        }
        if stratum.total > 0.0 {
            let vpl = sources[stratum.sampled];
            let end = vpl.position + vpl.normal * surface_offset(vpl.position, apparent_distance(view.clip_from_view, distance(vpl.position, view.world_position)), vpl.texel_width);
            if !is_occluded(origin, end) {
                incident = stratum.sent * f32(OF_SOURCES);
            }
        }
#ifdef SKY
        if which < SKY_RAYS {
            let first_sample = (index % plan.sets) * SKY_STRIDE;
            stratum = empty_stratum(fract(noise + f32(which) / f32(SKY_RAYS)));
            for (var i = first_sample + which; i < first_sample + plan.sky_samples; i += SKY_RAYS) {
                stratum = update_stratum(stratum, i, sky_samples[i].light * max(dot(normal, sky_samples[i].direction), 0.0));
            }
            if stratum.total > 0.0 {
                if is_open(origin, sky_samples[stratum.sampled].direction) {
                    incident += stratum.sent;
                }
            }
        }
#endif
    }
    arrived[thread] = incident;
    workgroupBarrier();
    if which != 0u || index >= arrayLength(&patches) {
        return;
    }
    incident = vec3(0.0);
    for (var lane = 0u; lane < LANES; lane++) {
        incident += arrived[thread + lane];
    }
    let share = min(scattered_share(vec4(own.color, 0u, own.properties, 0u), MEAN_COSINE), vec3(1.0));
    let flux = incident * 0.31830987 * own.area * share;
    // Not where it is not a number.
    light[index] = select(vec3(0.0), min(flux, vec3(MAX_FLUX)), flux >= vec3(0.0));
}

const SUM_LANES: u32 = 256u;
/// Flux of all patches in the last round, and in those before; scaled, so that sums stay finite.
var<workgroup> last_sums: array<vec3<f32>, 256>;
var<workgroup> before_sums: array<vec3<f32>, 256>;

/// Writes the patches' texels: their light of all rounds, those that were not run included. Rounds soon differ
/// by a factor, as powers of a matrix do (Aitken 1926), so their sum is a geometric series. One workgroup.
@compute @workgroup_size(SUM_LANES)
fn sum_rounds(@builtin(local_invocation_index) lane: u32) {
    let count = arrayLength(&light);
    var last = vec3(0.0);
    var before = vec3(0.0);
    for (var i = lane; i < count; i += SUM_LANES) {
        last += light[i] * 1e-5;
        before += texels[range.first_texel + i].flux * 1e-5;
    }
    last_sums[lane] = last;
    before_sums[lane] = before;
    workgroupBarrier();
    for (var half = SUM_LANES / 2u; half > 0u; half /= 2u) {
        if lane < half {
            last_sums[lane] += last_sums[lane + half];
            before_sums[lane] += before_sums[lane + half];
        }
        workgroupBarrier();
    }
    let ratio = min(last_sums[0] / max(before_sums[0], vec3(1e-30)), vec3(range.largest_ratio));
    let rest = ratio / (1.0 - ratio);
    for (var i = lane; i < count; i += SUM_LANES) {
        var texel: Texel;
        texel.position = patches[i].position;
        texel.area = patches[i].area;
        texel.packed_normal = patches[i].packed_normal;
        let total = texels[range.first_texel + i].flux + light[i];
        texel.flux = min(total + light[i] * rest, vec3(MAX_FLUX));
        texels[range.first_texel + i] = texel;
    }
}
