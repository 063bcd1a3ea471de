//! Radiance along one path from the camera.

use glam::{DVec3, Vec3};

use super::lights::{Sampled, emitter, per_steradian, sky};
use super::scatter::Scatter;
use super::scene::ReferenceScene;
use super::settings::{Settings, Strategy};
use crate::bsdf::{Bsdf, Surface};
use crate::guide::Field;
use crate::sampler::Sampler;

/// Hits before Russian roulette begins, for paths of unlimited length.
pub(crate) const CERTAIN_SURFACES: u32 = 4;
/// Greatest survival probability: even where nothing is absorbed, a path ends.
pub(crate) const GREATEST_SURVIVAL: f64 = 0.95;

/// One estimate of the radiance along a camera ray, nits.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Estimate {
    /// Paths with at most one surface between light and eye: light → surface → eye, and directly
    /// visible emission of surfaces and sky.
    pub(super) direct: DVec3,
    /// The share of `direct` that emissive surfaces and the sky send by way of one surface: without
    /// punctual lights.
    pub(super) extended: DVec3,
    /// All longer paths.
    pub(super) indirect: DVec3,
}

impl Estimate {
    /// Whether all values are finite in single precision.
    pub(super) fn fits_f32(&self) -> bool {
        // This form also rejects NaN.
        let fits =
            |light: DVec3| light.to_array().iter().all(|value| value.abs() <= f64::from(f32::MAX));
        fits(self.direct) && fits(self.indirect)
    }

    /// Adds light that `surfaces` surfaces scattered.
    pub(super) fn add(&mut self, surfaces: u32, light: DVec3) {
        if surfaces <= 1 { self.direct += light } else { self.indirect += light }
    }

    /// The same for light of emissive surfaces and of the sky.
    pub(super) fn add_extended(&mut self, surfaces: u32, light: DVec3) {
        self.add(surfaces, light);
        if surfaces == 1 {
            self.extended += light;
        }
    }
}

/// Light that one path brings to the camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Arrival {
    /// Linear RGB, nits, already divided by the density of the path.
    pub(crate) light: DVec3,
    /// Surfaces that scattered it.
    pub(crate) surfaces: u32,
    /// Metres from the light to where the camera's ray begins; for the sky and parallel light,
    /// from the surface that they light.
    pub(crate) length: f64,
    /// The share of `length` between the surface that the camera sees and the ray's beginning.
    pub(crate) last: f64,
}

/// What listens to the paths of a pixel, one after the other.
pub(crate) trait Record {
    /// A path begins, with a ray that starts so many metres from the eye.
    fn begin(&mut self, _near: f64) {}
    /// The path brings light.
    fn arrived(&mut self, _: Arrival) {}
    /// The path is at its end; it `counts` unless its estimate is dropped.
    fn end(&mut self, _counts: bool) {}
}

impl Record for () {}

