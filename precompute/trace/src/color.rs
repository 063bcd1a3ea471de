//! Colours: luminance, and the sRGB transfer function.

use glam::DVec3;

/// Weights of linear red, green and blue in luminance: Rec. 709.
pub(crate) const LUMINANCE: DVec3 = DVec3::new(0.2126, 0.7152, 0.0722);

pub(crate) fn luminance(color: DVec3) -> f64 {
    color.dot(LUMINANCE)
}

pub(crate) fn color(rgb: [f32; 3]) -> DVec3 {
    DVec3::from_array(rgb.map(f64::from))
}

/// Linear light of an sRGB value; both in [0, 1]. IEC 61966-2-1.
pub(crate) fn linear_from_srgb(value: f32) -> f32 {
    if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
}

/// The sRGB value of linear light; both in [0, 1]. IEC 61966-2-1.
pub(crate) fn srgb_from_linear(value: f32) -> f32 {
    if value <= 0.003_130_8 { value * 12.92 } else { 1.055 * value.powf(1.0 / 2.4) - 0.055 }
}
