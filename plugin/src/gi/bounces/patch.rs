//! A patch: a piece of surface that reflects incident light.

use bevy::math::Vec3;
use bytemuck::{Pod, Zeroable};

use crate::gi::surfaces::MaterialSample;
use crate::gi::texels::pack_normal;

/// `bounces/patch.wgsl`'s `Patch`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(in crate::gi) struct Patch {
    /// World space, metres.
    pub position: [f32; 3],
    /// m².
    pub area: f32,
    /// Colour and roughness, and further properties, as Bevy's G-buffer packs them.
    color: u32,
    properties: u32,
    packed_normal: u32,
    padding: u32,
}

impl Patch {
    /// A patch; `normal` is a unit vector in world space.
    pub(crate) fn new(position: Vec3, area: f32, normal: Vec3, material: &MaterialSample) -> Self {
        let byte = |value: f32| (value * 255.0).round() as u32;
        let pack = |values: [f32; 4]| {
            values.into_iter().rev().fold(0, |packed, value| packed << 8 | byte(value))
        };
        let [red, green, blue] = material.color.to_array().map(|linear| linear.powf(1.0 / 2.2));
        Self {
            position: position.to_array(),
            area,
            color: pack([red, green, blue, material.roughness]),
            properties: pack([material.reflectance, material.metallic, 0.0, 0.0]),
            packed_normal: pack_normal(normal),
            padding: 0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_value_lies_in_the_lowest_byte() {
        let material = MaterialSample {
            color: Vec3::new(1.0, 0.0, 0.5),
            roughness: 0.2,
            metallic: 1.0,
            reflectance: 0.5,
        };
        let patch = Patch::new(Vec3::ZERO, 1.0, Vec3::Y, &material);
        assert_eq!(patch.color.to_le_bytes(), [255, 0, 186, 51]);
        assert_eq!(patch.properties.to_le_bytes(), [128, 255, 0, 0]);
    }
}
