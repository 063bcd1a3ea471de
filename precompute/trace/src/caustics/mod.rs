//! Caustics: light that mirrors and polished surfaces throw, from photons.
//!
//! Transport is split by the lobes that reflect a path's light. A path is *light–specular* when a
//! specular lobe reflects it first, seen from the light, and a diffuse one later, then none but
//! specular ones. Those paths are estimated by the density of photons (Jensen 1996, "Global
//! Illumination using Photon Maps"), all others by paths from the camera: each path is counted once,
//! and the sum of the two images is all light. Paths from the camera find light–specular ones
//! rarely, which makes bright dots.
//!
//! Photons cross surfaces from the other end than camera rays. Where a single-sided sheet is seen
//! from behind, the two images cull different faces, and the sum is not exact. For solids it is.
//!
//! | module | job |
//! |---|---|
//! | `map` | photons in a tree: the nearest ones, those within a distance |
//! | `paths` | light–specular photons from the lights; all other light along paths from the camera |
//! | `gather` | diffuse surfaces that the camera sees, and the light that photons bring them |

mod gather;
mod map;
mod paths;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use crate::bsdf::{Bsdf, Lobes, Surface};
use crate::color::luminance;
#[cfg(feature = "time")]
use crate::integrator::path::Record;
use crate::integrator::render::{pixels, sum};
use crate::integrator::{ReferenceScene, Settings, View, Watch};
use crate::metrics::Radiance;
use crate::sampler::Sampler;
use crate::scene::Hit;
use gather::{Point, Progress};

/// Farthest photons that count, in radii of the scene: no search goes through a whole map.
const REACH: f64 = 0.1;
/// Most camera rays of a pixel into one map: photons are noisier than edges.
const MOST_RAYS: u32 = 16;

/// How caustics are estimated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Caustics {
    /// Photons that leave lights, over all passes. With 0 the photons' image is black.
    pub photons: u32,
    /// Greatest perceptual roughness, in [0, 1], of lobes that count as specular; where it is
    /// negative or NaN, none does, and all light is path-traced.
    pub roughness: f32,
    /// How density is estimated.
    pub density: Density,
}

/// How the density of photons is estimated, with a kernel that is constant within a radius.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Density {
    /// As far as the nearest photons reach.
    Nearest {
        /// Their number, at least 2. More are smoother, and blur more.
        count: u32,
    },
    /// The mean of passes whose radius balances noise and blur, from estimates of both (Kaplanyan
    /// and Dachsbacher 2013, "Adaptive Progressive Photon Mapping", section 4). Converges.
    Adaptive {
        /// Number of passes, at least 1, which share the photons.
        passes: u32,
        /// Photons of the first pass that the first radius reaches to, at least 2.
        first: u32,
    },
}

impl Default for Caustics {
    fn default() -> Self {
        Self { photons: 1 << 20, roughness: 0.25, density: Density::Nearest { count: 50 } }
    }
}

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
    let split = Split { scene, settings, caustics };
    let ([paths], dropped, _) = pixels(view, settings, watch, &|| (), |ray, sampler, ()| {
        let light = split.path(ray, sampler);
        light.as_vec3().is_finite().then_some([light])
    })?;
    Some(CausticRendering { paths, photons, dropped })
}

/// The photons' part of [`render`] alone.
pub fn photon_image(
    scene: &ReferenceScene,
    view: &View,
    settings: &Settings,
    caustics: &Caustics,
    watch: Watch,
) -> Option<Radiance> {
    let split = Split { scene, settings, caustics };
    let (passes, rays) = match caustics.density {
        Density::Nearest { .. } => (1, settings.samples.clamp(1, MOST_RAYS)),
        Density::Adaptive { passes, .. } => (passes.clamp(1, caustics.photons.max(1)), 1),
    };
    let bounds = scene.geometry.bounds();
    let reach = REACH * bounds.map_or(0.0, |bounds| 0.5 * f64::from(bounds.size().length()));
    let mut pixels = vec![Progress::default(); view.size.element_product() as usize];
    for pass in 0..passes {
        // Shares of photons that differ by one at most.
        let share =
            |pass: u32| (u64::from(caustics.photons) * u64::from(pass) / u64::from(passes)) as u32;
        let count = share(pass + 1) - share(pass);
        let map = split.photons([pass, count], watch.interrupted)?;
        if !map.photons.is_empty() || passes > 1 {
            split.gather(view, [pass, rays], &mut pixels, |progress, _, points| {
                progress.add(caustics.density, &map, f64::from(count), points, reach);
            });
        }
        (watch.row_done)();
    }
    let finite = |light: DVec3| if light.as_vec3().is_finite() { light } else { DVec3::ZERO };
    let rgb = pixels.iter().map(|pixel| finite(pixel.mean()).as_vec3().to_array()).collect();
    Some(Radiance { width: view.size.x, height: view.size.y, rgb })
}

