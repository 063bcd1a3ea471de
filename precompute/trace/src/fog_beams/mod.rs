//! Light in fog from beams: photons' straight ways through it.
//!
//! Jarosz et al. 2011, "Progressive Photon Beams", also chapter 6 of Marco's thesis: a
//! camera's ray sees every beam that passes within a radius, which shrinks from pass to pass. Beams
//! find light that mirrors throw into fog, which paths from the camera find by luck. A `Record`
//! is told how far the light of each went.

use std::sync::{Mutex, PoisonError};

use glam::{DVec3, UVec2};

use crate::bsdf::{Bsdf, Surface};
use crate::color::luminance;
use crate::integrator::path::{Arrival, GREATEST_SURVIVAL, Record};
use crate::integrator::photons::{Flight, emitted};
use crate::integrator::{ReferenceScene, Settings, View, Watch};
use crate::media::{CHANNELS, Fog, Line, density, sample};
use crate::metrics::Radiance;
use crate::sampler::Sampler;

/// Share of a pass's radius that the next one keeps, in the limit of many: error² falls fastest, as
/// passes^(−4/5), where variance, ∝ 1/radius, and squared bias, ∝ radius⁴, fall alike.
const ALPHA: f64 = 0.8;
/// Beams that are tested for all pixels of a tile rather than sorted into smaller tiles.
const FEW: usize = 8;

/// Light on a straight way through fog.
struct Beam {
    flight: Flight,
    line: Line,
    /// Its ends, seen from the eye, metres.
    ends: [DVec3; 2],
    /// Unit normal of the plane through eye and beam; 0 where the eye is in line with it.
    normal: DVec3,
    /// Least distance from the eye, metres.
    distance: f64,
}

impl Beam {
    fn new(flight: Flight, line: Line, eye: DVec3) -> Self {
        let ends = [line.at(line.near) - eye, line.at(line.far) - eye];
        let along = (-ends[0].dot(line.direction)).clamp(0.0, line.far - line.near);
        Self {
            flight,
            line,
            ends,
            normal: ends[0].cross(ends[1]).normalize_or_zero(),
            distance: (ends[0] + line.direction * along).length(),
        }
    }

    /// Light that it sends towards the start of `ray`, nits: equation 6.15 of Marco's thesis, with
    /// Epanechnikov's kernel; and metres along the beam and along the ray to where they meet. `None`
    /// for a ray parallel to it, which others meet with no chance.
    fn seen(&self, fog: &Fog, ray: &Line, radius: f64) -> Option<(DVec3, [f64; 2])> {
        let cross = ray.direction.cross(self.line.direction);
        let sine = cross.length();
        let between = self.line.origin - ray.origin;
        let apart = between.dot(cross).abs() / sine;
        // False for NaN, too.
        let is_near = apart < radius;
        if !is_near {
            return None;
        }
        let cosine = ray.direction.dot(self.line.direction);
        let (a, b) = (between.dot(ray.direction), between.dot(self.line.direction));
        let (eye, light) = ((a - cosine * b) / (sine * sine), (cosine * a - b) / (sine * sine));
        let is_on = |line: &Line, at: f64| at > line.near && at < line.far;
        if !is_on(ray, eye) || !is_on(&self.line, light) {
            return None;
        }
        let kernel = 0.75 * (1.0 - (apart / radius).powi(2)) / radius;
        let through = ray.transmittance(eye) * self.line.transmittance(light);
        let arriving = self.flight.arriving(self.line.at(light));
        let share = kernel * density(fog.asymmetry(), -cosine) / sine;
        Some((arriving * fog.scattering() * through * share, [light, eye]))
    }
}

/// Light, nits, that fog scatters towards the camera, in `view`: `settings.samples` passes of
/// `photons` photons each. Light that surfaces send to the camera is left out, and `settings.guide`
/// and `settings.strategy` are not used. `radius`, metres, is that of the first pass: edges are
/// blurred by it, and less by later ones. `None` without fog, for a radius that is not above 0 and
/// finite, and where `watch` interrupts.
///
/// Parallel light comes only through a ball around the scene's geometry.
pub fn render(
    scene: &ReferenceScene,
    view: &View,
    settings: &Settings,
    photons: u32,
    radius: f64,
    watch: Watch,
) -> Option<Radiance> {
    recorded(scene, view, settings, photons, radii(radius), watch, &|| ()).map(|(image, _)| image)
}

/// Radii of the passes of an image without time.
pub(crate) fn radii(first: f64) -> impl Iterator<Item = f64> {
    (0..).scan(first, |radius, pass| {
        let own = *radius;
        *radius *= (f64::from(pass) + 1.0 + ALPHA) / (f64::from(pass) + 2.0);
        Some(own)
    })
}

