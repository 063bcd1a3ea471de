//! Directions in which a path goes on: those of the BSDF, and for a share of the samples those of
//! a guide.

use glam::DVec3;

use crate::bsdf::{Bsdf, Surface};
use crate::guide::{Cones, Field};
use crate::sampler::Sampler;

/// Scattering at one point: a mixture of BSDF sampling and guide, of which each sample takes one
/// (Vorba et al. 2014, "On-line Learning of Parametric Mixture Models for Light Transport
/// Simulation", section 6).
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
    /// The same without a guide.
    pub(super) bsdf_weight: DVec3,
    /// Density of the mixture, per steradian.
    pub(super) density: f64,
}

impl Scatter {
    pub(super) fn new(bsdf: Bsdf, surface: &Surface, field: Option<&Field>) -> Self {
        let sources = field.and_then(|field| field.at(surface.position, surface.geometric_normal));
        Self { bsdf, guide: sources.map(|sources| sources.seen_from(surface.position)) }
    }

    /// BSDF × cosine for light from `direction`, a unit vector; and the density, per steradian,
    /// with which [`sample`](Self::sample) takes that direction. Both are 0 where nothing is
    /// reflected.
    pub(super) fn evaluate(&self, direction: DVec3) -> (DVec3, f64) {
        let (reflected, own) = self.bsdf.evaluate(direction);
        let density = match &self.guide {
            Some(cones) if own > 0.0 => mixed(cones, own, direction),
            _ => own,
        };
        (reflected, density)
    }

    /// Samples a direction; `None` where nothing is reflected.
    pub(super) fn sample(&self, sampler: &mut Sampler) -> Option<Scattered> {
        let unguided = |sampler: &mut Sampler| {
            let sample = self.bsdf.sample(sampler)?;
            Some(Scattered {
                direction: sample.direction,
                weight: sample.weight,
                bsdf_weight: sample.weight,
                density: sample.density,
            })
        };
        let Some(cones) = &self.guide else { return unguided(sampler) };
        let choice = sampler.number();
        if choice >= cones.share() {
            let own = unguided(sampler)?;
            let density = mixed(cones, own.density, own.direction);
            return Some(Scattered {
                weight: own.weight * (own.density / density),
                density,
                ..own
            });
        }
        let direction = cones.sample(choice, sampler.pair());
        let (reflected, own) = self.bsdf.evaluate(direction);
        if own <= 0.0 || reflected.max_element() <= 0.0 {
            return None;
        }
        let density = mixed(cones, own, direction);
        let (weight, bsdf_weight) = (reflected / density, reflected / own);
        Some(Scattered { direction, weight, bsdf_weight, density })
    }
}

/// Density of the mixture where BSDF sampling alone has the density `own`.
fn mixed(cones: &Cones, own: f64, direction: DVec3) -> f64 {
    (1.0 - cones.share()) * own + cones.density(direction)
}
