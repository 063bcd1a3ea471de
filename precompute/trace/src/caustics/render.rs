//! Both images.

use glam::DVec3;
use rayon::prelude::*;

use super::emit::photons;
use super::gather::points;
use super::path::trace;
use super::radius::Progress;
use super::split::{Caustics, Density};
use crate::integrator::{ReferenceScene, Settings, View, Watch, sum};
use crate::metrics::Radiance;
use crate::sampler::Sampler;

/// Farthest photons that count, in radii of the scene: no search goes through a whole map.
const REACH: f64 = 0.1;
/// Most camera rays of a pixel into one map: photons are noisier than edges.
const MOST_RAYS: u32 = 16;

/// An image in two parts, whose sum is all light.
#[derive(Clone, Debug, PartialEq)]
pub struct CausticRendering {
    /// All light but caustics, path-traced, nits.
    pub paths: Radiance,
    /// Light–specular paths, from photons, nits.
    pub photons: Radiance,
    /// Paths whose estimate was infinite or NaN; they are left out of the means.
    pub dropped: u64,
}

impl CausticRendering {
    /// All light, nits.
    #[must_use]
    pub fn full(&self) -> Radiance {
        sum(&self.paths, &self.photons)
    }
}

/// Renders `view` of `scene` on all threads of rayon's pool: `settings.samples` paths a pixel
/// without caustics, and caustics from photons. `None` if `watch` gave up. `settings.guide` is not
/// used.
pub fn render(
    scene: &ReferenceScene,
    view: &View,
    settings: &Settings,
    caustics: &Caustics,
    watch: Watch,
) -> Option<CausticRendering> {
    let photons = photon_image(scene, view, settings, caustics, watch)?;
    let pixels: Vec<([f32; 3], u64)> = (0..view.size.element_product())
        .into_par_iter()
        .map(|pixel| {
            let (mut sum, mut count) = (DVec3::ZERO, 0_u32);
            for sample in 0..settings.samples {
                let mut sampler = Sampler::new(settings.seed, u64::from(pixel), sample);
                let at = [pixel % view.size.x, pixel / view.size.x];
                let ray = view.sampled_ray(settings.pixels, at, &mut sampler);
                let light = trace(scene, settings, caustics, ray, &mut sampler);
                if light.as_vec3().is_finite() {
                    sum += light;
                    count += 1;
                }
            }
            let done = pixel % view.size.x + 1 == view.size.x;
            if done {
                (watch.row_done)();
            }
            let mean = (sum / f64::from(count.max(1))).as_vec3().to_array();
            (!(watch.interrupted)()).then_some((mean, u64::from(settings.samples - count)))
        })
        .collect::<Option<_>>()?;
    let dropped = pixels.iter().map(|(_, dropped)| dropped).sum();
    Some(CausticRendering {
        paths: image(view, pixels.into_iter().map(|(rgb, _)| rgb)),
        photons,
        dropped,
    })
}

/// The photons' part of [`render`] alone.
pub fn photon_image(
    scene: &ReferenceScene,
    view: &View,
    settings: &Settings,
    caustics: &Caustics,
    watch: Watch,
) -> Option<Radiance> {
    let (passes, rays) = match caustics.density {
        Density::Nearest { .. } => (1, settings.samples.clamp(1, MOST_RAYS)),
        Density::Progressive { passes, .. }
        | Density::Counted { passes, .. }
        | Density::Adaptive { passes, .. } => (passes.clamp(1, caustics.photons.max(1)), 1),
    };
    let bounds = scene.geometry.bounds();
    let radius = bounds.map_or(0.0, |bounds| 0.5 * f64::from((bounds.max - bounds.min).length()));
    let reach = radius * REACH;
    let mut pixels = vec![Progress::default(); view.size.element_product() as usize];
    for pass in 0..passes {
        // Shares of photons that differ by one at most.
        let share =
            |pass: u32| (u64::from(caustics.photons) * u64::from(pass) / u64::from(passes)) as u32;
        let count = share(pass + 1) - share(pass);
        let map = photons(scene, settings, caustics, pass, count, watch.interrupted)?;
        if map.is_empty() && passes == 1 {
            continue;
        }
        pixels.par_iter_mut().enumerate().for_each(|(pixel, progress)| {
            for sample in 0..rays {
                let number = pixel as u64;
                let mut sampler = Sampler::new(!settings.seed, number, pass * rays + sample);
                let at = [pixel as u32 % view.size.x, pixel as u32 / view.size.x];
                let ray = view.sampled_ray(settings.pixels, at, &mut sampler);
                let mut seen = Vec::new();
                points(scene, settings, caustics, ray, &mut sampler, |point| seen.push(point));
                progress.add(caustics, &map, f64::from(count), &seen, reach);
            }
        });
    }
    let finite = |light: DVec3| if light.as_vec3().is_finite() { light } else { DVec3::ZERO };
    Some(image(view, pixels.iter().map(|pixel| finite(pixel.mean()).as_vec3().to_array())))
}

fn image(view: &View, rgb: impl Iterator<Item = [f32; 3]>) -> Radiance {
    Radiance { width: view.size.x, height: view.size.y, rgb: rgb.collect() }
}