/// Traces a path from `origin`, metres, in `direction`, a unit vector. `field` guides it, and `record`
/// is told of all light that arrives; in fog it is told nothing.
pub(super) fn trace(
    scene: &ReferenceScene,
    settings: &Settings,
    field: Option<&Field>,
    mut origin: Vec3,
    mut direction: DVec3,
    sampler: &mut Sampler,
    record: &mut impl Record,
) -> Estimate {
    #[cfg(feature = "media")]
    if let Some(fog) = &scene.fog {
        return super::media::trace(scene, fog, settings, origin, direction, sampler);
    }
    let mut estimate = Estimate::default();
    let mut throughput = DVec3::ONE;
    // The throughput that BSDF sampling would have had along the same path: roulette by the real
    // one would kill guided paths as often as the guide chooses them.
    let mut reflectance = DVec3::ONE;
    // Sampling density of `direction`; none for the camera ray.
    let mut density = None;
    let (mut length, mut last) = (0.0, 0.0);
    for surfaces in 0.. {
        let Some(hit) = scene.closest(origin, direction) else {
            let weight = density.map_or(1.0, |own| {
                settings.strategy.weight(false, own, scene.sky.density(direction))
            });
            let light = throughput * scene.sky.radiance(direction) * weight;
            estimate.add_extended(surfaces, light);
            record.arrived(Arrival { light, surfaces, length, last });
            break;
        };
        let surface = Surface::new(&scene.geometry, &hit);
        length += surface.position.distance(origin.as_dvec3());
        if surfaces == 0 {
            last = length;
        }
        let emitted = surface.emission;
        if emitted != DVec3::ZERO {
            let weight = density.map_or(1.0, |own| {
                let per_steradian = per_steradian(
                    scene.emitters.density(&hit),
                    surface.position - origin.as_dvec3(),
                    surface.geometric_normal,
                );
                settings.strategy.weight(false, own, per_steradian)
            });
            let light = throughput * emitted * weight;
            estimate.add_extended(surfaces, light);
            record.arrived(Arrival { light, surfaces, length, last });
        }
        if settings.bounces.is_some_and(|bounces| surfaces > bounces) {
            break;
        }
        let bsdf = Bsdf::new(&surface, -direction, settings.shading);
        origin = surface.ray_origin();
        let mut arrived = |light: DVec3, distance: f64| {
            let length = length + if distance.is_finite() { distance } else { 0.0 };
            let light = throughput * light;
            record.arrived(Arrival { light, surfaces: surfaces + 1, length, last });
        };
        let light = punctual(scene, |to| bsdf.evaluate(to), surface.position, origin, &mut arrived);
        estimate.add(surfaces + 1, throughput * light);
        let scatter = Scatter::new(bsdf, &surface, field);
        estimate.add_extended(
            surfaces + 1,
            throughput
                * extended(
                    scene,
                    settings,
                    |to| scatter.evaluate(to),
                    origin,
                    sampler,
                    &mut arrived,
                ),
        );
        // Beyond the last surface a path can only hit a light.
        if settings.bounces == Some(surfaces) && !scene.has_extended_light() {
            break;
        }
        let Some(scattered) = scatter.sample(sampler) else { break };
        throughput *= scattered.weight;
        reflectance *= scattered.bsdf_weight;
        (direction, density) = (scattered.direction, Some(scattered.density));
        // Arvo and Kirk 1990, "Particle Transport and Image Synthesis". Paths of limited length are
        // short and need no Russian roulette.
        if settings.bounces.is_none() && surfaces + 1 >= CERTAIN_SURFACES {
            let survival = reflectance.max_element().min(GREATEST_SURVIVAL);
            if sampler.number() >= survival {
                break;
            }
            throughput /= survival;
            reflectance /= survival;
        }
    }
    estimate
}

/// Reflected light of punctual lights. All are evaluated: they are few, and those out of range cost
/// no ray. `evaluate` is that of a [`Bsdf`]; `arrived` gets light and distance of each.
pub(crate) fn punctual(
    scene: &ReferenceScene,
    evaluate: impl Fn(DVec3) -> (DVec3, f64),
    position: DVec3,
    origin: Vec3,
    arrived: &mut impl FnMut(DVec3, f64),
) -> DVec3 {
    let mut sum = DVec3::ZERO;
    for light in &scene.lights {
        let Some(incident) = light.incident(position) else { continue };
        let reflected = evaluate(incident.direction).0 * incident.illuminance;
        if reflected.max_element() > 0.0 && scene.is_lit(origin, &incident) {
            sum += reflected;
            arrived(reflected, incident.distance);
        }
    }
    sum
}

/// Reflected light of one sampled point of an emissive triangle and of one sampled direction of the
/// sky map. `evaluate` is that of a [`Scatter`].
pub(crate) fn extended(
    scene: &ReferenceScene,
    settings: &Settings,
    evaluate: impl Fn(DVec3) -> (DVec3, f64),
    origin: Vec3,
    sampler: &mut Sampler,
    arrived: &mut impl FnMut(DVec3, f64),
) -> DVec3 {
    let mut sum = DVec3::ZERO;
    if settings.strategy == Strategy::Scattering {
        return sum;
    }
    let samples = [emitter(scene, origin.as_dvec3(), sampler), sky(scene, sampler)];
    for Sampled { direction, distance, radiance, density, .. } in samples.into_iter().flatten() {
        let (reflected, other) = evaluate(direction);
        let light = reflected * radiance / density * settings.strategy.weight(true, density, other);
        if light.max_element() > 0.0 && scene.is_unoccluded(origin, direction, distance) {
            sum += light;
            arrived(light, distance);
        }
    }
    sum
}