/// The photons' part in `settings.samples` passes of `caustics.photons` photons each, with a radius for
/// each pass, metres, and a record of each pixel, row by row. It is told of each pass as of a path.
#[cfg(feature = "time")]
pub(crate) fn recorded<R: Record + Send>(
    scene: &ReferenceScene,
    view: &View,
    settings: &Settings,
    caustics: &Caustics,
    radii: impl Iterator<Item = f64>,
    watch: Watch,
    record: impl Fn() -> R,
) -> Option<(Radiance, Vec<R>)> {
    let split = Split { scene, settings, caustics };
    let count = f64::from(caustics.photons.max(1));
    let size = view.size.element_product();
    let mut pixels: Vec<_> = (0..size).map(|_| (DVec3::ZERO, record())).collect();
    for (pass, radius) in (0..settings.samples).zip(radii) {
        let map = split.photons([pass, caustics.photons], watch.interrupted)?;
        split.gather(view, [pass, 1], &mut pixels, |(sum, record), near, points| {
            record.begin(near);
            let of = [radius, count];
            let light: DVec3 = points.iter().map(|point| point.arrivals(&map, of, record)).sum();
            let is_finite = light.as_vec3().is_finite();
            record.end(is_finite);
            *sum += if is_finite { light } else { DVec3::ZERO };
        });
        (watch.row_done)();
    }
    let share = f64::from(settings.samples.max(1)).recip();
    let rgb = pixels.iter().map(|pixel| (pixel.0 * share).as_vec3().to_array()).collect();
    let image = Radiance { width: view.size.x, height: view.size.y, rgb };
    Some((image, pixels.into_iter().map(|pixel| pixel.1).collect()))
}

/// A scene, and how its light is split.
#[derive(Clone, Copy)]
struct Split<'a> {
    scene: &'a ReferenceScene,
    settings: &'a Settings,
    caustics: &'a Caustics,
}

/// What a ray hits, seen along the ray.
struct Reflector<'a> {
    hit: Hit,
    surface: Surface<'a>,
    bsdf: Bsdf,
    /// Whether its specular lobe counts as specular: rougher ones count as diffuse.
    is_specular: bool,
}

/// Light that one part of a BSDF reflects in a sampled direction.
struct Reflected {
    /// Unit length.
    direction: DVec3,
    /// BSDF of that part ÷ the probability of choosing it.
    bsdf: DVec3,
    /// Cosine between direction and shading normal, above 0.
    cosine: f64,
    /// Density of the direction, per steradian.
    density: f64,
    /// Whether it is the specular part.
    is_specular: bool,
}

impl<'a> Split<'a> {
    /// Sends `rays` rays of a pass through each pixel, and calls `each` with what `pixels` has of it,
    /// metres from the eye to where the ray begins, and the points that the ray reaches.
    fn gather<T: Send>(
        &self,
        view: &View,
        [pass, rays]: [u32; 2],
        pixels: &mut [T],
        each: impl Fn(&mut T, f64, &[Point]) + Sync,
    ) {
        let eye = view.pose.position.as_dvec3();
        pixels.par_iter_mut().enumerate().for_each(|(pixel, own)| {
            for sample in 0..rays {
                let number = pixel as u64;
                let mut sampler = Sampler::new(!self.settings.seed, number, pass * rays + sample);
                let at = [pixel as u32 % view.size.x, pixel as u32 / view.size.x];
                let ray = view.sampled_ray(self.settings.pixels, at, &mut sampler);
                let points = self.points(ray, &mut sampler);
                each(own, ray.0.as_dvec3().distance(eye), &points);
            }
        });
    }

    fn closest(&self, origin: Vec3, direction: DVec3) -> Option<Reflector<'a>> {
        let hit = self.scene.closest(origin, direction)?;
        let surface = Surface::new(&self.scene.geometry, &hit);
        let bsdf = Bsdf::new(&surface, -direction, self.settings.shading);
        let is_specular = surface.perceptual_roughness <= f64::from(self.caustics.roughness);
        Some(Reflector { hit, surface, bsdf, is_specular })
    }
}

impl Reflector<'_> {
    /// The lobes for light from `direction`, with specular ones that count as diffuse among the
    /// diffuse; `None` where nothing is reflected.
    fn lobes(&self, direction: DVec3) -> Option<Lobes> {
        let lobes = self.bsdf.lobes(direction)?;
        Some(if self.is_specular {
            lobes
        } else {
            Lobes { diffuse: lobes.diffuse + lobes.specular, specular: DVec3::ZERO, ..lobes }
        })
    }

    /// A direction by the whole BSDF, and only then which part reflects the light, in proportion to
    /// the parts: this costs no variance but that of their colours. `None` where nothing is
    /// reflected.
    fn sample(&self, sampler: &mut Sampler) -> Option<Reflected> {
        let direction = self.bsdf.sample(sampler)?.direction;
        let Lobes { diffuse, specular, cosine, density } = self.lobes(direction)?;
        let sum = luminance(diffuse) + luminance(specular);
        if !(sum > 0.0 && sum.is_finite()) {
            return None;
        }
        let share = luminance(specular) / sum;
        let is_specular = sampler.number() < share;
        let bsdf = if is_specular { specular / share } else { diffuse / (1.0 - share) };
        Some(Reflected { direction, bsdf, cosine, density, is_specular })
    }

    /// Whether it has no diffuse part.
    fn is_mirror(&self) -> bool {
        self.is_specular && self.bsdf.is_only_specular()
    }
}

#[cfg(test)]
mod tests;