/// The same image with passes of other radii, and a record of each pixel, row by row. It is told of
/// each pass as of a path; the number of surfaces is not known.
pub(crate) fn recorded<R: Record + Send>(
    scene: &ReferenceScene,
    view: &View,
    settings: &Settings,
    photons: u32,
    radii: impl Iterator<Item = f64>,
    watch: Watch,
    record: &dyn Fn() -> R,
) -> Option<(Radiance, Vec<R>)> {
    let fog = scene.fog.as_ref()?;
    let UVec2 { x: width, y: height } = view.size;
    let count = width as usize * height as usize;
    let mut sums = vec![DVec3::ZERO; count];
    let records: Vec<_> = (0..count).map(|_| Mutex::new(record())).collect();
    let eye = view.pose.position.as_dvec3();
    let follow = |flight, sampler: &mut Sampler, found: &mut Vec<Beam>| {
        walk(flight, scene, fog, settings, sampler, |flight, line| {
            found.push(Beam::new(flight, line, eye));
        });
    };
    for (pass, radius) in (0..settings.samples).zip(radii) {
        if !(radius > 0.0 && radius.is_finite()) {
            return None;
        }
        let (seed, numbers) = (settings.seed, [pass, photons]);
        let beams = emitted(scene, settings, seed, numbers, watch.interrupted, follow)?;
        let share = 1.0 / f64::from(photons.max(1));
        let (beams, records) = (&beams, &records);
        let image = Pass { scene, view, settings, fog, beams, records, share, pass, radius };
        for (pixel, light) in
            image.tile([0, 0], [width, height], &(0..beams.len()).collect::<Vec<_>>())
        {
            sums[pixel] += light;
        }
        (watch.row_done)();
    }
    let mean = |sum: &DVec3| (*sum / f64::from(settings.samples.max(1))).as_vec3().to_array();
    let rgb = sums.iter().map(mean).collect();
    let inner = |record: Mutex<R>| record.into_inner().unwrap_or_else(PoisonError::into_inner);
    Some((Radiance { width, height, rgb }, records.into_iter().map(inner).collect()))
}

/// One pass over all pixels.
struct Pass<'a, R> {
    scene: &'a ReferenceScene,
    view: &'a View,
    settings: &'a Settings,
    fog: &'a Fog,
    beams: &'a [Beam],
    /// Of each pixel. Tiles share none, so that none waits.
    records: &'a [Mutex<R>],
    /// 1 ÷ number of photons.
    share: f64,
    pass: u32,
    radius: f64,
}

impl<R: Record + Send> Pass<'_, R> {
    /// Light of the pixels from `least` to `most`, from some beams.
    fn tile(&self, least: [u32; 2], most: [u32; 2], beams: &[usize]) -> Vec<(usize, DVec3)> {
        let near = self.near(least, most, beams);
        let size = [most[0] - least[0], most[1] - least[1]];
        if near.is_empty() {
            return Vec::new();
        }
        if near.len() <= FEW || size == [1, 1] {
            let pixels = (least[1]..most[1]).flat_map(|y| (least[0]..most[0]).map(move |x| [x, y]));
            return pixels.map(|at| self.pixel(at, &near)).collect();
        }
        let axis = usize::from(size[1] > size[0]);
        let middle = least[axis] + size[axis] / 2;
        let (mut end, mut start) = (most, least);
        (end[axis], start[axis]) = (middle, middle);
        let (mut low, high) =
            rayon::join(|| self.tile(least, end, &near), || self.tile(start, most, &near));
        low.extend(high);
        low
    }

    /// The beams that may be within the radius of a tile's rays: not those that are beyond one of
    /// its sides, and not those of whose plane through the eye all its rays are on one side.
    fn near(&self, least: [u32; 2], most: [u32; 2], beams: &[usize]) -> Vec<usize> {
        let [left, top, right, bottom] = [least[0], least[1], most[0], most[1]].map(f64::from);
        let corners = [[left, top], [right, top], [right, bottom], [left, bottom]]
            .map(|[x, y]| self.view.ray(x, y).1);
        let middle: DVec3 = corners.iter().sum();
        let sides: [DVec3; 4] = std::array::from_fn(|side| {
            let normal = corners[side].cross(corners[(side + 1) % 4]).normalize_or_zero();
            if normal.dot(middle) > 0.0 { -normal } else { normal }
        });
        let radius = self.radius;
        let is_near = |beam: &Beam| {
            let beyond = |side: &DVec3| beam.ends.iter().all(|end| end.dot(*side) > radius);
            let [a, b, c, d] = corners.map(|corner| corner.dot(beam.normal));
            let apart = a.min(b).min(c).min(d).max(-a.max(b).max(c).max(d));
            (beam.distance - radius) * apart <= radius && !sides.iter().any(beyond)
        };
        beams.iter().copied().filter(|index| is_near(&self.beams[*index])).collect()
    }

    fn pixel(&self, at: [u32; 2], beams: &[usize]) -> (usize, DVec3) {
        let index = at[1] * self.view.size.x + at[0];
        let mut sampler = Sampler::new(!self.settings.seed, u64::from(index), self.pass);
        let (origin, direction) = self.view.sampled_ray(self.settings.pixels, at, &mut sampler);
        let hit = self.scene.closest(origin, direction);
        let reach = hit.map_or(f64::INFINITY, |hit| f64::from(hit.distance));
        let line = self.fog.line(origin.as_dvec3(), direction, reach);
        let mut record =
            self.records[index as usize].lock().unwrap_or_else(PoisonError::into_inner);
        record.begin(origin.as_dvec3().distance(self.view.pose.position.as_dvec3()));
        let mut sum = DVec3::ZERO;
        for beam in beams.iter().map(|beam| &self.beams[*beam]) {
            let seen = line.and_then(|line| beam.seen(self.fog, &line, self.radius));
            let Some((light, [way, last])) = seen else { continue };
            let (light, flight) = (light * self.share, &beam.flight);
            let length = flight.length + flight.pace * way + last;
            sum += light;
            record.arrived(Arrival { light, surfaces: 1, length, last, odds: 1.0 });
        }
        let is_finite = sum.as_vec3().is_finite();
        record.end(is_finite);
        let light = if is_finite { sum } else { DVec3::ZERO };
        (index as usize, light)
    }
}

