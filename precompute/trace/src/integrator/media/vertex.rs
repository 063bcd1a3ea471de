//! A point of a path, on a surface or in fog, and the light that reaches it from the lights.

use glam::{DVec3, Vec3};

use crate::bsdf::{Bsdf, Surface};
use crate::integrator::path::{emitter, shining, sky};
use crate::integrator::{ReferenceScene, Settings, Strategy};
use crate::light::{PunctualLight, Sampled};
use crate::media::{Equiangular, Fog, Line, density, sample};
use crate::sampler::Sampler;

/// A point of a path.
pub(super) struct Vertex {
    /// Metres.
    pub(super) position: DVec3,
    /// Where rays from it begin.
    pub(super) origin: Vec3,
    scattering: Scattering,
}

enum Scattering {
    Surface(Bsdf),
    Fog {
        /// The line on which the point is.
        line: Line,
        /// Density of its distance by transmittance.
        density: f64,
        /// Distance from the start of the line.
        distance: f64,
        asymmetry: f64,
    },
}

/// Light that reaches a vertex and is scattered on: from punctual lights, and from others.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Reached {
    pub(super) punctual: DVec3,
    pub(super) extended: DVec3,
}

/// Metres that light takes from its light to a vertex; parallel light has no place to come from.
fn way(distance: f64) -> f64 {
    if distance.is_finite() { distance } else { 0.0 }
}

impl Vertex {
    /// A point on `surface`.
    pub(super) fn surface(surface: &Surface, bsdf: Bsdf) -> Self {
        Self {
            position: surface.position,
            origin: surface.ray_origin(),
            scattering: Scattering::Surface(bsdf),
        }
    }

    /// The point of `line` at a distance from its start.
    pub(super) fn fog(fog: &Fog, line: Line, distance: f64) -> Self {
        let position = line.at(distance);
        Self {
            position,
            origin: position.as_vec3(),
            scattering: Scattering::Fog {
                line,
                density: line.density(distance),
                distance,
                asymmetry: fog.asymmetry(),
            },
        }
    }

    /// BSDF × cosine, or phase function, for light from `direction`; and the density of
    /// [`sample`](Self::sample), per steradian.
    fn evaluate(&self, direction: DVec3) -> (DVec3, f64) {
        match &self.scattering {
            Scattering::Surface(bsdf) => bsdf.evaluate(direction),
            Scattering::Fog { line, asymmetry, .. } => {
                let share = density(*asymmetry, line.direction.dot(direction));
                (DVec3::splat(share), share)
            }
        }
    }

    /// Samples a direction: with it, its weight and its density.
    pub(super) fn sample(&self, sampler: &mut Sampler) -> Option<(DVec3, DVec3, f64)> {
        match &self.scattering {
            Scattering::Surface(bsdf) => {
                let sample = bsdf.sample(sampler)?;
                Some((sample.direction, sample.weight, sample.density))
            }
            Scattering::Fog { line, asymmetry, .. } => {
                let direction = sample(*asymmetry, line.direction, sampler.pair());
                let share = density(*asymmetry, line.direction.dot(direction));
                Some((direction, DVec3::ONE, share))
            }
        }
    }

    /// Density with which [`along()`] looks for light of `point`, or of parallel light, at this
    /// distance, relative to that by transmittance; 0 on surfaces.
    pub(super) fn angular(&self, point: Option<DVec3>) -> f64 {
        match &self.scattering {
            Scattering::Fog { line, density, distance, .. } => {
                Equiangular::new(line, point).density(*distance) / density
            }
            Scattering::Surface(_) => 0.0,
        }
    }

    /// Light that reaches this point from all punctual lights, and from one point of an emissive
    /// triangle and one of the sky. `arrived` gets each one's light, and metres to the light.
    pub(super) fn reached(
        &self,
        scene: &ReferenceScene,
        fog: &Fog,
        settings: &Settings,
        sampler: &mut Sampler,
        mut arrived: impl FnMut(DVec3, f64),
    ) -> Reached {
        let mut reached = Reached::default();
        for light in &scene.lights {
            let point = place(light);
            // Along a line every light has its own distance.
            let weight = 1.0 / (1.0 + self.angular(point));
            let (light, distance) = self.punctual(scene, fog, light);
            let light = light * weight;
            reached.punctual += light;
            arrived(light, way(distance));
        }
        if settings.strategy == Strategy::Scattering {
            return reached;
        }
        let samples = [emitter(scene, self.position, sampler), sky(scene, sampler)];
        for sampled in samples.into_iter().flatten() {
            // An infinitely far light has no distance of its own along a line.
            let angular = sampled.point.map_or(0.0, |point| self.angular(Some(point)));
            let (light, other) = self.extended(scene, fog, &sampled);
            let others = angular + scattering_share(settings, other / sampled.density);
            let light = light * (1.0 / (1.0 + others));
            reached.extended += light;
            arrived(light, way(sampled.distance));
        }
        reached
    }

