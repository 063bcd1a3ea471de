//! Power at equal error: relative cost of the images of two maps.
//!
//! The ends of a frontier do not show it: the same settings may cost more and look better, and two
//! searches find different settings. What a budget costs is the power at the requested error. That
//! is compared along the shared frontier, and in the mean over the addresses that both maps have.

use std::collections::BTreeMap;

use frugal_core::frontier::{Frontier, FrontierMap, Octree, ViewDirection};
use serde::Serialize;

use super::comparable::check;

/// Errors at which maps are compared: the range of error budgets.
pub(super) const ERRORS: [f64; 6] = [0.005, 0.01, 0.015, 0.02, 0.03, 0.05];

/// Lower bound of errors in interpolation. Repeated renderings may differ by as much, and 0, the
/// error of the best settings, has no logarithm. Below every one of [`ERRORS`].
const LEAST_ERROR: f64 = 0.001;

/// Change of a map's power against an older map.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct MapComparison {
    /// The verdict: the greater of the two changes below. 0.02 is 2 % more power than in the old
    /// map.
    pub change: f64,
    /// Change along the shared frontiers, mean over the error levels.
    pub shared_change: Option<f64>,
    /// Change of the mean over common addresses, mean over the error levels.
    pub addresses_change: Option<f64>,
    /// Idle power of the old map's device and of the new one's, watts. It does not depend on the
    /// build, so all powers here exclude it, each map's its own.
    pub idle_w: [f64; 2],
    /// The error levels.
    pub errors: Vec<ErrorLevel>,
}

/// Powers at one error.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct ErrorLevel {
    /// The error.
    pub error: f64,
    /// Along the shared frontiers; `None` where one of the maps does not reach the error.
    pub shared: Option<Change>,
    /// Mean over the addresses whose frontiers reach the error in both maps; `None` without such
    /// addresses.
    pub addresses: Option<Change>,
}

/// Power in the old map and in the new one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(crate) struct Change {
    /// Mean power in the old map without idle power, watts.
    pub old_w: f64,
    /// The same in the new map.
    pub new_w: f64,
    /// new ÷ old − 1.
    pub change: f64,
    /// Number of frontiers of each map in the means.
    pub frontiers: usize,
}

impl MapComparison {
    /// Whether power rose by more than `tolerance`, a share. A fall never counts. A tolerance of
    /// NaN tolerates nothing.
    pub(crate) fn rose_beyond(&self, tolerance: f64) -> bool {
        // `max` ignores NaN.
        self.change > tolerance.max(0.0)
    }
}

/// Compares `new` with `old`.
///
/// The verdict is a mean over [`ERRORS`]. A single level depends on two points of each shared
/// frontier, and varies with the settings that a search has found there; a higher cost of a build
/// shows at all levels. The worse of shared frontier and addresses decides, because cameras use
/// both.
///
/// `any_device`: watts of two devices or models are compared all the same.
///
/// # Errors
/// When the maps' watts or errors are not comparable, or they have no common error.
pub(crate) fn compare(
    old: &FrontierMap,
    new: &FrontierMap,
    any_device: bool,
) -> Result<MapComparison, String> {
    check(old, new, any_device)?;
    let idle_w = [old, new].map(|map| map.work_prices.idle.0);
    let (shared, addresses) = ([(&old.shared, &new.shared)], common_addresses(old, new));
    let level = |error| ErrorLevel {
        error,
        shared: Change::at(error, &shared, idle_w),
        addresses: Change::at(error, &addresses, idle_w),
    };
    let errors: Vec<ErrorLevel> = ERRORS.into_iter().map(level).collect();
    let shared_change = mean_change(errors.iter().filter_map(|level| level.shared));
    let addresses_change = mean_change(errors.iter().filter_map(|level| level.addresses));
    let worse = [shared_change, addresses_change].into_iter().flatten().reduce(f64::max);
    let Some(change) = worse else {
        let [least, .., most] = ERRORS;
        return Err(format!(
            "the maps' frontiers have no error from {least} to {most} in common: run `frugal precompute` again for both, with more time"
        ));
    };
    Ok(MapComparison { change, shared_change, addresses_change, idle_w, errors })
}

