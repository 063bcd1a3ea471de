//! Light along paths from the lights: photons, from which a guide learns.
//!
//! Jensen 1996, "Global Illumination using Photon Maps". A guide need not be exact, so that shading
//! normals need no correction here.

use std::f64::consts::{PI, TAU};

use glam::{DVec3, Vec3};

use super::path::GREATEST_SURVIVAL;
use super::{ReferenceScene, Settings, Strategy};
use crate::bsdf::{Bsdf, Surface, is_cut_out};
use crate::color::luminance;
use crate::guide::{Photon, around};
use crate::light::{PunctualLight, Sky};
use crate::sampler::{Sampler, pick};
use crate::scene::{Hit, Side};

/// Metres to where parallel light is taken to come from.
const FAR: f64 = 1e4;

/// All lights, as sources of photons.
#[derive(Debug)]
pub(crate) struct Emission<'a> {
    scene: &'a ReferenceScene,
    settings: &'a Settings,
    /// Middle and radius of a sphere around the scene, metres.
    middle: DVec3,
    radius: f64,
    /// Running sum of the lights' powers: punctual lights, then emissive triangles, then the sky.
    cumulative: Vec<f64>,
}

/// Light on its way.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Flight {
    pub(crate) origin: Vec3,
    pub(crate) direction: DVec3,
    /// Power ÷ probability.
    pub(crate) power: DVec3,
    /// 1/m²: the window of a punctual light's range; 0 for other lights.
    pub(crate) inverse_range_squared: f64,
    /// Metres that it went before `origin`.
    pub(crate) length: f64,
    /// Metres that count per metre of its way: 0 for parallel light, which comes from no place.
    pub(crate) pace: f64,
    /// Where it comes from.
    source: Vec3,
    /// Whether paths find it without a guide: they sample its light itself.
    is_sampled: bool,
}

impl Flight {
    /// Power that arrives at `position`, metres, on a straight way: punctual lights have a range.
    pub(crate) fn arriving(&self, position: DVec3) -> DVec3 {
        let squared = (position - self.origin.as_dvec3()).length_squared();
        let window = (1.0 - (squared * self.inverse_range_squared).powi(2)).clamp(0.0, 1.0);
        self.power * (window * window)
    }
}

/// Random numbers that choose a light, a point on it and a direction.
pub(crate) type Start = [f64; 5];

impl<'a> Emission<'a> {
    /// `None` where there is no light or nothing to light.
    pub(crate) fn new(scene: &'a ReferenceScene, settings: &'a Settings) -> Option<Self> {
        let bounds = scene.geometry.bounds()?;
        let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
        let (middle, radius) = (0.5 * (min + max), 0.5 * (max - min).length());
        let disc = PI * radius * radius;
        let punctual = scene.lights.iter().map(|light| match light {
            PunctualLight::Directional { illuminance, .. } => luminance(*illuminance) * disc,
            PunctualLight::Positional { intensity, cone, .. } => {
                luminance(*intensity) * TAU * (1.0 - least_cosine(*cone))
            }
        });
        let sky = match &scene.sky {
            Sky::Black => 0.0,
            Sky::Constant(radiance) => luminance(*radiance) * 4.0 * PI * disc,
            Sky::Map(_) => scene.sky.power() * disc,
        };
        let mut sum = 0.0;
        let cumulative: Vec<f64> = punctual
            .chain([PI * scene.emitters.power(), sky])
            .map(|power| {
                sum += if power.is_finite() { power } else { 0.0 };
                sum
            })
            .collect();
        (sum > 0.0 && sum.is_finite() && radius > 0.0).then_some(Self {
            scene,
            settings,
            middle,
            radius,
            cumulative,
        })
    }

    /// Traces one photon from `start`, and calls `arrived` wherever it arrives, and whether
    /// paths find its light there without a guide, by sampling lights.
    pub(super) fn trace(
        &self,
        start: &Start,
        sampler: &mut Sampler,
        mut arrived: impl FnMut(Photon, bool),
    ) {
        let Some(mut flight) = self.emit(start) else { return };
        for surfaces in 0.. {
            let Some(hit) = self.scene.closest(flight.origin, flight.direction) else { return };
            let surface = Surface::new(&self.scene.geometry, &hit);
            flight.power = flight.arriving(surface.position);
            let power = luminance(flight.power) as f32;
            if power > 0.0 && power.is_finite() {
                let photon = Photon {
                    position: surface.position.as_vec3(),
                    normal: surface.geometric_normal.as_vec3(),
                    source: flight.source,
                    power,
                };
                arrived(photon, flight.is_sampled);
            }
            if self.settings.bounces.is_some_and(|bounces| surfaces >= bounces) {
                return;
            }
            let bsdf = Bsdf::new(&surface, -flight.direction, self.settings.shading);
            let Some(scattering) = bsdf.sample(sampler) else { return };
            let survival = luminance(scattering.weight).min(GREATEST_SURVIVAL);
            if sampler.number() >= survival {
                return;
            }
            flight = Flight {
                origin: surface.ray_origin(),
                direction: scattering.direction,
                power: flight.power * scattering.weight / survival,
                inverse_range_squared: 0.0,
                length: flight.length + flight.pace * f64::from(hit.distance),
                pace: 1.0,
                source: surface.position.as_vec3(),
                is_sampled: false,
            };
        }
    }

