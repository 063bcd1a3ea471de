//! Estimated costs of settings, by address, from nearby cameras: kernel regression (Nadaraya 1964, Watson
//! 1964).
//!
//! A rendered camera predicts costs of views metres and tens of degrees away. Errors are averaged
//! without a logarithm: budgets limit their arithmetic mean, which a mean of logarithms underestimates
//! the more views differ.

use std::collections::BTreeMap;

use frugal_core::frontier::{Address, Bounds, CameraView, CostPoint, Leaf, address_in};
use glam::{Quat, Vec3};

use super::training::{Estimate, Training};

/// Prior weight of the shared estimate, in cameras at the exact viewpoint.
const SHARED_WEIGHT: f64 = 0.1;

/// Unit of distance between viewpoints: metres, and radians of rotation, per step. A camera's weight falls
/// to 1/e with each step: higher values average more cameras, which keeps more error budgets; lower
/// values tell views apart better where cameras are dense.
const STEP: (f32, f32) = (2.0, 0.7);

/// A camera's position and direction.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Viewpoint {
    position: Vec3,
    forward: Vec3,
}

impl Viewpoint {
    fn new(position: Vec3, rotation: Quat) -> Self {
        Self { position, forward: rotation * Vec3::NEG_Z }
    }

    /// Distance of two viewpoints in steps; infinite instead of NaN.
    fn steps(&self, other: &Self) -> f32 {
        let metres = self.position.distance(other.position) / STEP.0;
        let turn = self.forward.angle_between(other.forward) / STEP.1;
        if (metres + turn).is_finite() { metres + turn } else { f32::INFINITY }
    }
}

/// Each camera's address at every depth of a uniformly divided octree.
pub(super) struct Keys {
    /// By depth, then by camera.
    pub addresses: Vec<Vec<Address>>,
    /// Position of each camera, normalised to the bounds.
    pub positions: Vec<Vec3>,
    viewpoints: Vec<Viewpoint>,
    bounds: Bounds,
    levels: u8,
}

impl Keys {
    /// Addresses of `views` in an octree of up to `levels` levels over `bounds`.
    pub(super) fn new(bounds: &Bounds, levels: u8, views: &[CameraView]) -> Self {
        let positions: Vec<_> = views.iter().map(|view| bounds.to_unit(view.position)).collect();
        let at_depth = |depth: u8| {
            let leaves = positions.iter().map(|position| leaf_at(levels, depth, *position));
            let all = leaves.zip(views);
            all.map(|(leaf, view)| address_in(bounds, levels, leaf, view)).collect()
        };
        let addresses = (0..=levels).map(at_depth).collect();
        let viewpoints =
            views.iter().map(|view| Viewpoint::new(view.position, view.rotation)).collect();
        Self { addresses, positions, viewpoints, bounds: *bounds, levels }
    }

    /// The viewpoint that an address stands for.
    fn viewpoint(&self, address: Address) -> Viewpoint {
        let unit = Vec3::from_array(address.at.map(f32::from)) / f32::from(1_u16 << self.levels);
        Viewpoint::new(self.bounds.from_unit(unit), address.direction.rotation())
    }
}

/// The cube at depth `depth` that contains `position`.
pub(super) fn leaf_at(levels: u8, depth: u8, position: Vec3) -> Leaf {
    let (lattice, size) = (1_u16 << levels, 1_u16 << (levels - depth));
    let min = position
        .to_array()
        .map(|unit| (((unit * f32::from(lattice)) as u16).min(lattice - 1) / size) * size);
    Leaf { min, size }
}

/// Estimates at every depth from a subset of the cameras: shared, and for each
/// address with cameras.
pub(super) struct Pyramid<'a> {
    training: &'a Training,
    keys: &'a Keys,
    cameras: Vec<usize>,
    /// The mean over all of them.
    pub shared: Estimate,
    /// Cameras at each address, by depth.
    members: Vec<BTreeMap<Address, Vec<usize>>>,
}

impl<'a> Pyramid<'a> {
    pub(super) fn new(training: &'a Training, keys: &'a Keys, cameras: Vec<usize>) -> Self {
        let of_depth = |addresses: &Vec<Address>| {
            let mut members: BTreeMap<Address, Vec<usize>> = BTreeMap::new();
            cameras
                .iter()
                .for_each(|camera| members.entry(addresses[*camera]).or_default().push(*camera));
            members
        };
        let members = keys.addresses.iter().map(of_depth).collect();
        Self { training, keys, shared: training.mean(&cameras), cameras, members }
    }

    /// The estimate at an address: at the viewpoints of its cameras, or at its own where it has
    /// none.
    pub(super) fn address(&self, address: Address, depth: usize) -> Estimate {
        match self.members[depth].get(&address) {
            Some(members) => self.of_cameras(members),
            None => self.at(&[self.keys.viewpoint(address)]),
        }
    }

    /// The mean estimate at several cameras' viewpoints.
    pub(super) fn of_cameras(&self, cameras: &[usize]) -> Estimate {
        let viewpoint = |camera: &usize| self.keys.viewpoints[*camera];
        self.at(&cameras.iter().map(viewpoint).collect::<Vec<_>>())
    }

    /// Mean costs at `viewpoints`, shrunk towards the shared ones.
    fn at(&self, viewpoints: &[Viewpoint]) -> Estimate {
        let count = viewpoints.len().max(1) as f64;
        let mut sums = vec![0.0; self.cameras.len()];
        for viewpoint in viewpoints {
            for (sum, camera) in sums.iter_mut().zip(&self.cameras) {
                let steps = viewpoint.steps(&self.keys.viewpoints[*camera]);
                *sum += f64::from((-steps).exp()) / count;
            }
        }
        let weight = sums.iter().sum();
        let all = self.cameras.iter().zip(sums);
        let weights: Vec<(&[CostPoint], f64)> = all
            .filter(|(_, weight)| *weight > 1e-4)
            .map(|(camera, weight)| (self.training.costs(*camera), weight))
            .collect();
        let total = SHARED_WEIGHT + weights.iter().map(|(_, weight)| weight).sum::<f64>();
        let mean = |setting: usize, value: fn(&CostPoint) -> f64| {
            let sum: f64 =
                weights.iter().map(|(costs, weight)| weight * value(&costs[setting])).sum();
            (sum + SHARED_WEIGHT * value(&self.shared.costs[setting])) / total
        };
        let blend = |setting: usize| {
            let power = mean(setting, |cost| cost.power.0.max(1e-9).ln()).exp();
            CostPoint::new(power, mean(setting, |cost| cost.error))
        };
        Estimate { costs: (0..self.shared.costs.len()).map(blend).collect(), weight }
    }

    /// Mean difference of estimates at depth `finer` from those of `depth`, over `cameras` and
    /// settings.
    pub(super) fn distance(&self, cameras: &[usize], depth: usize, finer: usize) -> CostPoint {
        let (mut power, mut error, mut count) = (0.0, 0.0, 0.0_f64);
        for camera in cameras {
            let at = |depth: usize| self.address(self.keys.addresses[depth][*camera], depth);
            for (coarse, fine) in at(depth).costs.iter().zip(&at(finer).costs) {
                power += (coarse.power.0 - fine.power.0).abs();
                error += (coarse.error - fine.error).abs();
                count += 1.0;
            }
        }
        CostPoint::new(power / count.max(1.0), error / count.max(1.0))
    }
}