impl Change {
    /// The change over the pairs that both reach `error`; `None` without such pairs, or where the
    /// ratio of their powers is undefined.
    fn at(
        error: f64,
        pairs: &[(&Frontier, &Frontier)],
        [old_idle, new_idle]: [f64; 2],
    ) -> Option<Self> {
        let powers = pairs.iter().filter_map(|(old, new)| {
            Some((power_at(old, error)? - old_idle, power_at(new, error)? - new_idle))
        });
        let (old_w, new_w, frontiers) =
            powers.fold((0.0, 0.0, 0), |(old, new, count), (a, b)| (old + a, new + b, count + 1));
        let count = f64::from(u32::try_from(frontiers).ok().filter(|count| *count > 0)?);
        let ratio = new_w / old_w;
        let valid = old_w > 0.0 && new_w > 0.0 && ratio.is_finite() && ratio > 0.0;
        valid.then(|| Self {
            old_w: old_w / count,
            new_w: new_w / count,
            change: ratio - 1.0,
            frontiers,
        })
    }
}

/// The geometric mean of the ratios, so that swapping the maps inverts it. `None` without changes.
fn mean_change(changes: impl Iterator<Item = Change>) -> Option<f64> {
    let (sum, count) =
        changes.fold((0.0, 0.0), |(sum, count), change| (sum + change.change.ln_1p(), count + 1.0));
    (count > 0.0).then(|| (sum / count).exp_m1())
}

/// Power at which `frontier` reaches `error`, interpolated linearly in the logarithm of error. The
/// cheapest settings' power where even those are below `error`; `None` where no settings reach it.
///
/// Not the step function of a controller's selections, whose steps the least noise of an error
/// decides. In the logarithm frontiers are nearly straight: halving the error costs about the same
/// anywhere.
fn power_at(frontier: &Frontier, error: f64) -> Option<f64> {
    let points = frontier.points();
    let first = points.partition_point(|point| point.cost.error > error);
    let good = points.get(first)?.cost;
    let Some(worse) = first.checked_sub(1).map(|before| points[before].cost) else {
        return Some(good.power.0);
    };
    let log = |error: f64| error.max(LEAST_ERROR).ln();
    let share = (log(worse.error) - log(error)) / (log(worse.error) - log(good.error));
    Some(worse.power.0 + share * (good.power.0 - worse.power.0))
}

/// Frontiers of the addresses that both maps have, the old map's first. Empty where their octrees
/// span different boxes.
fn common_addresses<'a>(
    old: &'a FrontierMap,
    new: &'a FrontierMap,
) -> Vec<(&'a Frontier, &'a Frontier)> {
    if old.bounds != new.bounds {
        return Vec::new();
    }
    let new = frontiers_by_address(&new.octree);
    let old = frontiers_by_address(&old.octree);
    old.into_iter()
        .filter_map(|(address, frontier)| Some((frontier, *new.get(&address)?)))
        .collect()
}

/// Frontiers by corner, on the finest lattice of any octree, and view direction.
fn frontiers_by_address(octree: &Octree) -> BTreeMap<([u32; 3], ViewDirection), &Frontier> {
    let finest = u32::from(Octree::MAX_LEVELS.saturating_sub(octree.levels));
    let corners = octree
        .corners
        .iter()
        .flat_map(|corner| ViewDirection::ALL.map(|direction| (corner, direction)));
    let known = corners.filter_map(|(corner, direction)| {
        Some((
            (corner.at.map(|coordinate| u32::from(coordinate) << finest), direction),
            octree.frontier(corner, direction)?,
        ))
    });
    known.collect()
}

#[cfg(test)]
#[path = "compare_tests.rs"]
mod tests;
