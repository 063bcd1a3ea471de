//! Estimated costs of settings, by address.

use std::collections::BTreeMap;

use frugal_core::frontier::{Address, Bounds, CameraView, CostPoint, Leaf, address_in};

use super::regression::Viewpoint;
use super::smooth::Smoother;
use super::training::{Estimate, Training};

/// Each camera's address at every depth of a uniformly divided octree.
#[derive(Clone, Debug)]
pub(crate) struct Keys {
    /// By depth, then by camera.
    pub addresses: Vec<Vec<Address>>,
    /// Position of each camera, normalised to the bounds.
    pub positions: Vec<glam::Vec3>,
    bounds: Bounds,
    levels: u8,
}

impl Keys {
    /// Addresses of `views` in an octree of up to `levels` levels over `bounds`.
    pub(crate) fn new(bounds: &Bounds, levels: u8, views: &[CameraView]) -> Self {
        let positions: Vec<_> = views.iter().map(|view| bounds.to_unit(view.position)).collect();
        let at_depth = |depth: u8| {
            let address = |view: &CameraView| {
                address_in(
                    bounds,
                    levels,
                    leaf_at(levels, depth, bounds.to_unit(view.position)),
                    view,
                )
            };
            views.iter().map(address).collect()
        };
        Self { addresses: (0..=levels).map(at_depth).collect(), positions, bounds: *bounds, levels }
    }

    /// The viewpoint that an address stands for.
    pub(crate) fn viewpoint(&self, address: Address) -> Viewpoint {
        let unit =
            glam::Vec3::from_array(address.at.map(f32::from)) / f32::from(1_u16 << self.levels);
        let rotation = address.direction.rotation();
        Viewpoint::from(&CameraView {
            position: self.bounds.from_unit(unit),
            rotation,
            vertical_fov: 1.0,
            aspect: 1.0,
        })
    }
}

/// The cube at depth `depth` that contains `position`.
pub(super) fn leaf_at(levels: u8, depth: u8, position: glam::Vec3) -> Leaf {
    let (lattice, size) = (1_u16 << levels, 1_u16 << (levels - depth));
    let min = position
        .to_array()
        .map(|unit| (((unit * f32::from(lattice)) as u16).min(lattice - 1) / size) * size);
    Leaf { min, size }
}

/// Estimates at every depth from a subset of the cameras: shared, and for each address with
/// cameras.
#[derive(Clone, Debug)]
pub(super) struct Pyramid<'a> {
    smoother: &'a Smoother<'a>,
    cameras: Vec<usize>,
    pub shared: Estimate,
    /// Cameras at each address, by depth.
    members: Vec<BTreeMap<Address, Vec<usize>>>,
}

impl<'a> Pyramid<'a> {
    pub(super) fn new(
        training: &Training,
        smoother: &'a Smoother<'a>,
        keys: &Keys,
        cameras: &[usize],
    ) -> Self {
        let of_depth = |addresses: &Vec<Address>| {
            let mut members: BTreeMap<Address, Vec<usize>> = BTreeMap::new();
            cameras
                .iter()
                .for_each(|camera| members.entry(addresses[*camera]).or_default().push(*camera));
            members
        };
        let members = keys.addresses.iter().map(of_depth).collect();
        let rendered: Vec<usize> =
            cameras.iter().copied().filter(|camera| *camera < training.cameras()).collect();
        Self { smoother, cameras: cameras.to_vec(), shared: training.mean(&rendered), members }
    }

    /// The estimate at an address: at the viewpoints of its cameras, or at its own where it has
    /// none.
    pub(super) fn address(&self, keys: &Keys, address: Address, depth: usize) -> Estimate {
        match self.members[depth].get(&address) {
            Some(members) => self.viewpoints(members),
            None => self.smoother.at(&[keys.viewpoint(address)], &self.cameras, &self.shared),
        }
    }

    /// The viewpoint of a camera, or of an unrendered view.
    pub(super) fn viewpoint(&self, camera: usize) -> Viewpoint {
        self.smoother.viewpoint(camera)
    }

    /// The mean estimate at several cameras' viewpoints.
    pub(super) fn viewpoints(&self, cameras: &[usize]) -> Estimate {
        let viewpoints: Vec<Viewpoint> =
            cameras.iter().map(|camera| self.viewpoint(*camera)).collect();
        self.smoother.at(&viewpoints, &self.cameras, &self.shared)
    }

    /// Mean difference of estimates at depth `finer` from those of `depth`, over `cameras` and
    /// settings.
    pub(super) fn distance(
        &self,
        keys: &Keys,
        cameras: &[usize],
        depth: usize,
        finer: usize,
    ) -> CostPoint {
        let (mut power, mut error, mut count) = (0.0, 0.0, 0.0_f64);
        for camera in cameras {
            let at = |depth: usize| self.address(keys, keys.addresses[depth][*camera], depth);
            for (coarse, fine) in at(depth).costs.iter().zip(&at(finer).costs) {
                power += (coarse.power.0 - fine.power.0).abs();
                error += (coarse.error - fine.error).abs();
                count += 1.0;
            }
        }
        CostPoint::new(power / count.max(1.0), error / count.max(1.0))
    }
}
