//! The octree: divided where that lowers the cost, with a frontier for every address of its leaves.

use std::collections::{BTreeMap, BTreeSet};

use frugal_core::frontier::{
    Address, Bounds, CameraView, Corner, Frontier, Leaf, Octree, ViewDirection,
};

use super::Smoother;
use super::cluster::cluster;
use super::estimate::{Keys, Pyramid, leaf_at};
use super::held_out::HeldOut;
use super::training::{Estimate, Training};

/// Least weight of evidence; an address without cameras and with less takes the shared frontier.
const LEAST_WEIGHT: f64 = 0.5;
/// Mean difference, of the logarithms of power and error, below which frontiers are the same.
const LEAST_DISTANCE: f64 = 0.02;
/// Number of unrendered views that justify a division as a camera does.
const UNRENDERED_PER_CAMERA: usize = 4;
/// Least saving at held-out cameras that justifies a larger map, as a share of the shared frontier's
/// loss. Less than a standard error suffices, since estimates are shrunk towards the shared one.
const LEAST_SAVING: f64 = 0.02;
/// Greatest number of frontiers; each takes most of a kilobyte of a map's file.
const MOST_FRONTIERS: usize = 40;

/// Configuration of the fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FitConfig {
    /// Greatest number of octree levels, at most 6.
    pub levels: u8,
    /// Least number of cameras in a node that is divided. Higher values give smaller maps.
    pub least_cameras: usize,
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
            least_cameras: 2,
            power_threshold_w: 0.0,
            power_threshold_share: 0.01,
            error_threshold: 0.001,
        }
    }
}

/// Summary of a fit.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FitReport {
    /// Number of cameras.
    pub cameras: usize,
    /// Cross-validated loss of the shared frontier, as a share of the least cost; mean over cameras
    /// on tracks, where there are enough of them.
    pub shared_loss: f64,
    /// The same for the octree.
    pub octree_loss: f64,
    /// Number of addresses with cameras.
    pub addresses: usize,
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

/// Fits an octree over `bounds` to `training`; `views`: its cameras and unrendered views.
pub(crate) fn fit(
    training: &Training,
    views: &[CameraView],
    bounds: &Bounds,
    config: &FitConfig,
) -> Fitted {
    let levels = config.levels.min(6);
    let all: Vec<usize> = (0..training.views()).collect();
    let views = &views[..all.len().min(views.len())];
    let keys = Keys::new(bounds, levels, views);
    let smoother = Smoother::new(training, views);
    let pyramid = Pyramid::new(training, &smoother, &keys, &all);
    let shared = training.frontier(&pyramid.shared);
    let range = match shared.points() {
        [first, .., last] => last.cost.power.0 - first.cost.power.0,
        _ => 0.0,
    };
    let threshold_w = config.power_threshold_w.max(config.power_threshold_share * range);
    // At any finer depth: eight children may look alike, and their children not.
    let differs = |depth: usize, cameras: &[usize]| {
        (depth + 1..=usize::from(levels)).any(|finer| {
            let distance = pyramid.distance(&keys, cameras, depth, finer);
            distance.power.0 > threshold_w || distance.error > config.error_threshold
        })
    };
    let is_enough = |cameras: &[usize]| {
        let rendered = cameras.iter().filter(|camera| **camera < training.cameras()).count();
        UNRENDERED_PER_CAMERA * rendered + (cameras.len() - rendered)
            >= UNRENDERED_PER_CAMERA * config.least_cameras
    };
    let root = Leaf { min: [0; 3], size: 1 << levels };
    let whole = || Octree { levels, nodes: vec![0], ..Octree::default() };
    let mut tree = Tree { octree: whole(), leaves: Vec::new() };
    let mut pays = |depth: usize, cameras: &[usize]| is_enough(cameras) && differs(depth, cameras);
    tree.divide(0, 0, root, &all, &mut pays, &keys);
    let mut depths = vec![0; all.len()];
    for (_, depth, cameras) in &tree.leaves {
        cameras.iter().for_each(|camera| depths[*camera] = *depth);
    }
    let held_out = HeldOut::new(training, views, &keys, &depths);
    let [shared_loss, octree_loss] = held_out.losses(training);
    let is_divided = shared_loss - octree_loss >= LEAST_SAVING * shared_loss;
    if !is_divided {
        tree = Tree { octree: whole(), leaves: vec![(root, 0, all.clone())] };
    }
    let Tree { mut octree, leaves } = tree;
    let members = if is_divided { members(&keys, &leaves) } else { BTreeMap::new() };
    let report = FitReport {
        cameras: training.cameras(),
        shared_loss,
        octree_loss: if is_divided { octree_loss } else { shared_loss },
        addresses: members.len(),
        power_threshold_w: threshold_w,
    };
    let estimates = if is_divided { &held_out.octree } else { &held_out.shared };
    let held_out = estimates.iter().map(|estimate| training.frontier(estimate)).collect();
    let known =
        Known { training, keys: &keys, pyramid: &pyramid, members: &members, shared: &shared };
    fill(&mut octree, &leaves, &known);
    Fitted { octree, shared, report, held_out }
}

