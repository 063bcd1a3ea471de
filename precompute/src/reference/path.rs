//! The light along one path from the camera.

use bevy::math::{DVec3, Vec3};

use super::bsdf::Bsdf;
use super::color;
use super::render::Settings;
use super::sampler::Sampler;
use super::scene::ReferenceScene;
use super::surface::{Surface, is_cut_out};

/// Surfaces that a path of unlimited length meets before chance may end it.
const CERTAIN_SURFACES: u32 = 4;
/// Greatest probability of going on: even where nothing is absorbed, a path ends.
const GREATEST_SURVIVAL: f64 = 0.95;

/// How light with extent, from emissive triangles and sky maps, is found. All have the same mean.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Strategy {
    /// Both, weighed by the balance heuristic.
    #[default]
    Combined,
    /// Points drawn on lights alone: noisy where a surface is glossy or the light near.
    Lights,
    /// What scattered paths meet alone: noisy where the light is small.
    Scattering,
}

impl Strategy {
    /// Weight of a sample drawn with density `own`, where the other technique would draw it with
    /// density `other`. A technique that cannot draw it leaves all to the one that can.
    fn weight(self, is_light_sample: bool, own: f64, other: f64) -> f64 {
        match self {
            _ if other <= 0.0 => 1.0,
            Self::Combined => own / (own + other),
            Self::Lights => f64::from(u8::from(is_light_sample)),
            Self::Scattering => f64::from(u8::from(!is_light_sample)),
        }
    }
}

/// One estimate of the radiance along a camera ray, nits.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Estimate {
    /// By paths that meet one surface at most: light → surface → eye, and what is seen of emissive
    /// surfaces and of the sky.
    pub(super) direct: DVec3,
    /// Of that, by paths from an emissive surface or the sky that meet one surface: what lamps do
    /// not send.
    pub(super) extended: DVec3,
    /// By all longer paths.
    pub(super) indirect: DVec3,
}

impl Estimate {
    /// Whether single precision can hold all of it.
    pub(super) fn is_sound(&self) -> bool {
        // So written, NaN is not sound.
        let fits =
            |light: DVec3| light.to_array().iter().all(|value| value.abs() <= f64::from(f32::MAX));
        fits(self.direct) && fits(self.indirect)
    }

    /// `surfaces` is how many surfaces scattered the light of a lamp.
    fn add(&mut self, surfaces: u32, light: DVec3) {
        if surfaces <= 1 { self.direct += light } else { self.indirect += light }
    }

    /// The same of what glows.
    fn add_extended(&mut self, surfaces: u32, light: DVec3) {
        self.add(surfaces, light);
        if surfaces == 1 {
            self.extended += light;
        }
    }
}

/// Follows a path that starts at `origin`, metres, in `direction`, a unit vector.
pub(super) fn trace(
    scene: &ReferenceScene,
    settings: &Settings,
    mut origin: Vec3,
    mut direction: DVec3,
    sampler: &mut Sampler,
) -> Estimate {
    let mut estimate = Estimate::default();
    let mut throughput = DVec3::ONE;
    // Density with which `direction` was drawn; the camera's is no chance.
    let mut density = None;
    for surfaces in 0.. {
        let Some(hit) = scene.closest(origin, direction) else {
            let weight = density.map_or(1.0, |own| {
                settings.strategy.weight(false, own, scene.sky.density(direction))
            });
            estimate.add_extended(surfaces, throughput * scene.sky.radiance(direction) * weight);
            break;
        };
        let surface = Surface::new(&scene.geometry, &hit);
        let emitted = color(surface.material.emissive);
        if emitted != DVec3::ZERO {
            let weight = density.map_or(1.0, |own| {
                let per_steradian = per_steradian(
                    scene.emitters.density(emitted),
                    surface.position - origin.as_dvec3(),
                    surface.geometric_normal,
                );
                settings.strategy.weight(false, own, per_steradian)
            });
            estimate.add_extended(surfaces, throughput * emitted * weight);
        }
        if settings.bounces.is_some_and(|bounces| surfaces > bounces) {
            break;
        }
        let bsdf = Bsdf::new(&surface, -direction, settings.shading);
        origin = surface.departure();
        estimate.add(surfaces + 1, throughput * lamps(scene, &bsdf, &surface, origin));
        estimate.add_extended(
            surfaces + 1,
            throughput * extended(scene, settings, &bsdf, origin, sampler),
        );
        // After the last surface a path can only meet a light.
        if settings.bounces == Some(surfaces) && !scene.has_extended_light() {
            break;
        }
        let Some(scattering) = bsdf.sample(sampler) else { break };
        throughput *= scattering.weight;
        (direction, density) = (scattering.direction, Some(scattering.density));
        // Arvo and Kirk 1990, "Particle Transport and Image Synthesis". Paths of limited length go
        // to their end: it is near.
        if settings.bounces.is_none() && surfaces + 1 >= CERTAIN_SURFACES {
            let survival = throughput.max_element().min(GREATEST_SURVIVAL);
            if sampler.number() >= survival {
                break;
            }
            throughput /= survival;
        }
    }
    estimate
}

