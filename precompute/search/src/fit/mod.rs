//! From a table of cameras and settings to a map: frontiers by address of an octree, divided only
//! where that lowers the cost.
//!
//! The cost at an address is a mean over the training cameras, weighted by their distance to the
//! address's own. A node of the octree is divided where the finer estimates differ (Wang et al. 2016, section
//! 3.5.3). Where the division saves nothing at held-out cameras, all addresses share one frontier,
//! so that no map is worse than its own best constant. Independent of the renderer.
mod calibrate;
mod cluster;
mod completion;
mod estimate;
mod held_out;
#[cfg(test)]
mod tests;
mod training;

use std::collections::{BTreeMap, BTreeSet};

use frugal_core::frontier::{
    Address, Bounds, CameraView, Corner, Frontier, Leaf, Octree, ViewDirection,
};

pub(crate) use calibrate::{Calibration, calibrate};
use cluster::cluster;
pub(crate) use completion::Completion;
use estimate::{Keys, Pyramid, leaf_at};
use held_out::{held_out, mean_loss};
use training::Estimate;
pub(crate) use training::Training;

/// Least weight of evidence; an address without cameras and with less takes the shared frontier.
const LEAST_WEIGHT: f64 = 0.5;
/// Mean difference, of the logarithms of power and error, below which frontiers are the same.
const LEAST_DISTANCE: f64 = 0.02;
/// Least saving at held-out cameras that justifies a larger map, as a share of the shared frontier's
/// loss. Less than a standard error suffices, since estimates are shrunk towards the shared one.
const LEAST_SAVING: f64 = 0.02;
/// Greatest number of frontiers; each takes most of a kilobyte of a map's file.
const MOST_FRONTIERS: usize = 40;

/// Least number of cameras in a node that is divided. Higher values give smaller maps.
const LEAST_CAMERAS: usize = 2;

/// Configuration of the fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FitConfig {
    /// Greatest number of octree levels, at most 6.
    pub levels: u8,
    /// Power threshold: a node is divided only where its children's estimates differ by more than
    /// this, in watts, in the mean over settings.
    pub power_threshold_w: f64,
    /// The same as a share of the shared frontier's range of power.
    pub power_threshold_share: f64,
    /// Error threshold, 1 − SSIM; exceeding either threshold suffices.
    pub error_threshold: f64,
}

impl Default for FitConfig {
    fn default() -> Self {
        Self {
            levels: 4,
            power_threshold_w: 0.0,
            power_threshold_share: 0.01,
            error_threshold: 0.001,
        }
    }
}

/// Summary of a fit.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FitReport {
    /// Cross-validated loss of the shared frontier, as a share of the least cost; mean over cameras
    /// on tracks, where there are enough of them.
    pub shared_loss: f64,
    /// The same for the octree.
    pub octree_loss: f64,
    /// The power threshold used, watts.
    pub power_threshold_w: f64,
}

/// An octree with its frontiers.
#[derive(Clone, Debug, PartialEq)]
pub struct Fitted {
    /// The octree.
    pub octree: Octree,
    /// The shared frontier of all cameras.
    pub shared: Frontier,
    /// The summary.
    pub report: FitReport,
    /// For each training camera its frontier with its group held out.
    pub held_out: Vec<Frontier>,
}

