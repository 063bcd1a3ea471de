//! Diffuse surfaces that the camera sees, directly or by mirrors, and light that photons bring them.

use std::f64::consts::PI;

use glam::{DVec3, Vec3};

use super::map::{Photon, PhotonMap};
use super::split::Caustics;
use crate::bsdf::{Bsdf, Surface};
use crate::color::luminance;
use crate::integrator::{GREATEST_SURVIVAL, ReferenceScene, Settings};
use crate::sampler::Sampler;

/// Greatest ratio of a photon's cosines to shading and to geometric normal.
const GREATEST_RATIO: f64 = 4.0;

/// A point where photons are gathered.
pub(super) struct Point<'a> {
    surface: Surface<'a>,
    bsdf: Bsdf,
    /// What of its light reaches the camera.
    throughput: DVec3,
    /// Most surfaces that may have reflected a photon.
    most: u32,
}

/// The light of photons near a point.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Gathered {
    /// Radiance along the camera ray × number of photons that left lights, nits.
    pub(super) radiance: DVec3,
    /// Number of photons.
    pub(super) count: u32,
    /// Radius, metres.
    pub(super) radius: f64,
    /// Mean of squared luminance of contributions, per area: Σγ² / (π r²).
    pub(super) squares: f64,
}

/// Calls `found` for every diffuse surface along a camera ray that specular parts reflect.
pub(super) fn points<'a>(
    scene: &'a ReferenceScene,
    settings: &Settings,
    caustics: &Caustics,
    (mut origin, mut direction): (Vec3, DVec3),
    sampler: &mut Sampler,
    mut found: impl FnMut(Point<'a>),
) {
    let mut throughput = DVec3::ONE;
    for surfaces in 0.. {
        if settings.bounces.is_some_and(|bounces| surfaces > bounces) {
            return;
        }
        let Some(hit) = scene.closest(origin, direction) else { return };
        let surface = Surface::new(&scene.geometry, &hit);
        let bsdf = Bsdf::new(&surface, -direction, settings.shading);
        let next = caustics.is_specular(&surface).then(|| {
            let next = bsdf.sample(sampler)?.direction;
            let lobes = caustics.lobes(&bsdf, &surface, next)?;
            let weight = lobes.specular * (lobes.cosine / lobes.density);
            let survival = luminance(weight).min(GREATEST_SURVIVAL);
            (sampler.number() < survival).then(|| (weight / survival, next))
        });
        let start = surface.ray_origin();
        if !caustics.is_mirror(&bsdf, &surface) {
            let most = settings.bounces.map_or(u32::MAX, |bounces| bounces - surfaces);
            found(Point { surface, bsdf, throughput, most });
        }
        let Some((weight, next)) = next.flatten() else { return };
        throughput *= weight;
        (origin, direction) = (start, next);
    }
}

impl Point<'_> {
    /// Gathers the nearest `count` photons within `reach`, metres. The farthest one gives the radius
    /// and is not counted: with it, the mean would be `count` ÷ (`count` − 1) too high.
    pub(super) fn nearest(
        &self,
        caustics: &Caustics,
        map: &PhotonMap,
        count: u32,
        reach: f64,
    ) -> Gathered {
        let count = count.max(2) as usize;
        let mut near = map.nearest(self.place(), self.normal(), count, reach as f32);
        let mut gathered = Gathered { radius: reach, ..Gathered::default() };
        if near.len() == count {
            gathered.radius = near.pop().map_or(reach, |(squared, _)| f64::from(squared).sqrt());
        }
        near.iter().for_each(|(_, photon)| gathered.add(self.light(caustics, photon)));
        gathered.per_area()
    }

    /// Gathers all photons within `radius`, metres, and calls `each` with the squared distance of
    /// each in radii and its luminance.
    pub(super) fn within(
        &self,
        caustics: &Caustics,
        map: &PhotonMap,
        radius: f64,
        mut each: impl FnMut(f64, f64),
    ) -> Gathered {
        let mut gathered = Gathered { radius, ..Gathered::default() };
        map.within(self.place(), self.normal(), radius as f32, |squared, photon| {
            let light = self.light(caustics, photon);
            gathered.add(light);
            each(f64::from(squared) / (radius * radius), luminance(light));
        });
        gathered.per_area()
    }

    fn place(&self) -> Vec3 {
        self.surface.position.as_vec3()
    }

    fn normal(&self) -> Vec3 {
        self.surface.geometric_normal.as_vec3()
    }

    /// What a photon adds, nits · m².
    fn light(&self, caustics: &Caustics, photon: &Photon) -> DVec3 {
        if photon.surfaces > self.most {
            return DVec3::ZERO;
        }
        let direction = photon.direction.as_dvec3();
        let Some(lobes) = caustics.lobes(&self.bsdf, &self.surface, direction) else {
            return DVec3::ZERO;
        };
        // Photons already are fewer by the geometric normal's cosine.
        let ratio = lobes.cosine / direction.dot(self.surface.geometric_normal);
        let reflected = self.throughput * lobes.diffuse * ratio.min(GREATEST_RATIO);
        reflected * photon.power.as_dvec3()
    }
}

impl Gathered {
    fn add(&mut self, light: DVec3) {
        self.radiance += light;
        self.squares += luminance(light).powi(2);
        self.count += 1;
    }

    fn per_area(mut self) -> Self {
        let area = PI * self.radius * self.radius;
        let scale = if area > 0.0 && area.is_finite() { area.recip() } else { 0.0 };
        // Photons at one point have no density.
        let scale = if scale.is_finite() { scale } else { 0.0 };
        self.radiance *= scale;
        self.squares *= scale;
        self
    }
}