/// Follows one photon, and calls `found` with its ways through fog that scatters.
fn walk(
    mut flight: Flight,
    scene: &ReferenceScene,
    fog: &Fog,
    settings: &Settings,
    sampler: &mut Sampler,
    mut found: impl FnMut(Flight, Line),
) {
    let mut channels = CHANNELS;
    for events in 0.. {
        let hit = scene.closest(flight.origin, flight.direction);
        let reach = hit.map_or(f64::INFINITY, |hit| f64::from(hit.distance));
        let line = fog.line(flight.origin.as_dvec3(), flight.direction, reach);
        let line = line.map(|line| Line { channels, ..line });
        if let Some(line) = line.filter(|line| line.scatters) {
            found(flight, line);
        }
        if settings.bounces.is_some_and(|bounces| events >= bounces) {
            return;
        }
        let step = line.map(|line| line.sample([sampler.number(), sampler.number()]));
        channels = step.map_or(channels, |step| step.channels);
        let distance = step.and_then(|step| step.distance);
        let through = step.map_or(DVec3::ONE, |step| step.weight);
        let way = distance.or(hit.map(|hit| f64::from(hit.distance))).unwrap_or_default();
        let (origin, direction, power) = if let (Some(line), Some(distance)) = (line, distance) {
            let point = line.at(distance);
            let direction = sample(fog.asymmetry(), flight.direction, sampler.pair());
            (point.as_vec3(), direction, flight.arriving(point) * fog.scattering() * through)
        } else {
            let Some(hit) = hit else { return };
            let surface = Surface::new(&scene.geometry, &hit);
            let towards = -flight.direction;
            let bsdf = Bsdf::new(&surface, towards, settings.shading);
            let Some(next) = bsdf.sample(sampler) else { return };
            // As a path from the camera would be reflected. Veach 1997, "Robust Monte Carlo Methods
            // for Light Transport Simulation", section 5.3: light's cosines are the geometric ones.
            let reflected =
                Bsdf::new(&surface, next.direction, settings.shading).evaluate(towards).0;
            let [leaving, arriving] =
                [next.direction, towards].map(|way| way.dot(surface.geometric_normal).abs());
            let weight = reflected * (leaving / (arriving * next.density));
            (
                surface.ray_origin(),
                next.direction,
                flight.arriving(surface.position) * through * weight,
            )
        };
        let survival = (luminance(power) / luminance(flight.power)).min(GREATEST_SURVIVAL);
        // False for NaN, too.
        let survives = sampler.number() < survival;
        if !survives {
            return;
        }
        (flight.origin, flight.direction, flight.power) = (origin, direction, power / survival);
        (flight.length, flight.pace) = (flight.length + flight.pace * way, 1.0);
        flight.inverse_range_squared = 0.0;
    }
}

#[cfg(test)]
mod tests;
