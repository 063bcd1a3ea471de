// Texels, from which virtual point lights are sampled: 32 bytes each, since they take most of GI's
// memory.
#define_import_path bevy_frugal_gi::gi::texels::texel

#import bevy_pbr::utils::{octahedral_decode, octahedral_encode}
#import bevy_frugal_gi::gi::view::luminance::luminance

struct Texel {
    /// World space, metres.
    position: vec3<f32>,
    /// Area of the surface that the texel covers, m².
    area: f32,
    /// Reflected or emitted flux, lumens. 0 where nothing is lit, or where a value was not finite.
    flux: vec3<f32>,
    /// See `texel_normal`.
    packed_normal: u32,
}

/// Octahedral, 16 bits per axis: 16 times as fine as the G-buffer.
fn pack_normal(normal: vec3<f32>) -> u32 {
    return pack2x16unorm(octahedral_encode(normal));
}

/// World space, unit length.
fn texel_normal(texel: Texel) -> vec3<f32> {
    return octahedral_decode(unpack2x16unorm(texel.packed_normal));
}

/// Luminance of the flux.
fn texel_luminance(texel: Texel) -> f32 {
    return luminance(texel.flux);
}
