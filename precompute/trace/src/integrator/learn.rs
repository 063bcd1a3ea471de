//! What a guide learns from photons before an image.

use std::collections::HashSet;

use glam::Vec3;
use rayon::prelude::*;

use super::gain::gain;
use super::photons::{Emission, Start};
use super::{ReferenceScene, Settings, View};
use crate::bsdf::{Bsdf, Surface};
use crate::guide::{Field, Photon, cube};
use crate::sampler::Sampler;

/// Photons per path of the image, and limits to their number: memory, and what is worth a pass.
const PHOTONS_PER_PATH: f64 = 0.045;
const FEWEST_PHOTONS: f64 = 8192.0;
const MOST_PHOTONS: f64 = 4_194_304.0;
/// Most rounds of photons from anywhere, and the part of a round's photons that must have been useful
/// for none to follow: light through a small hole is found by few.
const MOST_ROUNDS: u64 = 8;
const USEFUL: f64 = 0.125;
/// Photons that are traced one after the other.
const CHAIN: u32 = 1024;
/// About how many paths find out which places the image depends on.
const PILOT_PATHS: u32 = 1 << 13;
/// Least gain that a guide must promise: cones take time, too, which the number of surfaces does not
/// show.
const LEAST_GAIN: f64 = 1.1;
/// Surfaces along a pilot path.
const PILOT_SURFACES: u32 = 4;
/// Places are cubes; so many fit into the scene's diagonal.
const CUBES: f32 = 64.0;
/// Random numbers that are not those of the image.
const SEED: u64 = 0x9e37_79b9_7f4a_7c15;
/// Chance of a photon that owes nothing to the last one.
const FRESH: f64 = 0.3;

/// Learns a field from photons, whose order it may change.
pub(super) type Kind = fn(&mut [Photon]) -> Field;
/// All kinds of fields.
pub(super) const KINDS: [Kind; 2] = [Field::spheres, Field::histograms];

/// Learns where light comes from at the places that `view` depends on, as that of `kinds` which a
/// few paths show to gain most. The outer `None` where
/// `interrupted`, the inner one where there is nothing to learn, or where it would not pay.
///
/// The image's own paths teach nothing, so that its samples are independent of the guide.
pub(super) fn learn(
    scene: &ReferenceScene,
    view: &View,
    settings: &Settings,
    kinds: &[Kind],
    interrupted: &(dyn Fn() -> bool + Sync),
) -> Option<Option<Field>> {
    #[cfg(feature = "media")]
    if scene.fog.is_some() {
        return Some(None);
    }
    let Some(emission) = Emission::new(scene, settings) else { return Some(None) };
    let settings = Settings { seed: settings.seed.wrapping_add(SEED), ..*settings };
    let places = Places::new(scene, view, &settings);
    let paths = f64::from(view.size.element_product()) * f64::from(settings.samples);
    let count = (paths * PHOTONS_PER_PATH).clamp(FEWEST_PHOTONS, MOST_PHOTONS);
    let chains = (0.5 * count / f64::from(CHAIN)).ceil() as u64;
    // What gains most, and how much; NaN is no gain.
    let best = |photons: &mut [Photon]| {
        let told = kinds.iter().map(|learn| {
            let field = learn(photons);
            (gain(scene, view, &settings, &field).max(0.0), field)
        });
        told.max_by(|one, other| one.0.total_cmp(&other.0))
    };
    // Some photons start anywhere, the others near starts whose light was useful: in
    // both, each useful start is as likely as any other.
    let mut all = Found::default();
    for round in 0..=MOST_ROUNDS {
        let enough = all.photons.len().max(all.lit) as f64 > USEFUL * 0.5 * count;
        // Where light is found at once, half of the photons tell whether the others would pay.
        if enough && round == 1 && best(&mut all.photons).is_none_or(|(gain, _)| gain < 1.0) {
            return Some(None);
        }
        let is_last = enough || round == MOST_ROUNDS;
        let near = if is_last { all.starts.as_slice() } else { &[] };
        let found: Vec<Found> = (0..chains)
            .into_par_iter()
            .map(|chain| {
                let pixel = round * chains + chain;
                (!interrupted()).then(|| {
                    let first = near.get((chain as usize * near.len()) / chains as usize);
                    trace_chain(&emission, &places, Sampler::new(settings.seed, pixel, 0), first)
                })
            })
            .collect::<Option<_>>()?;
        for found in found {
            all.lit += found.lit;
            all.starts.extend(found.starts);
            all.photons.extend(found.photons);
        }
        if is_last {
            break;
        }
    }
    let best = if all.photons.is_empty() { None } else { best(&mut all.photons) };
    Some(best.filter(|(gain, _)| *gain > LEAST_GAIN).map(|(_, field)| field))
}

