//! Difference between the radiance of two images.

use super::ssim::{self, SsimError};
use super::{Radiance, tone};

/// Side of the squares that [`Difference::relative_l1_boxes`] averages over, pixels.
pub(super) const BOX_SIDE: u32 = 4;

/// An image's radiance against a reference's, over all pixels and the three channels.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Difference {
    /// Mean ÷ the reference's mean.
    pub mean_ratio: f64,
    /// Mean absolute difference ÷ the reference's mean.
    pub relative_l1: f64,
    /// The same for means over squares of 4 × 4 pixels, which reduces the weight of noise and
    /// edges.
    pub relative_l1_boxes: f64,
    /// 1 − SSIM of both after one tone curve, see `metrics/tone.rs`.
    pub one_minus_ssim: f64,
    /// Exposure value of that curve.
    pub exposure_ev100: f32,
}

/// Why two images' radiance cannot be compared.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum DifferenceError {
    /// The sizes differ.
    #[error(transparent)]
    Compare(#[from] SsimError),
    /// Values are infinite or NaN.
    #[error("the {which} has {count} values that are not finite")]
    NotFinite {
        /// `reference` or `image`.
        which: &'static str,
        /// The number of such values.
        count: usize,
    },
    /// The reference is black.
    #[error("the reference is black: a relative difference is undefined")]
    Black,
}

impl Difference {
    /// `picture` against `reference`; without an exposure value, the one at which the reference's
    /// median luminance is middle grey.
    ///
    /// # Errors
    /// When their sizes differ, one is empty or holds values that are not finite, or the
    /// reference's mean is not above 0.
    pub fn new(
        picture: &Radiance,
        reference: &Radiance,
        exposure_ev100: Option<f32>,
    ) -> Result<Self, DifferenceError> {
        for (which, radiance) in [("reference", reference), ("image", picture)] {
            let count = radiance.rgb.iter().flatten().filter(|value| !value.is_finite()).count();
            if count > 0 {
                return Err(DifferenceError::NotFinite { which, count });
            }
        }
        // First, because it checks the sizes.
        let exposure_ev100 = exposure_ev100.unwrap_or_else(|| tone::middle_grey_ev100(reference));
        let one_minus_ssim = ssim::error(
            &tone::display(reference, exposure_ev100),
            &tone::display(picture, exposure_ev100),
        )?;
        let mean = reference.mean();
        if mean <= 0.0 {
            return Err(DifferenceError::Black);
        }
        Ok(Self {
            mean_ratio: picture.mean() / mean,
            relative_l1: mean_absolute_difference(picture, reference) / mean,
            relative_l1_boxes: mean_absolute_difference(
                &picture.boxes(BOX_SIDE),
                &reference.boxes(BOX_SIDE),
            ) / mean,
            one_minus_ssim,
            exposure_ev100,
        })
    }
}

fn mean_absolute_difference(a: &Radiance, b: &Radiance) -> f64 {
    let differences = a
        .rgb
        .iter()
        .flatten()
        .zip(b.rgb.iter().flatten())
        .map(|(a, b)| (f64::from(*a) - f64::from(*b)).abs());
    differences.sum::<f64>() / (3 * a.rgb.len()).max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn radiance(width: u32, height: u32, value: impl Fn(u32, u32) -> f32) -> Radiance {
        Radiance {
            width,
            height,
            rgb: (0..width * height).map(|i| [value(i % width, i / width); 3]).collect(),
        }
    }

    #[test]
    fn equal_images_do_not_differ() {
        let picture = radiance(16, 12, |x, y| 100.0 + (x * y) as f32);
        let difference = Difference::new(&picture, &picture, None).unwrap();
        assert_eq!(
            (difference.mean_ratio, difference.relative_l1, difference.relative_l1_boxes),
            (1.0, 0.0, 0.0)
        );
        assert_eq!(difference.one_minus_ssim, 0.0);
    }

    #[test]
    fn a_scale_shows_in_every_figure_and_boxes_average_out_noise() {
        let reference = radiance(16, 12, |_, _| 100.0);
        let brighter =
            Difference::new(&radiance(16, 12, |_, _| 110.0), &reference, Some(7.0)).unwrap();
        for figure in [brighter.mean_ratio - 1.0, brighter.relative_l1, brighter.relative_l1_boxes]
        {
            assert!((figure - 0.1).abs() < 1e-9, "{brighter:?}");
        }
        assert!(brighter.one_minus_ssim > 0.0 && brighter.exposure_ev100 == 7.0);
        let noisy = radiance(16, 12, |x, y| if (x + y) % 2 == 0 { 130.0 } else { 70.0 });
        let noisy = Difference::new(&noisy, &reference, None).unwrap();
        assert!(
            (noisy.mean_ratio - 1.0).abs() < 1e-12
                && (noisy.relative_l1 - 0.3).abs() < 1e-9
                && noisy.relative_l1_boxes < 1e-9
        );
        assert!(noisy.one_minus_ssim > brighter.one_minus_ssim);
    }

    #[test]
    fn incomparable_images_are_named() {
        let (small, large) = (radiance(4, 4, |_, _| 1.0), radiance(8, 4, |_, _| 1.0));
        let error = Difference::new(&small, &large, None).unwrap_err();
        assert_eq!(
            error,
            DifferenceError::Compare(SsimError::Size { reference: (8, 4), picture: (4, 4) })
        );
        assert_eq!(
            Difference::new(&small, &radiance(4, 4, |_, _| 0.0), None),
            Err(DifferenceError::Black)
        );
        let broken = radiance(4, 4, |x, _| if x == 0 { f32::NAN } else { 1.0 });
        assert_eq!(
            Difference::new(&broken, &small, None),
            Err(DifferenceError::NotFinite { which: "image", count: 12 })
        );
        assert_eq!(
            Difference::new(&small, &broken, None),
            Err(DifferenceError::NotFinite { which: "reference", count: 12 })
        );
        let empty = radiance(0, 0, |_, _| 1.0);
        assert_eq!(
            Difference::new(&empty, &empty, None),
            Err(DifferenceError::Compare(SsimError::Empty))
        );
    }
}
