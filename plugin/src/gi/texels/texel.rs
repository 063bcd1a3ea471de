//! A texel of the store as the CPU writes it, for sources without a reflective shadow map.

use bevy::math::Vec3;
use bytemuck::{Pod, Zeroable};

/// Bytes of a [`Texel`]. A test compares it with the shader.
pub(in crate::gi) const TEXEL_BYTES: u64 = size_of::<Texel>() as u64;

/// `texels/texel.wgsl`'s `Texel`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(in crate::gi) struct Texel {
    /// World space, metres.
    pub position: [f32; 3],
    /// Area of the surface that it represents, m².
    pub area: f32,
    /// Lumens.
    pub flux: [f32; 3],
    packed_normal: u32,
}

impl Texel {
    /// A texel; `normal` is a unit vector in world space.
    pub(crate) fn new(position: Vec3, area: f32, flux: Vec3, normal: Vec3) -> Self {
        Self {
            position: position.to_array(),
            area,
            flux: flux.to_array(),
            packed_normal: pack_normal(normal),
        }
    }
}

/// Octahedral coordinates (Cigolle et al. 2014) of 16 bits each, as `texels/texel.wgsl`'s function
/// of that name packs them.
pub(in crate::gi) fn pack_normal(normal: Vec3) -> u32 {
    let Vec3 { x, y, z } = normal / (normal.x.abs() + normal.y.abs() + normal.z.abs());
    let folded = |own: f32, other: f32| (1.0 - other.abs()) * if own > 0.0 { 1.0 } else { -1.0 };
    let (x, y) = if z >= 0.0 { (x, y) } else { (folded(x, y), folded(y, x)) };
    let bits = |value: f32| ((value * 0.5 + 0.5).clamp(0.0, 1.0) * 65535.0).round() as u32;
    bits(x) | bits(y) << 16
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unpack(packed: u32) -> Vec3 {
        let [x, y] = [packed & 0xFFFF, packed >> 16].map(|bits| bits as f32 / 65535.0 * 2.0 - 1.0);
        let z = 1.0 - x.abs() - y.abs();
        let fold = (-z).clamp(0.0, 1.0);
        let [x, y] = [x, y].map(|value| if value >= 0.0 { value - fold } else { value + fold });
        Vec3::new(x, y, z).normalize()
    }

    #[test]
    fn a_normal_is_kept_to_a_few_hundred_thousandths() {
        for i in 0..2000 {
            let (height, turn) = (1.0 - (i as f32 + 0.5) / 1000.0, i as f32 * 2.4);
            let around = (1.0 - height * height).max(0.0).sqrt();
            let normal = Vec3::new(around * turn.cos(), height, around * turn.sin());
            assert!((unpack(pack_normal(normal)) - normal).length() < 1e-4, "{normal}");
        }
        for axis in [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z] {
            assert!((unpack(pack_normal(axis)) - axis).length() < 1e-4, "{axis}");
        }
    }
}
