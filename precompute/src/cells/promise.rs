//! What a map promises, beside what cameras measure that it never saw.

use bevy_frugal_gi::frontier::{Correction, CostPoint, Frontier, FrontierMap, FrontierPoint};
use bevy_frugal_gi::knobs::RenderSettings;

use super::adjust::error_ratio;
use super::cameras::{RandomCameras, frontier_at};
use super::measure::Measure;
use crate::search::Monitor;

/// Keeps the cameras apart from those that the costs come from.
const SALT: u64 = 0x5EED_CA3E_7A00;

/// Places tried for each camera that is wanted; in a scene that is mostly walls there may be fewer.
const TRIES_PER_CAMERA: usize = 40;

/// Error budgets that a map is held to: from one that is hardly seen to one that is.
pub const BUDGETS: [f64; 3] = [0.01, 0.02, 0.04];

/// The settings that an error budget picks at one camera: promised and measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Promise {
    /// Which camera.
    pub camera: u64,
    /// The budget.
    pub budget: f64,
    /// What the search found at the corner; `None` for settings that it did not find.
    pub searched: Option<CostPoint>,
    /// What the map says now.
    pub promised: CostPoint,
    /// What it came to.
    pub measured: CostPoint,
}

/// What error budgets of 0.01, 0.02 and 0.04 pick at `cameras` random cameras, measured there. The best settings are left out: they are what errors are measured against.
///
/// `searched` are the frontiers as they were found, in the order of `map`'s. `progress` is told of each camera.
///
/// # Errors
/// When a measurement fails.
pub fn hold_to_promise<M: Measure>(
    map: &FrontierMap,
    searched: &[Frontier],
    [cameras, seed]: [u64; 2],
    measure: &mut M,
    monitor: &mut dyn Monitor,
    progress: &mut dyn FnMut(u64),
) -> Result<Vec<Promise>, M::Error> {
    let best = map.knobs.highest();
    let mut random = RandomCameras::new(map.bounds, seed ^ SALT);
    let mut promises: Vec<Promise> = Vec::new();
    let mut found = 0;
    for _ in 0..TRIES_PER_CAMERA as u64 * cameras {
        if found == cameras || !monitor.keep_going() {
            break;
        }
        let camera = random.draw();
        if !measure.sees(&camera) {
            continue;
        }
        let Some(index) = frontier_at(map, &camera) else { continue };
        let before = searched.get(index).map(Frontier::points).unwrap_or_default();
        let mut known: Vec<(RenderSettings, CostPoint)> = Vec::new();
        for budget in BUDGETS {
            let picked = map.octree.frontiers[index].least_power_within(budget);
            let Some(FrontierPoint { settings, cost: promised }) = picked.filter(|point| point.settings != best) else { continue };
            let measured = match known.iter().find(|(known, _)| known == settings) {
                Some((_, measured)) => *measured,
                None => measure.measure(&camera, *settings)?,
            };
            known.push((*settings, measured));
            let searched = before.iter().find(|point| point.settings == *settings).map(|point| point.cost);
            promises.push(Promise { camera: found, budget, searched, promised: *promised, measured });
        }
        found += 1;
        progress(found);
    }
    Ok(promises)
}

/// What the map still promises too much.
///
/// Each camera counts once: with the mean of its errors as shares of their budgets.
pub fn correction(promises: &[Promise]) -> Correction {
    let mut cameras: Vec<(f64, f64)> = Vec::new();
    for of_camera in promises.chunk_by(|a, b| a.camera == b.camera) {
        let mean = |error: fn(&Promise) -> f64| of_camera.iter().map(|p| error(p) / p.budget).sum::<f64>() / of_camera.len() as f64;
        cameras.push((mean(|p| p.promised.error), mean(|p| p.measured.error)));
    }
    Correction::fit(&cameras)
}

/// Measured ÷ promised, of many.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// As many are above as below.
    pub median: f64,
    /// Nine in ten are at most this.
    pub high: f64,
}

impl Spread {
    /// Of power and of error, in that order. Errors count from [`Correction::LEAST_ERROR`] up. Ratios that are not finite are left out; `None`
    /// where none is left.
    pub fn of(pairs: impl Iterator<Item = (CostPoint, CostPoint)> + Clone) -> [Option<Self>; 2] {
        [
            Self::of_ratios(pairs.clone().map(|(promised, measured)| measured.power.0 / promised.power.0)),
            Self::of_ratios(pairs.map(|(promised, measured)| error_ratio(promised.error, measured.error))),
        ]
    }

    fn of_ratios(ratios: impl Iterator<Item = f64>) -> Option<Self> {
        let mut ratios: Vec<f64> = ratios.filter(|ratio| ratio.is_finite()).collect();
        ratios.sort_by(f64::total_cmp);
        let covering = |share: f64| ratios.get(((share * ratios.len() as f64).ceil() as usize).checked_sub(1)?).copied();
        Some(Self { median: covering(0.5)?, high: covering(0.9)? })
    }
}

impl std::fmt::Display for Spread {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(formatter, "{:.2} (90 %: {:.2})", self.median, self.high)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_spread_tells_the_middle_and_the_worst_but_one_in_ten() {
        let pairs = (1..=10).map(|watts| (CostPoint::new(1.0, 0.0), CostPoint::new(f64::from(watts), 0.001)));
        let [power, error] = Spread::of(pairs);
        assert_eq!(power, Some(Spread { median: 5.0, high: 9.0 }));
        assert_eq!(error.map(|error| error.high), Some(2.0));
        assert_eq!(Spread::of([(CostPoint::new(1.0, 0.1), CostPoint::new(f64::NAN, f64::NAN))].into_iter()), [None; 2]);
    }
}
