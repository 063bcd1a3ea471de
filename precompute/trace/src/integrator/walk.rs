//! One step of a path, from surface to surface, and the directions in which it goes on: one of the
//! BSDF, and at some points another one of a guide.

use glam::{DVec3, Vec3};

use super::path::{
    Arrival, CERTAIN_OF_LIMITED, CERTAIN_SURFACES, Estimate, GREATEST_SURVIVAL, Record, extended,
    per_steradian, punctual,
};
use super::{ReferenceScene, Settings};
use crate::bsdf::{Bsdf, Surface};
use crate::guide::{Aims, Field};
use crate::sampler::Sampler;

/// Least odds that walks keep; those below end by roulette. So at most eight walks live in place of
/// an unguided one, on average. With roulette down to 1, light that needs two surfaces in a bright
/// place stays noisy: the inside of a lamp's shade has four times the error. 16 costs time.
const LEAST_ODDS: f64 = 1.0 / 8.0;

/// What all walks of a path share.
pub(super) struct Tracer<'a, R> {
    pub(super) scene: &'a ReferenceScene,
    pub(super) settings: &'a Settings,
    pub(super) field: Option<&'a Field>,
    pub(super) sampler: &'a mut Sampler,
    pub(super) record: &'a mut R,
    pub(super) estimate: Estimate,
}

/// A path, or a branch of it, on its way to the next surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct Walk {
    origin: Vec3,
    direction: DVec3,
    throughput: DVec3,
    /// Density of `direction`, per steradian; none for the camera ray.
    density: Option<f64>,
    /// Throughput ÷ what BSDF sampling alone would give the same path, in (0, 1]. Roulette by the
    /// throughput itself would kill guided paths as often as the guide chooses them.
    odds: f64,
    /// Surfaces that it met.
    surfaces: u32,
    /// Metres, as in [`Arrival`].
    length: f64,
    last: f64,
}

impl Walk {
    /// A camera's ray.
    pub(super) fn new(origin: Vec3, direction: DVec3) -> Self {
        Self {
            origin,
            direction,
            throughput: DVec3::ONE,
            density: None,
            odds: 1.0,
            surfaces: 0,
            length: 0.0,
            last: 0.0,
        }
    }

    /// Adds the light of the next surface. Returns how the path goes on, and adds a branch of it.
    pub(super) fn step<R: Record>(
        mut self,
        tracer: &mut Tracer<R>,
        branches: &mut Vec<Self>,
    ) -> Option<Self> {
        let surface = self.emitted(tracer)?;
        let Tracer { scene, settings, sampler, record, estimate, .. } = tracer;
        if settings.bounces.is_some_and(|bounces| self.surfaces > bounces) {
            return None;
        }
        let bsdf = Bsdf::new(&surface, -self.direction, settings.shading);
        self.origin = surface.ray_origin();
        let Self { origin, throughput, odds, length, last, .. } = self;
        let surfaces = self.surfaces + 1;
        let mut arrived = |light: DVec3, distance: f64| {
            let length = length + if distance.is_finite() { distance } else { 0.0 };
            record.arrived(Arrival { light: throughput * light, surfaces, length, last, odds });
        };
        let light = punctual(scene, |to| bsdf.evaluate(to), surface.position, origin, &mut arrived);
        estimate.add(surfaces, throughput * light);
        let scatter = Scatter::new(bsdf, &surface, tracer.field);
        let light =
            extended(scene, settings, |to| scatter.evaluate(to), origin, sampler, &mut arrived);
        estimate.add_extended(surfaces, throughput * light);
        // Beyond the last surface a path can only hit a light.
        if settings.bounces == Some(self.surfaces) && !scene.has_extended_light() {
            return None;
        }
        let walk = self.survives((self.odds / LEAST_ODDS).min(1.0), sampler)?;
        let walk = Self { odds: walk.odds.max(LEAST_ODDS), ..walk };
        let main = scatter.sample(sampler).and_then(|to| walk.scattered(&to, settings, sampler));
        let branch = scatter.branch(sampler).and_then(|to| walk.scattered(&to, settings, sampler));
        branches.extend(branch);
        main
    }

