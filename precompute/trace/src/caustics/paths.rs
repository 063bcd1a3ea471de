//! Light–specular photons from the lights, and all other light along paths from the camera.

use glam::{DVec3, Vec3};

use super::Split;
use super::map::{Photon, PhotonMap};
use crate::color::luminance;
use crate::integrator::path::{
    CERTAIN_SURFACES, GREATEST_SURVIVAL, extended, per_steradian, punctual,
};
use crate::integrator::photons::{Flight, emitted};
use crate::sampler::Sampler;

/// Random numbers that are not those of the image.
const SEED: u64 = 0xc2b2_ae3d_27d4_eb4f;

impl Split<'_> {
    /// Traces `count` photons of a pass; `None` where `interrupted`.
    pub(super) fn photons(
        &self,
        [pass, count]: [u32; 2],
        interrupted: &(dyn Fn() -> bool + Sync),
    ) -> Option<PhotonMap> {
        let seed = self.settings.seed.wrapping_add(SEED);
        let follow = |flight, sampler: &mut Sampler, found: &mut Vec<Photon>| {
            self.follow(flight, sampler, found);
        };
        emitted(self.scene, self.settings, seed, [pass, count], interrupted, follow)
            .map(PhotonMap::new)
    }

    fn follow(&self, flight: Flight, sampler: &mut Sampler, found: &mut Vec<Photon>) {
        let (mut origin, mut direction, mut power) =
            (flight.origin, flight.direction, flight.power);
        let (mut length, mut pace) = (flight.length, flight.pace);
        for surfaces in 0.. {
            let Some(at) = self.closest(origin, direction) else { return };
            length += pace * f64::from(at.hit.distance);
            pace = 1.0;
            let (normal, geometric_normal) = (at.surface.normal, at.surface.geometric_normal);
            let towards = -direction;
            if surfaces == 0 {
                power = flight.arriving(at.surface.position);
            }
            if surfaces > 0 && !at.is_mirror() && power.max_element() > 0.0 {
                found.push(Photon {
                    position: at.surface.position.as_vec3(),
                    direction: towards.as_vec3(),
                    power: power.as_vec3(),
                    surfaces,
                    length,
                });
            }
            if self.settings.bounces.is_some_and(|bounces| surfaces >= bounces) {
                return;
            }
            let reflected = at.sample(sampler).filter(|reflected| reflected.is_specular);
            let Some(next) = reflected else { return };
            // Veach 1997, "Robust Monte Carlo Methods for Light Transport Simulation", section 5.3:
            // the shading normal's cosine belongs to the end that the light comes from.
            let arriving = towards.dot(normal) / towards.dot(geometric_normal);
            let leaving = next.direction.dot(geometric_normal);
            let weight = next.bsdf * (leaving / next.density * arriving.max(0.0));
            let survival = luminance(weight).min(GREATEST_SURVIVAL);
            if !weight.is_finite() || sampler.number() >= survival {
                return;
            }
            power *= weight / survival;
            (origin, direction) = (at.surface.ray_origin(), next.direction);
        }
    }

    /// One estimate of the radiance along a camera ray, nits, without the light that photons bring.
    pub(super) fn path(
        &self,
        (mut origin, mut direction): (Vec3, DVec3),
        sampler: &mut Sampler,
    ) -> DVec3 {
        let Self { scene, settings, .. } = *self;
        let (mut sum, mut throughput) = (DVec3::ZERO, DVec3::ONE);
        // Sampling density of `direction`; none for the camera ray.
        let mut density = None;
        let weigh = |own: Option<f64>, other: f64| {
            own.map_or(1.0, |own| settings.strategy.weight(false, own, other))
        };
        // Diffuse surfaces so far, and whether photons bring the light of a source at the next hit.
        let (mut diffuse, mut is_brought) = (0, false);
        for surfaces in 0.. {
            let Some(at) = self.closest(origin, direction) else {
                if !is_brought {
                    let weight = weigh(density, scene.sky.density(direction));
                    sum += throughput * scene.sky.radiance(direction) * weight;
                }
                break;
            };
            if at.surface.emission != DVec3::ZERO && !is_brought {
                let ray = at.surface.position - origin.as_dvec3();
                let per_area = scene.emitters.density(&at.hit);
                let other = per_steradian(per_area, ray, at.surface.geometric_normal);
                sum += throughput * at.surface.emission * weigh(density, other);
            }
            if settings.bounces.is_some_and(|bounces| surfaces > bounces) {
                break;
            }
            origin = at.surface.ray_origin();
            let without_specular = diffuse == 1;
            let evaluate = |direction| {
                at.lobes(direction).map_or((DVec3::ZERO, 0.0), |lobes| {
                    let specular = if without_specular { DVec3::ZERO } else { lobes.specular };
                    ((lobes.diffuse + specular) * lobes.cosine, lobes.density)
                })
            };
            let position = at.surface.position;
            sum += throughput * punctual(scene, evaluate, position, origin, &mut |_, _| ());
            sum +=
                throughput * extended(scene, settings, evaluate, origin, sampler, &mut |_, _| ());
            if settings.bounces == Some(surfaces) && !scene.has_extended_light() {
                break;
            }
            let Some(next) = at.sample(sampler) else { break };
            throughput *= next.bsdf * (next.cosine / next.density);
            is_brought = next.is_specular && without_specular;
            diffuse += u32::from(!next.is_specular);
            (direction, density) = (next.direction, Some(next.density));
            if settings.bounces.is_none() && surfaces + 1 >= CERTAIN_SURFACES {
                let survival = throughput.max_element().min(GREATEST_SURVIVAL);
                if sampler.number() >= survival {
                    break;
                }
                throughput /= survival;
            }
        }
        sum
    }
}