    /// Scattered light of a light, and its distance, metres.
    fn punctual(&self, scene: &ReferenceScene, fog: &Fog, light: &PunctualLight) -> (DVec3, f64) {
        let Some(incident) = light.incident(self.position) else { return (DVec3::ZERO, 0.0) };
        let reflected = self.evaluate(incident.direction).0 * incident.illuminance;
        if reflected.max_element() > 0.0 && scene.is_lit(self.origin, &incident) {
            let through = fog.transmittance(self.position, incident.direction, incident.distance);
            (reflected * through, incident.distance)
        } else {
            (DVec3::ZERO, 0.0)
        }
    }

    /// Scattered light of a sampled one ÷ its density, and the density of [`sample`](Self::sample).
    fn extended(&self, scene: &ReferenceScene, fog: &Fog, sampled: &Sampled) -> (DVec3, f64) {
        let Sampled { direction, distance, radiance, density, .. } = *sampled;
        let (reflected, other) = self.evaluate(direction);
        let light = reflected * radiance / density;
        let is_seen =
            light.max_element() > 0.0 && scene.is_unoccluded(self.origin, direction, distance);
        let through = || fog.transmittance(self.position, direction, distance);
        (if is_seen { light * through() } else { DVec3::ZERO }, other)
    }
}

/// Light that fog scatters once towards the start of `line`: with distances of each light's own,
/// and weights for [`Vertex::reached`] at a distance by transmittance. `arrived` gets each one's
/// light, and metres from the line's start to where it is scattered and from there to the light.
pub(super) fn along(
    scene: &ReferenceScene,
    fog: &Fog,
    settings: &Settings,
    line: Line,
    sampler: &mut Sampler,
    mut arrived: impl FnMut(DVec3, [f64; 2]),
) -> Reached {
    let mut reached = Reached::default();
    if !line.scatters {
        return reached;
    }
    let at = |point: Option<DVec3>, sampler: &mut Sampler| {
        let distances = Equiangular::new(&line, point);
        let distance = distances.sample(sampler.number()).clamp(line.near, line.far);
        let own = distances.density(distance);
        let scattered = line.transmittance(distance) * fog.scattering() / own;
        (Vertex::fog(fog, line, distance), distance, own, line.density(distance), scattered)
    };
    for light in &scene.lights {
        let (vertex, distance, own, by_distance, scattered) = at(place(light), sampler);
        let weight = own / (own + by_distance);
        let (light, rest) = vertex.punctual(scene, fog, light);
        let light = scattered * light * weight;
        reached.punctual += light;
        arrived(light, [distance, way(rest)]);
    }
    if settings.strategy == Strategy::Scattering || scene.emitters.is_empty() {
        return reached;
    }
    let (choice, pair) = (sampler.number(), sampler.pair());
    if let Some(point) = scene.emitters.sample(choice, pair) {
        let (vertex, distance, own, by_distance, scattered) = at(Some(point.position), sampler);
        if let Some(sampled) = shining(scene, &point, vertex.position) {
            let (light, other) = vertex.extended(scene, fog, &sampled);
            let others = by_distance * (1.0 + scattering_share(settings, other / sampled.density));
            let light = scattered * light * (own / (own + others));
            reached.extended += light;
            arrived(light, [distance, sampled.distance]);
        }
    }
    reached
}

/// The density of sampling by scattering, where the strategy uses it.
fn scattering_share(settings: &Settings, density: f64) -> f64 {
    if settings.strategy == Strategy::Lights { 0.0 } else { density }
}

/// Where a light is; none for parallel light.
fn place(light: &PunctualLight) -> Option<DVec3> {
    match light {
        PunctualLight::Directional { .. } => None,
        PunctualLight::Positional { position, .. } => Some(*position),
    }
}
