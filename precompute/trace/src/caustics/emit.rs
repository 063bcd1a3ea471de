//! Light–specular photons.

use glam::DVec3;
use rayon::prelude::*;

use super::map::{Photon, PhotonMap};
use super::split::{Caustics, Reflected};
use crate::bsdf::{Bsdf, Surface};
use crate::color::luminance;
use crate::integrator::{Emission, GREATEST_SURVIVAL, ReferenceScene, Settings, Start};
use crate::sampler::Sampler;

/// Photons that are traced one after the other.
const CHUNK: u32 = 4096;
/// Random numbers that are not those of the image.
const SEED: u64 = 0xc2b2_ae3d_27d4_eb4f;

/// Traces `count` photons of pass number `pass`; `None` where `interrupted`.
pub(super) fn photons(
    scene: &ReferenceScene,
    settings: &Settings,
    caustics: &Caustics,
    pass: u32,
    count: u32,
    interrupted: &(dyn Fn() -> bool + Sync),
) -> Option<PhotonMap> {
    let Some(emission) = Emission::new(scene, settings) else { return Some(PhotonMap::default()) };
    let chunks: Vec<Vec<Photon>> = (0..count.div_ceil(CHUNK))
        .into_par_iter()
        .map(|chunk| {
            let mut found = Vec::new();
            for i in chunk * CHUNK..count.min((chunk + 1).saturating_mul(CHUNK)) {
                let seed = settings.seed.wrapping_add(SEED);
                let mut sampler = Sampler::new(seed, u64::from(pass), i);
                trace(&emission, scene, settings, caustics, &mut sampler, &mut found);
            }
            (!interrupted()).then_some(found)
        })
        .collect::<Option<_>>()?;
    Some(PhotonMap::new(chunks.concat()))
}

fn trace(
    emission: &Emission,
    scene: &ReferenceScene,
    settings: &Settings,
    caustics: &Caustics,
    sampler: &mut Sampler,
    found: &mut Vec<Photon>,
) {
    let (choice, [a, b], [c, d]) = (sampler.number(), sampler.pair(), sampler.pair());
    let start: Start = [choice, a, b, c, d];
    let Some(flight) = emission.emit(&start) else { return };
    let (mut origin, mut direction, mut power) = (flight.origin, flight.direction, flight.power);
    // Diffuse surfaces that reflected the photon.
    let mut diffuse = 0;
    for surfaces in 0.. {
        let Some(hit) = scene.closest(origin, direction) else { return };
        let surface = Surface::new(&scene.geometry, &hit);
        if surfaces == 0 {
            power = flight.arriving(surface.position);
        }
        let towards = -direction;
        let bsdf = Bsdf::new(&surface, towards, settings.shading);
        let arrives = surfaces > 0 && !caustics.is_mirror(&bsdf, &surface);
        if arrives && power.max_element() > 0.0 {
            found.push(Photon {
                position: surface.position.as_vec3(),
                direction: towards.as_vec3(),
                power: power.as_vec3(),
                surfaces,
            });
        }
        if settings.bounces.is_some_and(|bounces| surfaces >= bounces) {
            return;
        }
        let Some((weight, next, is_specular)) =
            scatter(caustics, &bsdf, &surface, towards, sampler)
        else {
            return;
        };
        diffuse += u32::from(!is_specular);
        // The first reflection must be specular, and only so many later ones diffuse.
        if (surfaces == 0 && !is_specular) || diffuse >= caustics.deposits.max(1) {
            return;
        }
        let survival = luminance(weight).min(GREATEST_SURVIVAL);
        if sampler.number() >= survival {
            return;
        }
        power *= weight / survival;
        (origin, direction) = (surface.ray_origin(), next);
    }
}

/// Weight and direction of a reflected photon, and whether the specular part reflected it.
fn scatter(
    caustics: &Caustics,
    bsdf: &Bsdf,
    surface: &Surface,
    towards: DVec3,
    sampler: &mut Sampler,
) -> Option<(DVec3, DVec3, bool)> {
    let Reflected { direction: next, bsdf, density, is_specular, .. } =
        caustics.sample(bsdf, surface, sampler)?;
    // Veach 1997, "Robust Monte Carlo Methods for Light Transport Simulation", section 5.3: the
    // shading normal's cosine belongs to the end that the light comes from.
    let arriving = towards.dot(surface.normal) / towards.dot(surface.geometric_normal);
    let weight = bsdf * (next.dot(surface.geometric_normal) / density * arriving.max(0.0));
    weight.is_finite().then_some((weight, next, is_specular))
}