/// Fits an octree over `bounds` to `training`; `views`: of its cameras.
pub(crate) fn fit(
    training: &Training,
    views: &[CameraView],
    bounds: &Bounds,
    config: &FitConfig,
) -> Fitted {
    let levels = config.levels.min(6);
    let all: Vec<usize> = (0..training.cameras()).collect();
    let keys = Keys::new(bounds, levels, views);
    let pyramid = Pyramid::new(training, &keys, all.clone());
    let shared = training.frontier(&pyramid.shared);
    let range = match shared.points() {
        [first, .., last] => last.cost.power.0 - first.cost.power.0,
        _ => 0.0,
    };
    let threshold_w = config.power_threshold_w.max(config.power_threshold_share * range);
    // At any finer depth: eight children may look alike, and their children not.
    let differs = |depth: usize, cameras: &[usize]| {
        (depth + 1..=usize::from(levels)).any(|finer| {
            let distance = pyramid.distance(cameras, depth, finer);
            distance.power.0 > threshold_w || distance.error > config.error_threshold
        })
    };
    let root = Leaf { min: [0; 3], size: 1 << levels };
    let pays =
        |depth: usize, cameras: &[usize]| cameras.len() >= LEAST_CAMERAS && differs(depth, cameras);
    let (mut nodes, mut leaves) = divided(root, all.clone(), &keys, &pays);
    let mut depths = vec![0; all.len()];
    for (_, depth, cameras) in &leaves {
        cameras.iter().for_each(|camera| depths[*camera] = *depth);
    }
    let estimates = held_out(training, &keys, &depths);
    let [shared_loss, mut octree_loss] = estimates.each_ref().map(|it| mean_loss(training, it));
    let is_divided = shared_loss - octree_loss >= LEAST_SAVING * shared_loss;
    // Cameras by address; corners on the border of two leaves have those of both.
    let mut members: BTreeMap<Address, Vec<usize>> = BTreeMap::new();
    if is_divided {
        for (_, depth, cameras) in &leaves {
            for camera in cameras {
                members.entry(keys.addresses[*depth][*camera]).or_default().push(*camera);
            }
        }
    } else {
        (nodes, leaves, octree_loss) = (vec![0], vec![(root, 0, all)], shared_loss);
    }
    let report = FitReport { shared_loss, octree_loss, power_threshold_w: threshold_w };
    // From an address's cameras, or from those around it; none for the shared one.
    let estimate = |address: Address| match members.get(&address) {
        Some(members) => Some(pyramid.of_cameras(members)),
        None if members.is_empty() => None,
        None => Some(pyramid.address(address, 0)).filter(|around| around.weight >= LEAST_WEIGHT),
    };
    let mut octree = Octree { levels, nodes, ..Octree::default() };
    fill(&mut octree, &leaves, training, &shared.rounded(), &estimate);
    let held_out = &estimates[usize::from(is_divided)];
    let held_out = held_out.iter().map(|estimate| training.frontier(estimate)).collect();
    Fitted { octree, shared, report, held_out }
}

/// A leaf, its depth, and the cameras in it.
type Filled = (Leaf, usize, Vec<usize>);

/// Nodes and leaves of an octree whose nodes are divided where that `pays`.
fn divided(
    root: Leaf,
    cameras: Vec<usize>,
    keys: &Keys,
    pays: &dyn Fn(usize, &[usize]) -> bool,
) -> (Vec<u32>, Vec<Filled>) {
    let levels = root.size.ilog2() as u8;
    let (mut nodes, mut leaves) = (vec![0], Vec::new());
    let mut open = vec![(0, root, 0, cameras)];
    while let Some((node, leaf, depth, cameras)) = open.pop() {
        if leaf.size == 1 || !pays(depth, &cameras) {
            leaves.push((leaf, depth, cameras));
            continue;
        }
        let first = nodes.len();
        nodes[node] = first as u32;
        nodes.extend([0; 8]);
        let half = Leaf { size: leaf.size / 2, ..leaf };
        // The last first, so that nodes are numbered branch by branch.
        for child in (0..8).rev() {
            let octant = Leaf { min: half.corner(child), size: half.size };
            let is_inside = |camera: &usize| {
                leaf_at(levels, depth as u8 + 1, keys.positions[*camera]) == octant
            };
            let inside = cameras.iter().copied().filter(is_inside).collect();
            open.push((first + child, octant, depth + 1, inside));
        }
    }
    (nodes, leaves)
}

/// Assigns six frontiers to every corner of every leaf: by `estimate`, or else the `shared` one. Similar
/// frontiers are stored once.
fn fill(
    octree: &mut Octree,
    leaves: &[Filled],
    training: &Training,
    shared: &Frontier,
    estimate: &dyn Fn(Address) -> Option<Estimate>,
) {
    let corners: BTreeSet<[u16; 3]> =
        leaves.iter().flat_map(|(leaf, ..)| (0..8).map(|number| leaf.corner(number))).collect();
    let addresses = corners
        .iter()
        .flat_map(|at| ViewDirection::ALL.map(|direction| Address { at: *at, direction }));
    let (mut slots, mut estimates) = (Vec::new(), Vec::new());
    for address in addresses {
        let estimate = estimate(address);
        slots.push(estimate.is_some().then_some(estimates.len()));
        estimates.extend(estimate);
    }
    // The shared frontier is one of them.
    let (assigned, means) = cluster(&estimates, MOST_FRONTIERS - 1, LEAST_DISTANCE);
    let of_clusters: Vec<Frontier> =
        means.iter().map(|mean| training.frontier(mean).rounded()).collect();
    let mut index = |frontier: &Frontier| {
        let stored = octree.frontiers.iter().position(|other| other == frontier);
        stored.unwrap_or_else(|| {
            octree.frontiers.push(frontier.clone());
            octree.frontiers.len() - 1
        }) as u32
    };
    for (at, slots) in corners.into_iter().zip(slots.chunks_exact(ViewDirection::ALL.len())) {
        let frontiers = std::array::from_fn(|direction| {
            index(slots[direction].map_or(shared, |slot: usize| &of_clusters[assigned[slot]]))
        });
        octree.corners.push(Corner { at, frontiers });
    }
}
