// A virtual point light: Keller 1997, "Instant Radiosity".
#define_import_path bevy_frugal_gi::gi::vpl::vpl

struct Vpl {
    /// World space, metres.
    position: vec3<f32>,
    /// Most that the geometry term cosθ·cosθ′/d² may be, 1/m²: 1/r² of the disk that it stands for.
    largest_geometry_term: f32,
    /// World space, unit length: the side that emits.
    normal: vec3<f32>,
    /// Width of the texel that it was drawn from, metres.
    texel_width: f32,
    /// Reflected flux, lumens. Intensity along a direction at θ from the normal is flux · cosθ / π candela.
    flux: vec3<f32>,
    padding_3: f32,
}
