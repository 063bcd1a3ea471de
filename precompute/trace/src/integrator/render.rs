//! A camera's image.

use glam::{DVec3, UVec2, Vec3};
use rayon::prelude::*;

use super::learn::{KINDS, learn};
use super::path::{Record, trace};
use super::{Guide, ReferenceScene, Settings, View};
use crate::metrics::Radiance;
use crate::sampler::Sampler;

/// Callbacks for progress and interruption; both are called from many threads.
#[derive(Clone, Copy)]
pub struct Watch<'a> {
    /// Called after each row of paths, and after each pass of photons or beams.
    pub row_done: &'a (dyn Fn() + Sync),
    /// Called before each pixel; `true` interrupts.
    pub interrupted: &'a (dyn Fn() -> bool + Sync),
}

impl Default for Watch<'_> {
    /// Ignores progress and never interrupts.
    fn default() -> Self {
        Self { row_done: &|| (), interrupted: &|| false }
    }
}

/// A path-traced image. Its components are estimated separately, so that none has the noise of a
/// difference.
#[derive(Clone, Debug, PartialEq)]
pub struct Rendering {
    /// Light that at most one surface scattered, including visible emissive surfaces and
    /// environment.
    pub direct: Radiance,
    /// The share of `direct` that emissive surfaces and the environment send by way of one surface.
    pub extended: Radiance,
    /// Light that two or more surfaces scattered.
    pub indirect: Radiance,
    /// Paths whose estimate was infinite or NaN; they are left out of the means.
    pub dropped: u64,
}

impl Rendering {
    /// All light.
    #[must_use]
    pub fn full(&self) -> Radiance {
        sum(&self.direct, &self.indirect)
    }

    /// The light that global illumination adds: indirect light, and light of emissive surfaces and
    /// environment on other surfaces, without their own visible emission.
    #[must_use]
    pub fn global(&self) -> Radiance {
        sum(&self.extended, &self.indirect)
    }
}

/// The sum of two images of one size.
pub(crate) fn sum(a: &Radiance, b: &Radiance) -> Radiance {
    let rgb =
        a.rgb.iter().zip(&b.rgb).map(|(a, b)| [a[0] + b[0], a[1] + b[1], a[2] + b[2]]).collect();
    Radiance { rgb, ..*a }
}

/// Path-traces `view` of `scene` on all threads of rayon's pool; `None` if `watch` gave up. The
/// result depends on the arguments alone, not on the number of threads.
///
/// The pixel filter is a box, unless [`Settings::pixels`] says otherwise.
pub fn render(
    scene: &ReferenceScene,
    view: &View,
    settings: &Settings,
    watch: Watch,
) -> Option<Rendering> {
    render_recorded(scene, view, settings, watch, &|| ()).map(|(rendering, _)| rendering)
}

/// The same image, and what a record of each pixel's paths became, row by row.
pub(crate) fn render_recorded<R: Record + Send>(
    scene: &ReferenceScene,
    view: &View,
    settings: &Settings,
    watch: Watch,
    record: &(dyn Fn() -> R + Sync),
) -> Option<(Rendering, Vec<R>)> {
    let field = match settings.guide {
        Guide::None => None,
        Guide::Photons => learn(scene, view, settings, &KINDS, watch.interrupted)?,
    };
    let eye = view.pose.position.as_dvec3();
    let ([direct, extended, indirect], dropped, records) =
        pixels(view, settings, watch, record, |(origin, direction), sampler, record| {
            record.begin(origin.as_dvec3().distance(eye));
            let field = field.as_ref();
            let estimate = trace(scene, settings, field, origin, direction, sampler, record);
            let fits = estimate.fits_f32();
            record.end(fits);
            fits.then_some([estimate.direct, estimate.extended, estimate.indirect])
        })?;
    Some((Rendering { direct, extended, indirect, dropped }, records))
}

/// Images of the means over each pixel's samples, how many samples were dropped, and a record of
/// each pixel, row by row. `sample` traces a ray and returns its light in parts; none is dropped.
pub(crate) fn pixels<const N: usize, R: Send>(
    view: &View,
    settings: &Settings,
    watch: Watch,
    record: &(dyn Fn() -> R + Sync),
    sample: impl Fn((Vec3, DVec3), &mut Sampler, &mut R) -> Option<[DVec3; N]> + Sync,
) -> Option<([Radiance; N], u64, Vec<R>)> {
    let UVec2 { x: width, y: height } = view.size;
    let pixel = |at: [u32; 2]| {
        let (mut sums, mut count, mut record) = ([DVec3::ZERO; N], 0_u32, record());
        let number = u64::from(at[1]) * u64::from(width) + u64::from(at[0]);
        for index in 0..settings.samples {
            let mut sampler = Sampler::new(settings.seed, number, index);
            let ray = view.sampled_ray(settings.pixels, at, &mut sampler);
            if let Some(parts) = sample(ray, &mut sampler, &mut record) {
                sums.iter_mut().zip(parts).for_each(|(sum, part)| *sum += part);
                count += 1;
            }
        }
        let means = sums.map(|sum| (sum / f64::from(count.max(1))).as_vec3().to_array());
        (means, u64::from(settings.samples - count), record)
    };
    let rows: Vec<Vec<_>> = (0..height)
        .into_par_iter()
        .map(|y| {
            let row = (0..width).map(|x| (!(watch.interrupted)()).then(|| pixel([x, y])));
            let row = row.collect::<Option<Vec<_>>>();
            (watch.row_done)();
            row
        })
        .collect::<Option<_>>()?;
    let mut images = std::array::from_fn(|_| Radiance { width, height, rgb: Vec::new() });
    let (mut dropped, mut records) = (0, Vec::new());
    for (means, lost, record) in rows.into_iter().flatten() {
        images.iter_mut().zip(means).for_each(|(image, mean)| image.rgb.push(mean));
        dropped += lost;
        records.push(record);
    }
    Some((images, dropped, records))
}
