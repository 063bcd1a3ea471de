//! Estimated costs of settings, by address.

use std::collections::BTreeMap;

use frugal_core::frontier::{
    Address, Bounds, CameraView, CostPoint, Frontier, FrontierPoint, Leaf, address_in,
};
use frugal_core::knobs::KnobLevels;

use super::regression::{DescribedView, Regression};
use super::smooth::{Smoother, Viewpoint};
use crate::cameras::MovingCamera;
use crate::table::CostTable;

/// Fewest cameras on tracks that are representative on their own.
const LEAST_ON_TRACK: usize = 6;

/// The training table: costs of every setting of the pool at every camera.
#[derive(Clone, Debug)]
pub(crate) struct Training {
    settings: Vec<KnobLevels>,
    /// By camera, then by setting.
    costs: Vec<Vec<CostPoint>>,
    groups: Vec<u32>,
    on_track: Vec<usize>,
    /// What the views show, of the cameras and of the unrendered views after them; empty without
    /// unrendered views.
    seen: Vec<DescribedView>,
}

impl Training {
    /// Takes the cameras of `table` at which all of `settings` are known.
    pub(crate) fn new(
        table: &CostTable,
        cameras: &[MovingCamera],
        settings: &[KnobLevels],
    ) -> (Self, Vec<usize>) {
        let mut training = Self {
            settings: settings.to_vec(),
            costs: Vec::new(),
            groups: Vec::new(),
            on_track: Vec::new(),
            seen: Vec::new(),
        };
        let mut rows = Vec::new();
        for (row, camera) in cameras.iter().enumerate().take(table.rows()) {
            let costs: Option<Vec<CostPoint>> =
                settings.iter().map(|settings| table.get(row, *settings)).collect();
            if let Some(costs) = costs
                .filter(|costs| costs.iter().all(|cost| cost.power.0 > 0.0 && cost.error >= 0.0))
            {
                if camera.is_on_track() {
                    training.on_track.push(training.costs.len());
                }
                training.costs.push(costs);
                training.groups.push(camera.group);
                rows.push(row);
            }
        }
        (training, rows)
    }

    /// Adds views that no camera has rendered, with predicted costs; `cameras`: what the cameras
    /// see. Without enough cameras, nothing is added.
    pub(crate) fn with_unrendered(
        mut self,
        cameras: Vec<DescribedView>,
        unrendered: Vec<DescribedView>,
    ) -> Self {
        if cameras.len() == self.groups.len() {
            self.seen = cameras;
            self.seen.extend(unrendered);
        }
        self.without(&[])
    }

    /// The same cameras, and the unrendered views as predicted without the cameras `out`.
    pub(super) fn without(&self, out: &[usize]) -> Self {
        let mut training = self.clone();
        training.costs.truncate(self.cameras());
        let kept: Vec<usize> = (0..self.cameras()).filter(|camera| !out.contains(camera)).collect();
        if self.seen.len() <= self.cameras() {
            return training;
        }
        let errors: Vec<Vec<f64>> = kept
            .iter()
            .map(|camera| self.costs[*camera].iter().map(|cost| cost.error).collect())
            .collect();
        let seen = kept.iter().map(|camera| self.seen[*camera].clone()).collect();
        let Some(regression) = Regression::fit(seen, &errors) else {
            // Views without a prediction would shift the addresses of those with one.
            training.seen.clear();
            return training;
        };
        // Power hardly differs by view; errors do.
        let power = self.mean(&kept).costs;
        for view in &self.seen[self.cameras()..] {
            let costs = regression.errors(view).into_iter().zip(&power);
            training
                .costs
                .push(costs.map(|(error, mean)| CostPoint::new(mean.power.0, error)).collect());
        }
        training
    }

    /// Number of cameras.
    pub(crate) fn cameras(&self) -> usize {
        self.groups.len()
    }

    /// Number of cameras and unrendered views with costs.
    pub(super) fn views(&self) -> usize {
        self.costs.len()
    }

    /// Cost of each setting at a camera, or at an unrendered view.
    pub(crate) fn costs(&self, camera: usize) -> &[CostPoint] {
        &self.costs[camera]
    }

    /// Cameras on tracks.
    pub(super) fn on_track(&self) -> &[usize] {
        &self.on_track
    }

    /// Cross-validation group: cameras of one group are held out together.
    pub(crate) fn group(&self, camera: usize) -> u32 {
        self.groups[camera]
    }

    /// Cameras on tracks, which are representative of an app; all cameras where those are too few.
    pub(crate) fn representative(&self) -> Vec<usize> {
        if self.on_track.len() >= LEAST_ON_TRACK {
            self.on_track.clone()
        } else {
            (0..self.cameras()).collect()
        }
    }

    /// Mean costs over `cameras`; empty without cameras.
    pub(crate) fn mean(&self, cameras: &[usize]) -> Estimate {
        let count = cameras.len().max(1) as f64;
        let mean = |setting: usize| {
            let sum = |value: fn(&CostPoint) -> f64| {
                cameras.iter().map(|camera| value(&self.costs[*camera][setting])).sum::<f64>()
                    / count
            };
            CostPoint::new(sum(|cost| cost.power.0), sum(|cost| cost.error))
        };
        Estimate {
            costs: if cameras.is_empty() {
                Vec::new()
            } else {
                (0..self.settings.len()).map(mean).collect()
            },
            weight: cameras.len() as f64,
        }
    }

    /// The frontier of an estimate.
    pub(crate) fn frontier(&self, estimate: &Estimate) -> Frontier {
        let points = self.settings.iter().zip(&estimate.costs);
        Frontier::from_points(
            points.map(|(settings, cost)| FrontierPoint { settings: *settings, cost: *cost }),
        )
    }
}

/// Estimated costs of the pool at one address.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Estimate {
    /// By setting.
    pub costs: Vec<CostPoint>,
    /// Weight of the evidence, in cameras at the exact viewpoint.
    pub weight: f64,
}

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