struct Tree {
    octree: Octree,
    /// Leaf, depth, cameras.
    leaves: Vec<(Leaf, usize, Vec<usize>)>,
}

impl Tree {
    fn divide(
        &mut self,
        node: usize,
        depth: usize,
        leaf: Leaf,
        cameras: &[usize],
        pays: &mut dyn FnMut(usize, &[usize]) -> bool,
        keys: &Keys,
    ) {
        if leaf.size == 1 || !pays(depth, cameras) {
            self.leaves.push((leaf, depth, cameras.to_vec()));
            return;
        }
        let first = self.octree.nodes.len();
        self.octree.nodes[node] = first as u32;
        self.octree.nodes.extend([0; 8]);
        let half = Leaf { size: leaf.size / 2, ..leaf };
        for child in 0..8 {
            let octant = Leaf { min: half.corner(child), size: half.size };
            let levels = self.octree.levels;
            let inside = cameras.iter().filter(|camera| {
                leaf_at(levels, depth as u8 + 1, keys.positions[**camera]) == octant
            });
            let inside: Vec<usize> = inside.copied().collect();
            self.divide(first + child, depth + 1, octant, &inside, pays, keys);
        }
    }
}

/// Cameras and unrendered views by address; corners on the border of two leaves have those of both.
fn members(keys: &Keys, leaves: &[(Leaf, usize, Vec<usize>)]) -> BTreeMap<Address, Vec<usize>> {
    let mut members: BTreeMap<Address, Vec<usize>> = BTreeMap::new();
    for (_, depth, cameras) in leaves {
        for camera in cameras {
            members.entry(keys.addresses[*depth][*camera]).or_default().push(*camera);
        }
    }
    members
}

/// Inputs of a corner's frontier.
struct Known<'a> {
    training: &'a Training,
    keys: &'a Keys,
    pyramid: &'a Pyramid<'a>,
    members: &'a BTreeMap<Address, Vec<usize>>,
    shared: &'a Frontier,
}

impl Known<'_> {
    /// The estimate of an address: from its cameras, or from those around it. `None` for the shared
    /// one.
    fn estimate(&self, address: Address) -> Option<Estimate> {
        if self.members.is_empty() {
            return None;
        }
        match self.members.get(&address) {
            Some(members) => Some(self.pyramid.viewpoints(members)),
            None => {
                let around = self.pyramid.address(self.keys, address, 0);
                (around.weight >= LEAST_WEIGHT).then_some(around)
            }
        }
    }
}

/// Assigns six frontiers to every corner of every leaf; similar frontiers are stored once.
fn fill(octree: &mut Octree, leaves: &[(Leaf, usize, Vec<usize>)], known: &Known<'_>) {
    let corners: BTreeSet<[u16; 3]> =
        leaves.iter().flat_map(|(leaf, ..)| (0..8).map(|number| leaf.corner(number))).collect();
    let addresses = corners
        .iter()
        .flat_map(|at| ViewDirection::ALL.map(|direction| Address { at: *at, direction }));
    let (mut slots, mut estimates) = (Vec::new(), Vec::new());
    for address in addresses {
        let estimate = known.estimate(address);
        slots.push(estimate.is_some().then_some(estimates.len()));
        estimates.extend(estimate);
    }
    // The shared frontier is one of them.
    let (assigned, means) = cluster(&estimates, MOST_FRONTIERS - 1, LEAST_DISTANCE);
    let of_clusters: Vec<Frontier> =
        means.iter().map(|mean| known.training.frontier(mean).rounded()).collect();
    let shared = known.shared.rounded();
    let mut index = |frontier: &Frontier| {
        let stored = octree.frontiers.iter().position(|other| other == frontier);
        stored.unwrap_or_else(|| {
            octree.frontiers.push(frontier.clone());
            octree.frontiers.len() - 1
        }) as u32
    };
    for (at, slots) in corners.into_iter().zip(slots.chunks_exact(ViewDirection::ALL.len())) {
        let frontiers = std::array::from_fn(|direction| {
            index(slots[direction].map_or(&shared, |slot: usize| &of_clusters[assigned[slot]]))
        });
        octree.corners.push(Corner { at, frontiers });
    }
}