/// What a chain of photons found.
#[derive(Default)]
struct Found {
    /// Photons that lit a place straight from a light.
    lit: usize,
    starts: Vec<Start>,
    photons: Vec<Photon>,
}

/// Traces photons, each near the last one whose light was useful (Hachisuka and Jensen 2011, "Robust
/// Adaptive Photon Tracing Using Photon Path Visibility"); with no such `first` one, all anywhere.
fn trace_chain(
    emission: &Emission,
    places: &Places,
    mut sampler: Sampler,
    first: Option<&Start>,
) -> Found {
    let mut found = Found::default();
    let mut last = first.copied();
    // Photons of the last useful start, which count again when the next one is not useful.
    let mut held: Vec<Photon> = Vec::new();
    let mut times = 0.0;
    for _ in 0..CHAIN {
        let fresh = last.is_none_or(|_| sampler.number() < FRESH);
        let scale = 0.5_f64.powf(1.0 + 9.0 * sampler.number());
        let start: Start = std::array::from_fn(|i| {
            let number = sampler.number();
            match last {
                Some(last) if !fresh => {
                    (last[i] + (number - 0.5) * scale).rem_euclid(1.0).min(1.0 - f64::EPSILON)
                }
                _ => number,
            }
        });
        let mut arrived = Vec::new();
        emission.trace(&start, &mut sampler, |photon, is_sampled| {
            if places.contain(photon.position, photon.normal) {
                if is_sampled {
                    found.lit += 1;
                } else {
                    arrived.push(photon);
                }
            }
        });
        if first.is_none() {
            if !arrived.is_empty() {
                found.starts.push(start);
            }
            found.photons.append(&mut arrived);
        } else if arrived.is_empty() {
            times += 1.0;
        } else {
            found.keep(&mut held, times);
            (held, times, last) = (arrived, 1.0, Some(start));
        }
    }
    found.keep(&mut held, times);
    found
}

impl Found {
    fn keep(&mut self, photons: &mut Vec<Photon>, times: f32) {
        let weighed = |photon: Photon| Photon { power: photon.power * times, ..photon };
        self.photons.extend(photons.drain(..).map(weighed));
    }
}

/// Places where the paths of an image have surfaces.
struct Places {
    cubes: HashSet<[i32; 4]>,
    /// Metres.
    side: f32,
}

impl Places {
    fn new(scene: &ReferenceScene, view: &View, settings: &Settings) -> Self {
        let bounds = scene.geometry.bounds();
        let diagonal = bounds.map_or(0.0, |bounds| (bounds.max - bounds.min).length());
        let mut places = Self { cubes: HashSet::new(), side: diagonal / CUBES };
        places.cubes = (0..PILOT_PATHS)
            .into_par_iter()
            .flat_map_iter(|path| {
                let sampler = Sampler::new(settings.seed, u64::from(path / 256), path % 256);
                follow_pilot(scene, view, settings, sampler)
            })
            .map(|(position, normal)| cube(position, normal, places.side))
            .collect();
        places
    }

    fn contain(&self, position: Vec3, normal: Vec3) -> bool {
        self.cubes.contains(&cube(position, normal, self.side))
    }
}

/// Positions and normals of the surfaces of a path from anywhere in the image.
fn follow_pilot(
    scene: &ReferenceScene,
    view: &View,
    settings: &Settings,
    mut sampler: Sampler,
) -> Vec<(Vec3, Vec3)> {
    let mut surfaces = Vec::new();
    let [x, y] = sampler.pair();
    let size = view.size.as_dvec2();
    let (mut origin, mut direction) = view.ray(x * size.x, y * size.y);
    for _ in 0..PILOT_SURFACES {
        let Some(hit) = scene.closest(origin, direction) else { break };
        let surface = Surface::new(&scene.geometry, &hit);
        surfaces.push((surface.position.as_vec3(), surface.geometric_normal.as_vec3()));
        let bsdf = Bsdf::new(&surface, -direction, settings.shading);
        let Some(sample) = bsdf.sample(&mut sampler) else { break };
        (origin, direction) = (surface.ray_origin(), sample.direction);
    }
    surfaces
}
