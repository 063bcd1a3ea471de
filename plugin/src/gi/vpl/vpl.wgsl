// A virtual point light: Keller 1997, "Instant Radiosity".
#define_import_path bevy_frugal_gi::gi::vpl::vpl

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
