//! From radiance to display-referred images.
//!
//! Narkowicz 2015, "ACES Filmic Tone Mapping Curve": a rational fit of the reference curve of the
//! Academy Color Encoding System, on each channel, then sRGB. It is not the curve that the stage's
//! camera has (Bevy's `TonyMcMapface` is a table on the GPU): images of the two differ in contrast
//! and are for viewing, while figures come from radiance.

use super::{Picture, Radiance};
use crate::color::srgb_from_linear;

/// Exposure factor for scene-referred values at an exposure value at ISO 100, as in Bevy's cameras:
/// 1 ÷ (1.2 · 2^EV) per nit.
pub fn exposure(ev100: f32) -> f64 {
    1.0 / (1.2 * f64::from(ev100).exp2())
}

/// The exposure value at ISO 100 at which the median luminance of the pixels that are not black
/// becomes middle grey, 0.18; 0 where all are black.
pub fn middle_grey_ev100(radiance: &Radiance) -> f32 {
    let mut lit: Vec<f32> = radiance
        .luminance()
        .filter(|luminance| *luminance > 0.0 && luminance.is_finite())
        .collect();
    if lit.is_empty() {
        return 0.0;
    }
    let middle = lit.len() / 2;
    let (_, median, _) = lit.select_nth_unstable_by(middle, f32::total_cmp);
    (f64::from(*median) / (1.2 * 0.18)).log2() as f32
}

/// The display-referred image at an exposure value at ISO 100. NaN and negative values are black.
pub fn display(radiance: &Radiance, ev100: f32) -> Picture {
    let exposure = exposure(ev100);
    let byte = |nits: f32| {
        (srgb_from_linear(curve(f64::from(nits) * exposure) as f32) * 255.0 + 0.5) as u8
    };
    Picture {
        width: radiance.width,
        height: radiance.height,
        rgb: radiance.rgb.iter().map(|pixel| pixel.map(byte)).collect(),
    }
}

/// Exposed light in [0, ∞] to display light in [0, 1].
fn curve(light: f64) -> f64 {
    // In this form NaN becomes black. Far above the curve's end the quotient would be infinity ÷
    // infinity.
    let x = if light > 0.0 { light.min(1e6) } else { 0.0 };
    (x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14)).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grey(values: &[f32]) -> Radiance {
        Radiance {
            width: values.len() as u32,
            height: 1,
            rgb: values.iter().map(|value| [*value; 3]).collect(),
        }
    }

    #[test]
    fn the_curve_rises_from_black_to_white() {
        let values: Vec<f32> = (-20..=10).map(|step| (step as f32).exp2()).collect();
        let shown = display(&grey(&values), (1.0_f32 / 1.2).log2());
        assert!(shown.rgb.is_sorted() && shown.rgb[0] == [0; 3] && shown.rgb[30] == [255; 3]);
        let odd = display(&grey(&[f32::NAN, -1.0, 0.0, f32::INFINITY, f32::MAX]), 0.0);
        assert_eq!(odd.rgb, [[0; 3], [0; 3], [0; 3], [255; 3], [255; 3]]);
    }

    #[test]
    fn the_median_becomes_middle_grey() {
        let radiance = grey(&[0.0, 0.0, 0.0, 10.0, 700.0, 90_000.0]);
        let exposed = 700.0 * exposure(middle_grey_ev100(&radiance));
        assert!((exposed - 0.18).abs() < 1e-6, "{exposed}");
        assert_eq!(middle_grey_ev100(&grey(&[0.0, f32::NAN])), 0.0);
    }
}
