// Virtual point lights (Keller 1997, "Instant Radiosity"): their data, the points by which they are
// sampled, and the strata by which rays are shared among them.
#define_import_path bevy_frugal_gi::gi::vpl::vpl

#import bevy_frugal_gi::gi::view::noise::luminance

struct Vpl {
    /// World space, metres.
    position: vec3<f32>,
    /// Upper bound of the geometry term cosθ·cosθ′/d², 1/m²: 1/r² of the disk that it stands for.
    largest_geometry_term: f32,
    /// World space, unit length, on the emitting side.
    normal: vec3<f32>,
    /// Width of the texel that it was sampled from, metres.
    texel_width: f32,
    /// Reflected flux, lumens. Intensity along a direction at θ from the normal is flux · cosθ / π
    /// candela.
    flux: vec3<f32>,
    /// Share of its importance that tiles leave visible: 0.05 to 1, and 1 where no tile is traced. A guess,
    /// by which rays choose among VPLs.
    visibility: f32,
}

/// Lumens: with this bound, sums over all texels, and the irradiance from a thousand VPLs at any
/// distance, stay finite.
const MAX_FLUX: f32 = 1e25;

/// m², with which the irradiance from a thousand VPLs stays finite at any distance.
const MIN_RADIUS_SQUARED: f32 = 1e-10;

/// `Vpl::largest_geometry_term` of one that stands for a disk of `area`, m².
fn bound_of(area: f32) -> f32 {
    return 1.0 / clamp(area * 0.31830987, MIN_RADIUS_SQUARED, 1e18);
}

/// Unoccluded irradiance from one VPL, times π: the factor 1/π of its cosine lobe is applied to the
/// sum. Lux · π.
///
/// The bound on the geometry term removes the singularity near a VPL, which stands for a disk of
/// surface: irradiance never exceeds that from an infinite plane of the disk's radiosity. The more
/// VPLs, the smaller the disks, and the clamping loss in corners vanishes with them; that of one
/// bound for the whole scene (Dachsbacher and Stamminger 2005) does not.
fn from_vpl(vpl: Vpl, position: vec3<f32>, normal: vec3<f32>) -> vec3<f32> {
    let to_light = vpl.position - position;
    // Two divisions by d² rather than one by d⁴ keep every distance from 1e-9 m to 1e19 m in range;
    // at distance 0 both cosines are 0.
    let inverse = 1.0 / clamp(dot(to_light, to_light), 1e-18, 1e38);
    let receiver = max(dot(normal, to_light), 0.0) * inverse;
    let emitter = max(-dot(vpl.normal, to_light), 0.0) * inverse;
    return vpl.flux * min(receiver * emitter, vpl.largest_geometry_term);
}

/// A camera's low-resolution pixels, and how its virtual point lights and its sky samples are
/// interleaved among them. In a storage buffer because loops depend on its counts: software Vulkan
/// drivers recompile a shader for each value of a uniform that control flow depends on.
struct Plan {
    /// Side of the square of low-resolution pixels among which the VPLs are interleaved.
    interleave: u32,
    /// Sets of VPLs and of sky samples: `interleave`². Each represents all light.
    sets: u32,
    /// VPLs in each set.
    per_set: u32,
    /// Sky samples in each set.
    sky_samples: u32,
    /// Which samples of the weights: 0 while something changes, others at rest.
    sequence: u32,
    /// Width and height of a low-resolution pixel, in pixels.
    cell_width: u32,
    cell_height: u32,
}

/// A surface point that stands for all visible surfaces, with others (or, for bounces, for all
/// patches).
struct ImportancePoint {
    /// World space, metres.
    position: vec3<f32>,
    /// Squared radius of the disk that it stands for, m²; 0 where there is no surface.
    radius_squared: f32,
    /// World space, unit length.
    normal: vec3<f32>,
    /// Width of its pixel, metres.
    pixel_width: f32,
}

/// Columns and rows of the grid over the image, with one point in each rectangle.
const COLUMNS: u32 = 8u;
const ROWS: u32 = 4u;
const IMPORTANCE_POINTS: u32 = COLUMNS * ROWS;

struct ImportancePoints {
    /// Defensive-sampling term: added to the importance of every texel, 1/m².
    defensive_term: f32,
    points: array<ImportancePoint, IMPORTANCE_POINTS>,
}

/// Importance of a surface point to an importance point: their unoccluded geometry term, 1/m².
fn importance_of(point: ImportancePoint, position: vec3<f32>, normal: vec3<f32>) -> f32 {
    let to_point = position - point.position;
    let square = clamp(dot(to_point, to_point), 1e-18, 1e30);
    let cosines = max(dot(point.normal, to_point), 0.0) * max(-dot(normal, to_point), 0.0) / square;
    return select(0.0, cosines / (square + point.radius_squared), point.radius_squared > 0.0);
}

/// The pixel of an importance point: in the middle of a grid's rectangle, every other row shifted by
/// half a rectangle.
fn importance_pixel(index: u32, size: vec2<u32>) -> vec2<u32> {
    let cell = vec2<f32>(vec2(index % COLUMNS, index / COLUMNS));
    let shift = select(0.75, 0.25, (index / COLUMNS) % 2u == 0u);
    let uv = (cell + vec2(shift, 0.5)) / vec2(f32(COLUMNS), f32(ROWS));
    return min(vec2<u32>(uv * vec2<f32>(size)), size - 1u);
}

/// One light sampled from a stratum of many, in proportion to the irradiance from each.
///
/// Each stratum takes one ray. The ray to the sampled light accepts or rejects the irradiance of the
/// whole stratum. In luminance the expectation is the sum over the visible lights, whatever occludes
/// the others, and rays go where light comes from: one step of resampled importance sampling (Talbot
/// et al. 2005) with its candidates in a fixed order.
struct Stratum {
    /// Unoccluded irradiance from all its lights, lux · π.
    sent: vec3<f32>,
    /// Sum of the lights' weights: their luminance.
    total: f32,
    /// The random number, in 0 to 1: one for the whole stratum. After each candidate it is
    /// rescaled, which leaves it uniform (reservoir sampling by Chao 1982, with the number reused).
    number: f32,
    /// Index of the sampled light.
    sampled: u32,
}

/// A stratum without lights; `number` in 0 to 1.
fn empty_stratum(number: f32) -> Stratum {
    return Stratum(vec3(0.0), 0.0, number, 0u);
}

fn weight_of(light: vec3<f32>) -> f32 {
    // Keeps a sum over a thousand lights finite.
    return min(luminance(light), 1e30);
}

/// Adds one candidate with unoccluded irradiance `light` to the reservoir.
fn update_stratum(stratum: Stratum, index: u32, light: vec3<f32>) -> Stratum {
    let weight = weight_of(light);
    let total = stratum.total + weight;
    let probability = weight / max(total, 1e-35);
    let accepted = stratum.number < probability;
    return Stratum(
        stratum.sent + light,
        total,
        select((stratum.number - probability) / (1.0 - probability), stratum.number / probability, accepted),
        select(stratum.sampled, index, accepted),
    );
}
