// A virtual point light: Keller 1997, "Instant Radiosity".
#define_import_path bevy_frugal_gi::gi::vpl::vpl

struct Vpl {
    /// World space, metres.
    position: vec3<f32>,
    /// Of the disk that it stands for, m²; above 0.
    radius_squared: f32,
    /// World space, unit length: the side that emits.
    normal: vec3<f32>,
    padding_2: f32,
    /// Reflected flux, lumens. Intensity along a direction at θ from the normal is flux · cosθ / π candela.
    flux: vec3<f32>,
    padding_3: f32,
}
