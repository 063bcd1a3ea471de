//! A material's emission, in nits, as a camera shows it.

use bevy::math::{DVec3, Vec3};
use bevy::pbr::StandardMaterial;
use bevy::prelude::AlphaMode;

use crate::gi::surfaces::{Mask, Sides, TextureUse, is_deferred};

/// The emission of a material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Emission {
    /// Linear RGB, nits.
    exposed: Vec3,
    /// Linear RGB on screen, independent of the camera's exposure; divided by the exposure, nits.
    pub unexposed: Vec3,
    pub sides: Sides,
    pub texture: Option<TextureUse>,
    /// Its alpha mask.
    pub mask: Option<Mask>,
}

impl Emission {
    /// Radiance for a camera of `exposure`: nits, linear RGB, to be multiplied by the texture's
    /// colour.
    pub(crate) fn radiance(&self, exposure: Option<f32>) -> DVec3 {
        let unexposed = exposure
            .filter(|exposure| *exposure > 0.0)
            .map_or(DVec3::ZERO, |e| self.unexposed.as_dvec3() / f64::from(e));
        self.exposed.as_dvec3() + unexposed
    }
}

/// The emission of `material`; `None` where it is black, negative or not finite.
pub(super) fn emission(material: &StandardMaterial) -> Option<Emission> {
    let color = Vec3::new(material.emissive.red, material.emissive.green, material.emissive.blue);
    let alpha = material.base_color.to_linear().alpha.clamp(0.0, 1.0);
    // As in Bevy 0.19: alpha multiplies in the shader, and again in blending.
    let opacity = match material.alpha_mode {
        AlphaMode::Opaque | AlphaMode::Mask(_) | AlphaMode::AlphaToCoverage => 1.0,
        AlphaMode::Premultiplied => alpha,
        AlphaMode::Blend | AlphaMode::Add => alpha * alpha,
        AlphaMode::Multiply => 0.0,
    };
    let color = color * opacity;
    if material.unlit
        || !color.is_finite()
        || color.min_element() < 0.0
        || color.max_element() <= 0.0
    {
        return None;
    }
    // The G-buffer does not store the weight: Bevy 0.19 uses 0 there.
    let weight =
        if is_deferred(material) { 0.0 } else { material.emissive_exposure_weight.clamp(0.0, 1.0) };
    let sides = Sides::shown(material.cull_mode);
    let texture = material.emissive_texture.as_ref();
    let texture = texture
        .map(|image| TextureUse::new(image, &material.emissive_channel, material.uv_transform));
    Some(Emission {
        exposed: color * weight,
        unexposed: color * (1.0 - weight),
        sides,
        texture,
        mask: Mask::new(material),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy::color::LinearRgba;
    use bevy::material::OpaqueRendererMethod;
    use bevy::render::render_resource::Face;

    fn emissive(red: f32, green: f32, blue: f32) -> StandardMaterial {
        StandardMaterial { emissive: LinearRgba::rgb(red, green, blue), ..Default::default() }
    }

    #[test]
    fn black_negative_and_non_finite_colours_emit_nothing() {
        for color in [[0.0; 3], [-1.0, 5.0, 5.0], [f32::NAN, 1.0, 1.0], [f32::INFINITY, 1.0, 1.0]] {
            assert_eq!(emission(&emissive(color[0], color[1], color[2])), None);
        }
        assert!(
            emission(&emissive(1e20, 0.0, 0.0)).is_some()
                && emission(&StandardMaterial { unlit: true, ..emissive(1.0, 1.0, 1.0) }).is_none()
        );
        assert!(
            emission(&StandardMaterial {
                alpha_mode: AlphaMode::Multiply,
                ..emissive(1.0, 1.0, 1.0)
            })
            .is_none()
        );
    }

    #[test]
    fn nits_match_the_brightness_on_screen() {
        let exposure = Some(0.001);
        let red = |material: &StandardMaterial| emission(material).unwrap().radiance(exposure).x;
        // Deferred: as bright on screen at any exposure.
        assert!((red(&emissive(2.0, 0.0, 0.0)) - 2000.0).abs() < 1e-3);
        let weighted =
            StandardMaterial { emissive_exposure_weight: 1.0, ..emissive(2.0, 0.0, 0.0) };
        assert!((red(&weighted) - 2000.0).abs() < 1e-3, "the G-buffer stores no weight");
        let forward =
            StandardMaterial { opaque_render_method: OpaqueRendererMethod::Forward, ..weighted };
        assert!((red(&forward) - 2.0).abs() < 1e-6);
        let half = StandardMaterial { emissive_exposure_weight: 0.5, ..forward };
        assert!((red(&half) - 1001.0).abs() < 1e-3);
    }

    #[test]
    fn culled_sides_emit_nothing() {
        let sides = |cull_mode| {
            emission(&StandardMaterial { cull_mode, ..emissive(1.0, 1.0, 1.0) }).unwrap().sides
        };
        assert_eq!(
            [Some(Face::Back), Some(Face::Front), None].map(sides),
            [Sides::Front, Sides::Back, Sides::Both]
        );
    }
}