    /// Adds what the next surface or the sky emits. Returns the surface.
    fn emitted<'a, R: Record>(&mut self, tracer: &mut Tracer<'a, R>) -> Option<Surface<'a>> {
        let Tracer { scene, settings, record, estimate, .. } = tracer;
        let scene: &'a ReferenceScene = scene;
        let (surfaces, odds) = (self.surfaces, self.odds);
        let weigh = |other: f64| {
            self.density.map_or(1.0, |own| settings.strategy.weight(false, own, other))
        };
        record.met(odds);
        let Some(hit) = scene.closest(self.origin, self.direction) else {
            let weight = weigh(scene.sky.density(self.direction));
            let light = self.throughput * scene.sky.radiance(self.direction) * weight;
            estimate.add_extended(surfaces, light);
            record.arrived(Arrival { light, surfaces, length: self.length, last: self.last, odds });
            return None;
        };
        let surface = Surface::new(&scene.geometry, &hit);
        let origin = self.origin.as_dvec3();
        let length = self.length + surface.position.distance(origin);
        let last = if surfaces == 0 { length } else { self.last };
        if surface.emission != DVec3::ZERO {
            let per_area = scene.emitters.density(&hit);
            let ray = surface.position - origin;
            let weight = weigh(per_steradian(per_area, ray, surface.geometric_normal));
            let light = self.throughput * surface.emission * weight;
            estimate.add_extended(surfaces, light);
            record.arrived(Arrival { light, surfaces, length, last, odds });
        }
        (self.length, self.last) = (length, last);
        Some(surface)
    }

    /// Goes on with a `chance`, in [0, 1].
    fn survives(self, chance: f64, sampler: &mut Sampler) -> Option<Self> {
        if chance >= 1.0 {
            return Some(self);
        }
        let goes_on = sampler.number() < chance;
        goes_on.then(|| Self { throughput: self.throughput / chance, ..self })
    }

    /// Goes on in a sampled direction, or ends by roulette.
    fn scattered(
        &self,
        to: &Scattered,
        settings: &Settings,
        sampler: &mut Sampler,
    ) -> Option<Self> {
        let walk = Self {
            direction: to.direction,
            throughput: self.throughput * to.weight,
            density: Some(to.density),
            odds: self.odds * to.odds,
            surfaces: self.surfaces + 1,
            ..*self
        };
        let is_limited = settings.bounces.is_some();
        let certain = if is_limited { CERTAIN_OF_LIMITED } else { CERTAIN_SURFACES };
        if walk.surfaces < certain {
            return Some(walk);
        }
        // Arvo and Kirk 1990, "Particle Transport and Image Synthesis".
        let reflectance = (walk.throughput / walk.odds).max_element();
        walk.survives(reflectance.min(GREATEST_SURVIVAL), sampler)
    }
}

/// Scattering at one point: each path goes on in a direction of the BSDF, and some branch into one
/// of the guide. All are weighed by the balance heuristic (Veach and Guibas 1995): a guide takes
/// nothing from BSDF sampling, so that it costs time where it is wrong, and no noise.
struct Scatter<'a> {
    bsdf: Bsdf,
    guide: Option<Aims<'a>>,
}

/// A sampled direction.
#[derive(Clone, Copy, Debug)]
struct Scattered {
    /// Unit length, pointing away from the surface.
    direction: DVec3,
    /// BSDF × cosine ÷ density.
    weight: DVec3,
    /// Expected number of samples per steradian.
    density: f64,
    /// The part of `density` that the BSDF alone has, in (0, 1].
    odds: f64,
}

impl<'a> Scatter<'a> {
    fn new(bsdf: Bsdf, surface: &Surface, field: Option<&'a Field>) -> Self {
        let guide = field.and_then(|field| field.aims(surface.position, surface.geometric_normal));
        Self { bsdf, guide }
    }

    /// BSDF × cosine for light from `direction`, a unit vector; and the expected number of samples
    /// per steradian there. Both are 0 where nothing is reflected.
    fn evaluate(&self, direction: DVec3) -> (DVec3, f64) {
        let (reflected, own) = self.bsdf.evaluate(direction);
        (reflected, self.density(own, direction))
    }

    /// A direction of the BSDF; `None` where nothing is reflected.
    fn sample(&self, sampler: &mut Sampler) -> Option<Scattered> {
        let sample = self.bsdf.sample(sampler)?;
        let density = self.density(sample.density, sample.direction);
        let odds = sample.density / density;
        Some(Scattered { direction: sample.direction, weight: sample.weight * odds, density, odds })
    }

    /// A direction of the guide, for a share of the paths; `None` where nothing is reflected.
    fn branch(&self, sampler: &mut Sampler) -> Option<Scattered> {
        let guide = self.guide.as_ref()?;
        let choice = sampler.number();
        if choice >= guide.share() {
            return None;
        }
        let direction = guide.sample(choice, sampler.pair());
        let (reflected, own) = self.bsdf.evaluate(direction);
        let density = self.density(own, direction);
        (own > 0.0 && reflected.max_element() > 0.0).then(|| Scattered {
            direction,
            weight: reflected / density,
            density,
            odds: own / density,
        })
    }

    /// Samples per steradian where BSDF sampling alone takes `own`.
    fn density(&self, own: f64, direction: DVec3) -> f64 {
        match &self.guide {
            Some(guide) if own > 0.0 => own + guide.density(direction),
            _ => own,
        }
    }
}

#[cfg(test)]
#[path = "walk_tests.rs"]
mod tests;
