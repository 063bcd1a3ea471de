// What reflective shadow maps leave behind for the sampling of virtual point lights.
#define_import_path bevy_frugal_gi::gi::rsm::texel

struct Texel {
    /// World space, metres.
    position: vec3<f32>,
    /// Luminance of `flux`: the texel's importance. 0 where nothing is lit, or where anything was not finite.
    weight: f32,
    /// World space, unit length.
    normal: vec3<f32>,
    padding: f32,
    /// Reflected flux, lumens: light through the texel × albedo.
    flux: vec3<f32>,
    padding_2: f32,
}