/// Light from suns and lamps that a surface reflects: from all of them, since there are few and
/// those out of reach cost no ray.
fn lamps(scene: &ReferenceScene, bsdf: &Bsdf, surface: &Surface, origin: Vec3) -> DVec3 {
    let mut sum = DVec3::ZERO;
    for light in &scene.lights {
        let Some(arrival) = light.arrival(surface.position) else { continue };
        let reflected = bsdf.evaluate(arrival.direction).0 * arrival.illuminance;
        if reflected.max_element() > 0.0 && scene.is_lit(origin, &arrival) {
            sum += reflected;
        }
    }
    sum
}

/// Light from one point of an emissive triangle and from one direction of a sky map that a surface
/// reflects.
fn extended(
    scene: &ReferenceScene,
    settings: &Settings,
    bsdf: &Bsdf,
    origin: Vec3,
    sampler: &mut Sampler,
) -> DVec3 {
    let mut sum = DVec3::ZERO;
    if settings.strategy == Strategy::Scattering {
        return sum;
    }
    let mut add = |direction: DVec3, distance: f64, radiance: DVec3, density: f64| {
        let (reflected, other) = bsdf.evaluate(direction);
        let light = reflected * radiance / density * settings.strategy.weight(true, density, other);
        if light.max_element() > 0.0 && scene.is_open(origin, direction, distance) {
            sum += light;
        }
    };
    if !scene.emitters.is_empty() {
        let (choice, pair) = (sampler.number(), sampler.pair());
        if let Some(point) = scene.emitters.sample(&scene.geometry, choice, pair) {
            let ray = point.position - origin.as_dvec3();
            let emitter = Surface::new(&scene.geometry, &point.hit);
            let density = per_steradian(point.density, ray, emitter.geometric_normal);
            let shines = ray.dot(emitter.geometric_normal) < 0.0 || emitter.material.double_sided;
            if shines
                && density.is_finite()
                && density > 0.0
                && !is_cut_out(&scene.geometry, &point.hit)
            {
                add(ray.normalize(), ray.length(), color(emitter.material.emissive), density);
            }
        }
    }
    if scene.sky.is_lit() {
        let (choice, pair) = (sampler.number(), sampler.pair());
        if let Some(sample) = scene.sky.sample(choice, pair).filter(|sample| sample.density > 0.0) {
            add(sample.direction, f64::INFINITY, sample.radiance, sample.density);
        }
    }
    sum
}

/// A density per m² of a surface with `normal`, met by `ray` (metres), as a density per steradian
/// where the ray starts.
fn per_steradian(per_square_metre: f64, ray: DVec3, normal: DVec3) -> f64 {
    let distance_squared = ray.length_squared();
    per_square_metre * distance_squared * distance_squared.sqrt()
        / ray.dot(normal).abs().max(f64::MIN_POSITIVE)
}
