// What reflective shadow maps leave behind for the sampling of virtual point lights: 32 bytes a
// texel, since they are most of what GI holds.
#define_import_path bevy_frugal_gi::gi::texels::texel

#import bevy_pbr::utils::{octahedral_decode, octahedral_encode}
#import bevy_frugal_gi::gi::view::luminance::luminance

struct Texel {
    /// World space, metres.
    position: vec3<f32>,
    /// Of the surface that the texel covers, m².
    area: f32,
    /// Reflected flux, lumens: light through the texel × albedo. 0 where nothing is lit, or where
    /// anything was not finite.
    flux: vec3<f32>,
    /// See `texel_normal`.
    packed_normal: u32,
}

/// To 16 bits an axis, which is 16 times as fine as the G-buffer.
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
