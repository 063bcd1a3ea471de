//! What a view shows, in twenty numbers, which predict errors at views that no camera has rendered.
//!
//! How much quality a setting costs depends on what is in view: how bright it is, how much of its
//! light is indirect, how many edges and shadows there are. A path-traced thumbnail tells all that.
//! It is much cheaper than a rendering of a clip, and explains errors better than the distance to
//! rendered cameras.

use frugal_trace::integrator::{FirstHit, ReferenceScene, Settings, View, Watch, render, surfaces};
use glam::{DVec3, UVec2};

use crate::cameras::MovingCamera;

/// Size of the thumbnail, pixels.
const SIZE: UVec2 = UVec2::new(32, 18);
/// Paths per pixel. At 64 predictions are no better.
const SAMPLES: u32 = 12;
/// Indirect bounces: more change little of what a view shows.
const BOUNCES: u32 = 2;
/// Distance that stands for the sky's, metres.
const SKY_DISTANCE: f64 = 100.0;

/// The features of one view.
pub type ViewFeatures = Vec<f64>;

/// Describes the views of a scene.
pub struct ViewDescriber {
    /// The scene.
    pub scene: ReferenceScene,
    /// Vertical field of view, degrees.
    pub vertical_fov_degrees: f32,
    /// Distance of the near plane, metres.
    pub near: f32,
    /// Exposure value at ISO 100.
    pub exposure_ev100: f32,
}

impl ViewDescriber {
    /// The features of a camera's view. Deterministic.
    pub fn describe(&self, camera: &MovingCamera) -> ViewFeatures {
        let Self { vertical_fov_degrees, near, .. } = *self;
        let view = View { pose: camera.pose, vertical_fov_degrees, near, size: SIZE };
        let settings = Settings { samples: SAMPLES, bounces: Some(BOUNCES), ..Settings::default() };
        let Some(rendering) = render(&self.scene, &view, &settings, Watch::default()) else {
            return Vec::new();
        };
        let surfaces = surfaces(&self.scene, &view);
        let exposure = 2.0 / (1.2 * f64::from(self.exposure_ev100).exp2());
        let (full, global) = (rendering.full(), rendering.global());
        let pixels: Vec<Pixel> = full
            .luminance()
            .zip(global.luminance())
            .zip(surfaces)
            .map(|((full, global), seen)| {
                Pixel::new(full, global, seen, &camera.pose.position, exposure)
            })
            .collect();
        let mut features = of_image(&pixels);
        features.push(f64::from(camera.velocity.length()).ln_1p());
        features.push(f64::from(camera.turn.length()).ln_1p());
        features
    }
}

/// One pixel of the thumbnail. Light is as displayed, 0 to 1.
#[derive(Clone, Copy, Debug)]
struct Pixel {
    all: f64,
    /// Without the light that global illumination adds.
    direct: f64,
    /// Whether less than a twentieth of the light is direct.
    is_shaded: bool,
    is_sky: bool,
    /// Logarithm of the distance in metres.
    distance: f64,
    normal: DVec3,
}

impl Pixel {
    fn new(
        full: f32,
        global: f32,
        seen: Option<FirstHit>,
        from: &glam::Vec3,
        exposure: f64,
    ) -> Self {
        let direct = (full - global).max(0.0);
        let display = |luminance: f32| {
            let exposed = f64::from(luminance) * exposure;
            (exposed / (1.0 + exposed)).powf(1.0 / 2.2)
        };
        let distance = seen.map_or(SKY_DISTANCE, |seen| seen.position.distance(from.as_dvec3()));
        Self {
            all: display(full),
            direct: display(direct),
            is_shaded: direct < 0.05 * full,
            is_sky: seen.is_none(),
            distance: distance.max(0.05).ln(),
            normal: seen.map_or(DVec3::ZERO, |seen| seen.normal),
        }
    }

    /// The light that global illumination adds.
    fn indirect(&self) -> f64 {
        self.all - self.direct
    }
}

fn of_image(pixels: &[Pixel]) -> ViewFeatures {
    let count = pixels.len().max(1) as f64;
    let mean = |value: &dyn Fn(&Pixel) -> f64| pixels.iter().map(value).sum::<f64>() / count;
    let deviation = |value: &dyn Fn(&Pixel) -> f64| {
        let mean = mean(value);
        (pixels.iter().map(|pixel| (value(pixel) - mean).powi(2)).sum::<f64>() / count).sqrt()
    };
    let share = |is: &dyn Fn(&Pixel) -> bool| mean(&|pixel| f64::from(u8::from(is(pixel))));
    let difference =
        |value: fn(&Pixel) -> f64| of_neighbours(pixels, |a, b| (value(a) - value(b)).abs());
    let contrast = of_neighbours(pixels, |a, b| (a.all - b.all).abs() / (b.all + 0.05));
    vec![
        mean(&|pixel| pixel.all),
        deviation(&|pixel| pixel.all),
        mean(&Pixel::indirect),
        deviation(&Pixel::indirect),
        share(&|pixel| pixel.is_sky),
        mean(&|pixel| pixel.distance),
        deviation(&|pixel| pixel.distance),
        of_neighbours(pixels, |a, b| f64::from(u8::from((a.distance - b.distance).abs() > 0.15))),
        of_neighbours(pixels, |a, b| f64::from(u8::from(a.normal.dot(b.normal) < 0.8))),
        difference(|pixel| pixel.all),
        difference(|pixel| pixel.indirect()),
        difference(|pixel| pixel.direct),
        share(&|pixel| pixel.is_shaded),
        share(&|pixel| pixel.all < 0.25),
        share(&|pixel| pixel.all > 0.9),
        share(&|pixel| pixel.normal.y.abs() > 0.7),
        // How much is within arm's length.
        mean(&|pixel| if pixel.is_sky { 0.0 } else { (-pixel.distance.exp()).exp() }),
        (contrast + 1e-3).ln(),
    ]
}

/// Mean of `value` over pairs of horizontal neighbours, plus that over vertical ones.
fn of_neighbours(pixels: &[Pixel], value: impl Fn(&Pixel, &Pixel) -> f64) -> f64 {
    let width = SIZE.x as usize;
    let mean = |pairs: &mut dyn Iterator<Item = (&Pixel, &Pixel)>| {
        let (mut sum, mut count) = (0.0, 0.0);
        for (a, b) in pairs {
            sum += value(b, a);
            count += 1.0;
        }
        sum / f64::max(count, 1.0)
    };
    let rows = || pixels.chunks(width);
    mean(&mut rows().flat_map(|row| row.iter().zip(row.iter().skip(1))))
        + mean(&mut pixels.iter().zip(pixels.iter().skip(width)))
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    #[test]
    fn a_view_without_pixels_has_finite_features() {
        assert!(of_image(&[]).iter().all(|feature| feature.is_finite()));
        let black = Pixel::new(0.0, 0.0, None, &Vec3::ZERO, 1.0);
        assert!(of_image(&[black; 576]).iter().all(|feature| feature.is_finite()));
        let odd = Pixel::new(f32::MAX, f32::MAX, None, &Vec3::ZERO, 1e300);
        assert!((0.0..=1.0).contains(&odd.all) || odd.all.is_nan());
    }
}
