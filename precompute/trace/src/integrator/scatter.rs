//! Directions in which a path goes on: one of the BSDF, and at some points another one of a guide.

use glam::DVec3;

use crate::bsdf::{Bsdf, Surface};
use crate::guide::{Cones, Field};
use crate::sampler::Sampler;

/// Scattering at one point: each path goes on in a direction of the BSDF, and some branch into one
/// of the guide. All are weighed by the balance heuristic (Veach and Guibas 1995): a guide takes
/// nothing from BSDF sampling, so that it costs time where it is wrong, and no noise.
pub(super) struct Scatter {
    bsdf: Bsdf,
    guide: Option<Cones>,
}

/// A sampled direction.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scattered {
    /// Unit length, pointing away from the surface.
    pub(super) direction: DVec3,
    /// BSDF × cosine ÷ density.
    pub(super) weight: DVec3,
    /// Expected number of samples per steradian.
    pub(super) density: f64,
    /// The part of `density` that the BSDF alone has, in (0, 1].
    pub(super) odds: f64,
}

impl Scatter {
    pub(super) fn new(bsdf: Bsdf, surface: &Surface, field: Option<&Field>) -> Self {
        let sources = field.and_then(|field| field.at(surface.position, surface.geometric_normal));
        Self { bsdf, guide: sources.map(|sources| sources.seen_from(surface.position)) }
    }

    /// BSDF × cosine for light from `direction`, a unit vector; and the expected number of samples
    /// per steradian there. Both are 0 where nothing is reflected.
    pub(super) fn evaluate(&self, direction: DVec3) -> (DVec3, f64) {
        let (reflected, own) = self.bsdf.evaluate(direction);
        (reflected, self.density(own, direction))
    }

    /// A direction of the BSDF; `None` where nothing is reflected.
    pub(super) fn sample(&self, sampler: &mut Sampler) -> Option<Scattered> {
        let sample = self.bsdf.sample(sampler)?;
        let density = self.density(sample.density, sample.direction);
        let odds = sample.density / density;
        Some(Scattered { direction: sample.direction, weight: sample.weight * odds, density, odds })
    }

    /// A direction of the guide, for a share of the paths; `None` where nothing is reflected.
    pub(super) fn branch(&self, sampler: &mut Sampler) -> Option<Scattered> {
        let cones = self.guide.as_ref()?;
        let choice = sampler.number();
        if choice >= cones.share() {
            return None;
        }
        let direction = cones.sample(choice, sampler.pair());
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
            Some(cones) if own > 0.0 => own + cones.density(direction),
            _ => own,
        }
    }
}
