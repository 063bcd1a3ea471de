//! Radiance along one path from the camera, and sampling of lights.

use glam::{DVec3, Vec3};

use super::walk::{Tracer, Walk};
use super::{ReferenceScene, Settings, Strategy};
use crate::bsdf::{Surface, is_cut_out};
use crate::guide::Field;
use crate::light::{EmitterPoint, Sampled};
use crate::sampler::Sampler;

/// Hits before Russian roulette begins, for paths of unlimited length.
pub(crate) const CERTAIN_SURFACES: u32 = 4;
/// The same for paths of limited length: those of few bounces need no roulette, and many must end.
pub(super) const CERTAIN_OF_LIMITED: u32 = 32;
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
    /// Surfaces that scattered it; each time that fog did counts as one.
    pub(crate) surfaces: u32,
    /// Metres from the light to where the camera's ray begins; for the sky and parallel light,
    /// from the surface that they light.
    pub(crate) length: f64,
    /// The share of `length` between the ray's beginning and where it was scattered or sent last.
    pub(crate) last: f64,
    /// How often unguided paths bring this light ÷ how often these do, in (0, 1].
    pub(crate) odds: f64,
}

/// What listens to the paths of a pixel, one after the other.
pub(crate) trait Record {
    /// A path begins, with a ray that starts so many metres from the eye.
    fn begin(&mut self, _near: f64) {}
    /// The path or a branch of it meets a surface or the sky; `odds` as in [`Arrival`].
    fn met(&mut self, _odds: f64) {}
    /// The path brings light.
    fn arrived(&mut self, _: Arrival) {}
    /// The path is at its end; it `counts` unless its estimate is dropped.
    fn end(&mut self, _counts: bool) {}
}

impl Record for () {}

/// Traces a path and its branches from `origin`, metres, in `direction`, a unit vector. `field`
/// guides it, and `record` is told of all light that arrives.
pub(super) fn trace(
    scene: &ReferenceScene,
    settings: &Settings,
    field: Option<&Field>,
    origin: Vec3,
    direction: DVec3,
    sampler: &mut Sampler,
    record: &mut impl Record,
) -> Estimate {
    #[cfg(feature = "media")]
    if let Some(fog) = &scene.fog {
        return super::media::trace(scene, fog, settings, (origin, direction), sampler, record);
    }
    let mut tracer =
        Tracer { scene, settings, field, sampler, record, estimate: Estimate::default() };
    let mut branches = Vec::new();
    let mut next = Some(Walk::new(origin, direction));
    while let Some(walk) = next {
        next = walk.step(&mut tracer, &mut branches).or_else(|| branches.pop());
    }
    tracer.estimate
}

/// Reflected light of punctual lights. All are evaluated: they are few, and those out of range cost
/// no ray. `evaluate` is that of a `Bsdf`; `arrived` gets light and distance of each.
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
/// sky map. `evaluate` is that of a `Scatter`.
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

/// A point of an emissive triangle that shines on `position`, metres.
pub(crate) fn emitter(
    scene: &ReferenceScene,
    position: DVec3,
    sampler: &mut Sampler,
) -> Option<Sampled> {
    if scene.emitters.is_empty() {
        return None;
    }
    let (choice, pair) = (sampler.number(), sampler.pair());
    shining(scene, &scene.emitters.sample(choice, pair)?, position)
}

/// What `point` is from `position`, if it shines there.
pub(super) fn shining(
    scene: &ReferenceScene,
    point: &EmitterPoint,
    position: DVec3,
) -> Option<Sampled> {
    let ray = point.position - position;
    let surface = Surface::new(&scene.geometry, &point.hit);
    let density = per_steradian(point.density, ray, surface.geometric_normal);
    let shines = ray.dot(surface.geometric_normal) < 0.0 || surface.material.double_sided;
    let counts =
        shines && density.is_finite() && density > 0.0 && !is_cut_out(&scene.geometry, &point.hit);
    counts.then(|| Sampled {
        direction: ray.normalize(),
        distance: ray.length(),
        radiance: surface.emission,
        density,
        point: Some(point.position),
    })
}

/// A direction of the sky.
pub(super) fn sky(scene: &ReferenceScene, sampler: &mut Sampler) -> Option<Sampled> {
    if !scene.sky.is_lit() {
        return None;
    }
    let (choice, pair) = (sampler.number(), sampler.pair());
    scene.sky.sample(choice, pair).filter(|sample| sample.density > 0.0)
}

/// Converts a density per m² on a surface with `normal` into a density per steradian at the start
/// of `ray` (metres), which ends on that surface.
pub(crate) fn per_steradian(per_square_metre: f64, ray: DVec3, normal: DVec3) -> f64 {
    let squared = ray.length_squared();
    per_square_metre * squared * squared.sqrt() / ray.dot(normal).abs().max(f64::MIN_POSITIVE)
}
