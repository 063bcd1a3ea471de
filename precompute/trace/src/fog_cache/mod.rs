//! A cache of the light that emissive surfaces send into fog.
//!
//! Marco et al. 2018, "Second-Order Occlusion-Aware Volumetric Radiance Caching": records hold
//! light and its gradient at a point; the Hessian says how far they hold. Derivatives see
//! occluders, since neighbouring rays are joined to triangles. Single scattering only, evenly in
//! all directions; light of punctual lights, of the sky and of lit surfaces is left out.
//!
//! | module | job |
//! |---|---|
//! | `jet` | derivatives of triangles' form factors and of transmittance |
//! | `record` | light, derivatives and region of one record |

mod jet;
mod record;

use glam::{DVec3, UVec2};
use rayon::prelude::*;

use crate::integrator::{ReferenceScene, View};
use crate::metrics::Radiance;
use crate::scene::Bounds;
use record::{Record, record};

/// Cells of the look-up grid along each axis.
const CELLS: usize = 16;

/// Shape of the region in which a record is used.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Shape {
    /// An ellipsoid, with a radius for each eigenvalue of the Hessian.
    #[default]
    Anisotropic,
    /// A ball, of the least radius of that ellipsoid.
    Isotropic,
}

/// How records are made and used.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CacheSettings {
    /// Rays of a record: 2 × `rings`², and half as many to points of lights; at least 2.
    pub rings: u32,
    /// Relative error of a record times volume, ε of equation 2.22, m³, above 0. In a room twice as
    /// long, eight times as much gives as many records, with twice the `radii`.
    pub tolerance: f64,
    /// Least and greatest radius of a record, metres, above 0.
    pub radii: [f64; 2],
    /// Step along camera rays, metres, above 0.
    pub step: f64,
    /// Shape of regions.
    pub shape: Shape,
    /// Seed of the random numbers.
    pub seed: u64,
}

impl Default for CacheSettings {
    fn default() -> Self {
        // A smaller region would hold one step alone; a greater one is that of a whole room.
        let radii = [0.2, 2.0];
        Self { rings: 24, tolerance: 1e-2, radii, step: 0.1, shape: Shape::default(), seed: 0 }
    }
}

/// Records of the fog that a view sees.
#[derive(Debug)]
pub struct Cache {
    records: Vec<Record>,
    grid: Vec<Vec<u32>>,
    bounds: Bounds,
    settings: CacheSettings,
}

impl Cache {
    /// Makes records until all steps of all rays through pixels' centres are covered. `None` without
    /// fog, in fog that does not scatter evenly, and for settings out of range. The fog's box must
    /// hold the scene, or light outside it is dimmed as well.
    pub fn new(scene: &ReferenceScene, view: &View, settings: CacheSettings) -> Option<Self> {
        let fog = scene.fog.as_ref()?;
        let numbers = [settings.tolerance, settings.radii[0], settings.radii[1], settings.step];
        let is_valid = settings.rings >= 2
            && numbers.into_iter().all(|number| number > 0.0 && number.is_finite())
            && settings.radii[0] <= settings.radii[1];
        if !is_valid || fog.asymmetry() != 0.0 {
            return None;
        }
        let grid = vec![Vec::new(); CELLS * CELLS * CELLS];
        let mut cache = Self { records: Vec::new(), grid, bounds: fog.bounds, settings };
        // Without light every record would be in full shadow, and small.
        let pixels = if scene.emitters.is_empty() { 0 } else { view.size.element_product() };
        for pixel in 0..pixels {
            for (point, _) in cache.steps(scene, view, pixel) {
                if cache.look_up(point).is_none() {
                    let number = cache.records.len() as u64;
                    cache.insert(record(scene, fog.extinction(), point, &settings, number));
                }
            }
        }
        Some(cache)
    }

    /// Number of records.
    pub fn count(&self) -> usize {
        self.records.len()
    }

    /// Mean radiance over all directions at `point`, nits, linear RGB; equation 2.23. `None` where
    /// no record covers it.
    pub fn look_up(&self, point: DVec3) -> Option<DVec3> {
        let (mut sum, mut weights) = (DVec3::ZERO, 0.0);
        for &index in &self.grid[self.cell(point)] {
            let record = &self.records[index as usize];
            let weight = record.weight(point);
            if weight > 0.0 {
                sum += record.at(point) * weight;
                weights += weight;
            }
        }
        (weights > 0.0).then(|| sum / weights)
    }

    /// Light, nits, that the fog scatters once towards the pixels' centres of the view that the
    /// cache was made for.
    pub fn image(&self, scene: &ReferenceScene, view: &View) -> Radiance {
        let UVec2 { x: width, y: height } = view.size;
        let scattering = scene.fog.map_or(DVec3::ZERO, |fog| fog.scattering());
        let pixel = |pixel: u32| {
            let light = |(point, weight): (DVec3, DVec3)| {
                self.look_up(point).unwrap_or(DVec3::ZERO) * weight
            };
            let sum: DVec3 = self.steps(scene, view, pixel).into_iter().map(light).sum();
            (sum * scattering).as_vec3().to_array()
        };
        let rgb = (0..width * height).into_par_iter().map(pixel).collect();
        Radiance { width, height, rgb }
    }

    /// Middles of the steps of a pixel's ray through fog, and their transmittance × length, metres.
    fn steps(&self, scene: &ReferenceScene, view: &View, pixel: u32) -> Vec<(DVec3, DVec3)> {
        let (origin, direction) = view.middle_ray(pixel);
        let hit = scene.closest(origin, direction);
        let reach = hit.map_or(f64::INFINITY, |hit| f64::from(hit.distance));
        let line = scene.fog.and_then(|fog| fog.line(origin.as_dvec3(), direction, reach));
        let Some(line) = line else { return Vec::new() };
        let count = ((line.far - line.near) / self.settings.step).ceil();
        let length = (line.far - line.near) / count;
        let step = |i: u32| {
            let distance = line.near + (f64::from(i) + 0.5) * length;
            (line.at(distance), line.transmittance(distance) * length)
        };
        (0..count as u32).map(step).collect()
    }

    fn cells(&self, point: DVec3) -> [usize; 3] {
        let (min, size) = (self.bounds.min.as_dvec3(), self.bounds.size().as_dvec3());
        let share = (point - min) / size.max(DVec3::splat(1e-9)) * CELLS as f64;
        share.to_array().map(|share| (share.max(0.0) as usize).min(CELLS - 1))
    }

    fn cell(&self, point: DVec3) -> usize {
        let [x, y, z] = self.cells(point);
        (x * CELLS + y) * CELLS + z
    }

    fn insert(&mut self, record: Record) {
        // Half the extent of the ellipsoid's bounding box: the rows of the inverse metric.
        let inverse = record.metric.inverse().transpose();
        let extent =
            DVec3::new(inverse.x_axis.length(), inverse.y_axis.length(), inverse.z_axis.length());
        let from = self.cells(record.position - extent);
        let to = self.cells(record.position + extent);
        let index = self.records.len() as u32;
        for x in from[0]..=to[0] {
            for y in from[1]..=to[1] {
                for z in from[2]..=to[2] {
                    self.grid[(x * CELLS + y) * CELLS + z].push(index);
                }
            }
        }
        self.records.push(record);
    }
}

#[cfg(test)]
mod tests;
