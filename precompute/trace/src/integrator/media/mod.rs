//! Radiance along one path through fog. `vertex` is a point of a path, on a surface or in fog, and
//! the light that reaches it.
//!
//! Lafortune and Willems 1996, "Rendering Participating Media with Bidirectional Path Tracing", from
//! the camera alone: distances by transmittance, scattering by the phase function, next-event
//! estimation at every vertex and, for each light, at one more distance of every ray. Paths are not
//! guided here.

mod vertex;

use glam::{DVec3, Vec3};

use super::path::{Arrival, CERTAIN_SURFACES, Estimate, GREATEST_SURVIVAL, Record, per_steradian};
use super::{ReferenceScene, Settings};
use crate::bsdf::{Bsdf, Surface};
use crate::media::{CHANNELS, Fog, Line};
use crate::sampler::Sampler;
use vertex::{Vertex, along};

/// The last vertex, and the density with which it sampled the direction of the path.
type Last = Option<(Vertex, f64)>;

/// Traces a path from `origin`, metres, in `direction`, a unit vector. Fog scatters as a surface
/// does: an event of `Estimate`, of `Arrival` and of `settings.bounces` is either.
pub(super) fn trace(
    scene: &ReferenceScene,
    fog: &Fog,
    settings: &Settings,
    (mut origin, mut direction): (Vec3, DVec3),
    sampler: &mut Sampler,
    record: &mut impl Record,
) -> Estimate {
    let mut estimate = Estimate::default();
    // Metres from the camera ray's start: to this ray's start, and to the first event.
    let (mut length, mut first) = (0.0, 0.0);
    let mut arrived = |light: DVec3, surfaces: u32, length: f64, last: f64| {
        if light != DVec3::ZERO {
            record.arrived(Arrival { light, surfaces, length, last, odds: 1.0 });
        }
    };
    let mut throughput = DVec3::ONE;
    let mut channels = CHANNELS;
    let mut last: Last = None;
    for events in 0.. {
        let may_scatter = settings.bounces.is_none_or(|bounces| events <= bounces);
        let hit = scene.closest(origin, direction);
        let reach = hit.map_or(f64::INFINITY, |hit| f64::from(hit.distance));
        let line = fog.line(origin.as_dvec3(), direction, reach);
        let line = line.map(|line| Line { channels, ..line });
        let mut scattered_at = None;
        if let Some(line) = line {
            if may_scatter {
                let reached = along(scene, fog, settings, line, sampler, |light, [own, rest]| {
                    let last = if events == 0 { own } else { first };
                    arrived(throughput * light, events + 1, length + own + rest, last);
                });
                estimate.add(events + 1, throughput * reached.punctual);
                estimate.add_extended(events + 1, throughput * reached.extended);
                let step = line.sample([sampler.number(), sampler.number()]);
                (scattered_at, channels) = (step.distance, step.channels);
                throughput *= step.weight;
                if scattered_at.is_some() {
                    throughput *= fog.scattering();
                }
            } else {
                throughput *= line.transmittance(line.far);
            }
        }
        if let Some(distance) = scattered_at.or(hit.map(|hit| f64::from(hit.distance))) {
            length += distance;
        }
        if events == 0 {
            first = length;
        }
        let vertex = if let (Some(distance), Some(line)) = (scattered_at, line) {
            Vertex::fog(fog, line, distance)
        } else if let Some(hit) = hit {
            let surface = Surface::new(&scene.geometry, &hit);
            if surface.emission != DVec3::ZERO {
                let weight = last.as_ref().map_or(1.0, |(vertex, own)| {
                    let ray = surface.position - vertex.position;
                    let density = scene.emitters.density(&hit);
                    let other = per_steradian(density, ray, surface.geometric_normal);
                    let techniques = 1.0 + vertex.angular(Some(surface.position));
                    settings.strategy.weight(false, *own, other * techniques)
                });
                let light = throughput * surface.emission * weight;
                estimate.add_extended(events, light);
                arrived(light, events, length, first);
            }
            let bsdf = Bsdf::new(&surface, -direction, settings.shading);
            Vertex::surface(&surface, bsdf)
        } else {
            let weight = last.as_ref().map_or(1.0, |(_, own)| {
                settings.strategy.weight(false, *own, scene.sky.density(direction))
            });
            let light = throughput * scene.sky.radiance(direction) * weight;
            estimate.add_extended(events, light);
            arrived(light, events, length, first);
            break;
        };
        if !may_scatter {
            break;
        }
        let reached = vertex.reached(scene, fog, settings, sampler, |light, rest| {
            arrived(throughput * light, events + 1, length + rest, first);
        });
        estimate.add(events + 1, throughput * reached.punctual);
        estimate.add_extended(events + 1, throughput * reached.extended);
        // Beyond the last event a path can only hit a light.
        if settings.bounces == Some(events) && !scene.has_extended_light() {
            break;
        }
        let Some((onwards, weight, density)) = vertex.sample(sampler) else { break };
        throughput *= weight;
        if settings.bounces.is_none() && events + 1 >= CERTAIN_SURFACES {
            let survival = throughput.max_element().min(GREATEST_SURVIVAL);
            if sampler.number() >= survival {
                break;
            }
            throughput /= survival;
        }
        (origin, direction) = (vertex.origin, onwards);
        last = Some((vertex, density));
    }
    estimate
}

#[cfg(test)]
mod tests;
