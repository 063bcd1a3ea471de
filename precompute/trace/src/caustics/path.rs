//! All light but that of light–specular paths, along paths from the camera.

use glam::{DVec3, Vec3};

use super::split::Caustics;
use crate::bsdf::{Bsdf, Surface};
use crate::integrator::{
    CERTAIN_SURFACES, GREATEST_SURVIVAL, ReferenceScene, Settings, extended, per_steradian,
    punctual,
};
use crate::sampler::Sampler;

/// One estimate of the radiance along a camera ray, nits, without the light that photons bring.
pub(super) fn trace(
    scene: &ReferenceScene,
    settings: &Settings,
    caustics: &Caustics,
    (mut origin, mut direction): (Vec3, DVec3),
    sampler: &mut Sampler,
) -> DVec3 {
    let (mut sum, mut throughput) = (DVec3::ZERO, DVec3::ONE);
    // Sampling density of `direction`; none for the camera ray.
    let mut density = None;
    // Diffuse surfaces so far, and whether photons bring the light of a source at the next hit.
    let (mut diffuse, mut is_brought) = (0, false);
    for surfaces in 0.. {
        let Some(hit) = scene.closest(origin, direction) else {
            if !is_brought {
                let weight = density.map_or(1.0, |own| {
                    settings.strategy.weight(false, own, scene.sky.density(direction))
                });
                sum += throughput * scene.sky.radiance(direction) * weight;
            }
            break;
        };
        let surface = Surface::new(&scene.geometry, &hit);
        if surface.emission != DVec3::ZERO && !is_brought {
            let weight = density.map_or(1.0, |own| {
                let ray = surface.position - origin.as_dvec3();
                let other =
                    per_steradian(scene.emitters.density(&hit), ray, surface.geometric_normal);
                settings.strategy.weight(false, own, other)
            });
            sum += throughput * surface.emission * weight;
        }
        if settings.bounces.is_some_and(|bounces| surfaces > bounces) {
            break;
        }
        let bsdf = Bsdf::new(&surface, -direction, settings.shading);
        origin = surface.ray_origin();
        let without_specular = caustics.brings(diffuse);
        let evaluate = |direction| {
            caustics.lobes(&bsdf, &surface, direction).map_or((DVec3::ZERO, 0.0), |lobes| {
                let specular = if without_specular { DVec3::ZERO } else { lobes.specular };
                ((lobes.diffuse + specular) * lobes.cosine, lobes.density)
            })
        };
        sum += throughput * punctual(scene, evaluate, surface.position, origin, &mut |_, _| ());
        sum += throughput * extended(scene, settings, evaluate, origin, sampler, &mut |_, _| ());
        if settings.bounces == Some(surfaces) && !scene.has_extended_light() {
            break;
        }
        let Some(next) = caustics.sample(&bsdf, &surface, sampler) else { break };
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
