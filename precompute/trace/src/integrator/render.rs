//! A camera's image.

use glam::{DVec3, UVec2};
use rayon::prelude::*;

use super::learn::learn;
use super::path::{Record, trace};
use super::scene::ReferenceScene;
use super::settings::{Guide, Settings};
use super::view::View;
use crate::guide::Field;
use crate::metrics::Radiance;
use crate::sampler::Sampler;

/// Callbacks for progress and interruption; both are called from many threads.
#[derive(Clone, Copy)]
pub struct Watch<'a> {
    /// Called after each row.
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

/// Direct, extended and indirect light of one pixel, and how many of its samples were dropped.
type Pixel = ([[f32; 3]; 3], u64);

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
    let UVec2 { x: width, y: height } = view.size;
    let field = match settings.guide {
        Guide::None => None,
        Guide::Photons => learn(scene, view, settings, watch.interrupted)?,
    };
    let rows: Vec<Vec<(Pixel, R)>> = (0..height)
        .into_par_iter()
        .map(|y| {
            let row = (0..width)
                .map(|x| {
                    (!(watch.interrupted)()).then(|| {
                        let mut record = record();
                        let own = pixel(scene, view, settings, field.as_ref(), x, y, &mut record);
                        (own, record)
                    })
                })
                .collect::<Option<Vec<_>>>();
            (watch.row_done)();
            row
        })
        .collect::<Option<_>>()?;
    let pixels = rows.into_iter().flatten();
    let empty = || Radiance { width, height, rgb: Vec::with_capacity((width * height) as usize) };
    let mut rendering =
        Rendering { direct: empty(), extended: empty(), indirect: empty(), dropped: 0 };
    let mut records = Vec::with_capacity((width * height) as usize);
    for (([direct, extended, indirect], dropped), record) in pixels {
        records.push(record);
        rendering.direct.rgb.push(direct);
        rendering.extended.rgb.push(extended);
        rendering.indirect.rgb.push(indirect);
        rendering.dropped += dropped;
    }
    Some((rendering, records))
}

fn pixel(
    scene: &ReferenceScene,
    view: &View,
    settings: &Settings,
    field: Option<&Field>,
    x: u32,
    y: u32,
    record: &mut impl Record,
) -> Pixel {
    let (mut parts, mut dropped) = ([DVec3::ZERO; 3], 0);
    let number = u64::from(y) * u64::from(view.size.x) + u64::from(x);
    for sample in 0..settings.samples {
        let mut sampler = Sampler::new(settings.seed, number, sample);
        let (origin, direction) = view.sampled_ray(settings.pixels, [x, y], &mut sampler);
        record.begin(origin.as_dvec3().distance(view.pose.position.as_dvec3()));
        let estimate = trace(scene, settings, field, origin, direction, &mut sampler, record);
        let fits = estimate.fits_f32();
        record.end(fits);
        if fits {
            let own = [estimate.direct, estimate.extended, estimate.indirect];
            parts.iter_mut().zip(own).for_each(|(sum, own)| *sum += own);
        } else {
            dropped += 1;
        }
    }
    let count = f64::from(settings.samples - dropped.min(settings.samples)).max(1.0);
    (parts.map(|sum| (sum / count).as_vec3().to_array()), u64::from(dropped))
}
