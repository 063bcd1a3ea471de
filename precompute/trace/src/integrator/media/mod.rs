//! Radiance along one path through fog. `vertex` is a point of a path, on a surface or in fog, and
//! the light that reaches it.
//!
//! Lafortune and Willems 1996, "Rendering Participating Media with Bidirectional Path Tracing", from
//! the camera alone: distances by transmittance, scattering by the phase function, next-event
//! estimation at every vertex and, for each light, at one more distance of every ray. Paths are not
//! guided here.

mod vertex;

use glam::{DVec3, Vec3};

use super::path::{CERTAIN_SURFACES, Estimate, GREATEST_SURVIVAL, per_steradian};
use super::{ReferenceScene, Settings};
use crate::bsdf::{Bsdf, Surface};
use crate::media::Fog;
use crate::sampler::Sampler;
use vertex::{Vertex, along};

/// The last vertex, and the density with which it sampled the direction of the path.
type Last = Option<(Vertex, f64)>;

/// Traces a path from `origin`, metres, in `direction`, a unit vector. Fog scatters as a surface
/// does: an event of `Estimate` and of `settings.bounces` is either.
pub(super) fn trace(
    scene: &ReferenceScene,
    fog: &Fog,
    settings: &Settings,
    mut origin: Vec3,
    mut direction: DVec3,
    sampler: &mut Sampler,
) -> Estimate {
    let mut estimate = Estimate::default();
    let mut throughput = DVec3::ONE;
    let mut last: Last = None;
    for events in 0.. {
        let may_scatter = settings.bounces.is_none_or(|bounces| events <= bounces);
        let hit = scene.closest(origin, direction);
        let reach = hit.map_or(f64::INFINITY, |hit| f64::from(hit.distance));
        let line = fog.line(origin.as_dvec3(), direction, reach);
        let mut scattered_at = None;
        if let Some(line) = line {
            if may_scatter {
                let reached = along(scene, fog, settings, line, sampler);
                estimate.add(events + 1, throughput * reached.punctual);
                estimate.add_extended(events + 1, throughput * reached.extended);
                scattered_at = line.sample([sampler.number(), sampler.number()]);
                let through = match scattered_at {
                    Some(distance) => {
                        line.transmittance(distance) * fog.scattering() / line.density(distance)
                    }
                    None => line.transmittance(line.far) / line.survival(),
                };
                throughput *= through;
            } else {
                throughput *= line.transmittance(line.far);
            }
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
                estimate.add_extended(events, throughput * surface.emission * weight);
            }
            let bsdf = Bsdf::new(&surface, -direction, settings.shading);
            Vertex::surface(&surface, bsdf)
        } else {
            let weight = last.as_ref().map_or(1.0, |(_, own)| {
                settings.strategy.weight(false, *own, scene.sky.density(direction))
            });
            estimate.add_extended(events, throughput * scene.sky.radiance(direction) * weight);
            break;
        };
        if !may_scatter {
            break;
        }
        let reached = vertex.reached(scene, fog, settings, sampler);
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