    /// Light that leaves a light; `None` where the sampled point emits none.
    pub(crate) fn emit(&self, &[choice, a, b, c, d]: &Start) -> Option<Flight> {
        let index = pick(&self.cumulative, choice)?;
        let total = *self.cumulative.last()?;
        let before = if index == 0 { 0.0 } else { self.cumulative[index - 1] };
        let own = self.cumulative[index] - before;
        // What is left of the choice chooses within the light.
        let rest = ((choice * total - before) / own).clamp(0.0, 1.0 - f64::EPSILON);
        let samples_lights = self.settings.strategy != Strategy::Scattering;
        let flight = if let Some(light) = self.scene.lights.get(index) {
            match *light {
                PunctualLight::Directional { towards, illuminance } => {
                    self.parallel(towards, illuminance, [a, b], true)
                }
                PunctualLight::Positional {
                    position,
                    intensity,
                    inverse_range_squared,
                    axis,
                    cone,
                } => {
                    let least = least_cosine(cone);
                    let cosine = 1.0 - (1.0 - least) * a;
                    let mask = (cosine * cone.0 + cone.1).clamp(0.0, 1.0).powi(2);
                    Flight {
                        origin: position.as_vec3(),
                        direction: around(axis, cosine, b),
                        power: intensity * (mask * TAU * (1.0 - least)),
                        inverse_range_squared,
                        length: 0.0,
                        pace: 1.0,
                        source: position.as_vec3(),
                        is_sampled: true,
                    }
                }
            }
        } else if index == self.scene.lights.len() {
            let point = self.scene.emitters.sample(rest, [a, b])?;
            if is_cut_out(&self.scene.geometry, &point.hit) {
                return None;
            }
            // Double-sided triangles shine to both sides.
            let sides =
                if self.scene.geometry.material(&point.hit).double_sided { 2.0 } else { 1.0 };
            let side = if sides * c < 1.0 { Side::Front } else { Side::Back };
            let c = (sides * c).fract();
            let surface = Surface::new(&self.scene.geometry, &Hit { side, ..point.hit });
            Flight {
                origin: surface.ray_origin(),
                direction: around(surface.geometric_normal, c.sqrt(), d),
                power: surface.emission * (sides * PI / point.density),
                inverse_range_squared: 0.0,
                length: 0.0,
                pace: 1.0,
                source: surface.position.as_vec3(),
                is_sampled: samples_lights,
            }
        } else if let Some(sky) = self.scene.sky.sample(rest, [a, b]) {
            self.parallel(sky.direction, sky.radiance / sky.density, [c, d], samples_lights)
        } else {
            let towards = around(DVec3::Y, 1.0 - 2.0 * a, b);
            let illuminance = self.scene.sky.radiance(towards) * (4.0 * PI);
            self.parallel(towards, illuminance, [c, d], false)
        };
        Some(Flight { power: flight.power * (total / own), ..flight })
    }

    /// Parallel light from `towards` through a disc that covers the scene.
    fn parallel(
        &self,
        towards: DVec3,
        illuminance: DVec3,
        [u1, u2]: [f64; 2],
        is_sampled: bool,
    ) -> Flight {
        let offset = around(towards, 0.0, u2) * (self.radius * u1.sqrt());
        let origin = self.middle + towards * self.radius + offset;
        Flight {
            origin: origin.as_vec3(),
            direction: -towards,
            power: illuminance * (PI * self.radius * self.radius),
            inverse_range_squared: 0.0,
            length: 0.0,
            pace: 0.0,
            source: (origin + towards * FAR).as_vec3(),
            is_sampled,
        }
    }
}

/// What `follow` finds of the `count` photons of pass number `pass`, one after the other; `None`
/// where `interrupted`.
#[cfg(any(feature = "caustics", feature = "media"))]
pub(crate) fn emitted<T: Send>(
    scene: &ReferenceScene,
    settings: &Settings,
    seed: u64,
    [pass, count]: [u32; 2],
    interrupted: &(dyn Fn() -> bool + Sync),
    follow: impl Fn(Flight, &mut Sampler, &mut Vec<T>) + Sync,
) -> Option<Vec<T>> {
    use rayon::prelude::*;
    let Some(emission) = Emission::new(scene, settings) else { return Some(Vec::new()) };
    let photon = |mut found: Vec<T>, photon: u32| {
        let mut sampler = Sampler::new(seed, u64::from(pass), photon);
        let (choice, [a, b], [c, d]) = (sampler.number(), sampler.pair(), sampler.pair());
        if let Some(flight) = emission.emit(&[choice, a, b, c, d]) {
            follow(flight, &mut sampler, &mut found);
        }
        (!interrupted()).then_some(found)
    };
    let joined = |mut all: Vec<T>, more: Vec<T>| {
        all.extend(more);
        Some(all)
    };
    (0..count).into_par_iter().try_fold(Vec::new, photon).try_reduce(Vec::new, joined)
}

/// Cosine of a spot light's outer angle; −1 without a cone.
fn least_cosine((scale, offset): (f64, f64)) -> f64 {
    if scale > 0.0 { (-offset / scale).max(-1.0) } else { -1.0 }
}
