//! Measures frontiers in their cells, and gives them the costs found.

use bevy_frugal_gi::frontier::{CostPoint, Frontier, FrontierMap, FrontierPoint};
use bevy_frugal_gi::knobs::RenderSettings;

use super::adjust::adjust;
use super::anchors::{anchors, positions};
use super::cameras::{RandomCameras, find_cells};
use super::pooling::{Anchor, Reading, pool};
use crate::scene::CameraPose;
use crate::search::Monitor;

/// Something that knows what settings cost at any camera: the headless stage, a synthetic field in tests.
pub trait Measure {
    /// Why there is no answer.
    type Error;

    /// Whether `camera` sees geometry and stands in none. Must cost next to nothing.
    fn sees(&self, camera: &CameraPose) -> bool;

    /// Power and error of `settings` at `camera`. Cheapest when the camera is the same as before.
    ///
    /// # Errors
    /// When the rendering or the metering fails.
    fn measure(&mut self, camera: &CameraPose, settings: RenderSettings) -> Result<CostPoint, Self::Error>;
}

/// How much is measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RemeasureConfig {
    /// Most cameras for each frontier, at least 1. Higher values give costs that are closer to the mean of the cell, in as many times the time.
    pub cameras: usize,
    /// Most points of each frontier that are measured, at least 2. Higher values follow ratios closer that change along the frontier.
    pub anchors: usize,
    /// Seed of the cameras.
    pub seed: u64,
    /// Seconds that a measurement will take, where a clock decides; `None` where nothing is known of it.
    pub pace: Option<f64>,
}

impl Default for RemeasureConfig {
    fn default() -> Self {
        Self { cameras: 3, anchors: 5, seed: 0, pace: None }
    }
}

/// What was measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Remeasured {
    /// Frontiers that were reached.
    pub frontiers: usize,
    /// Cameras at which they were measured.
    pub cameras: usize,
    /// Measurements.
    pub measurements: usize,
}

/// Keeps the cameras apart from those of other random choices with the same seed.
const SALT: u64 = 0xCE11_CA3E_7A00;

/// Points below which cutting them saves nothing worth having: both ends, and one between them, since one of the ends has no error.
const LEAST_ANCHORS: usize = 3;

/// What a new camera costs beyond its measurements, in measurements: its reference is rendered.
const NEW_CAMERA: f64 = 0.8;

/// A frontier that is being measured.
struct Probe {
    points: Vec<FrontierPoint>,
    positions: Vec<f64>,
    anchors: Vec<usize>,
    /// Anchors of a frontier with points enough.
    most: usize,
    /// Whether the last point is one that the search did not find.
    added: bool,
}

impl Probe {
    /// The points of `frontier`, and the best settings where it does not reach them.
    ///
    /// At the corner something cheaper looked the same as the best, or all but the same. In the cell it need not, and then the frontier would have
    /// nothing for an error budget near 0.
    fn new(frontier: &Frontier, best: RenderSettings, most: usize) -> Self {
        let mut points = frontier.points().to_vec();
        let last = points.last().copied().filter(|last| last.settings != best);
        points.extend(last.map(|last| FrontierPoint { settings: best, cost: CostPoint { error: 0.0, ..last.cost } }));
        let positions = positions(&points);
        Self { anchors: anchors(&positions, most), most, added: last.is_some(), points, positions }
    }

    /// Each anchor's point and slot.
    fn anchors(&self) -> impl Iterator<Item = (usize, usize)> {
        self.anchors.iter().enumerate().map(|(number, point)| (*point, slot(number, self.anchors.len(), self.most)))
    }
}

/// Replaces the costs of `map`'s frontiers by what they cost on average in their cells.
///
/// Every cell gets its first camera before any gets its second, those that most cameras fall into first, so that what a time limit or an interrupt
/// cuts off is what matters least. A cell that was not reached is taken to be as wrong as the others; a frontier that no camera was given keeps its
/// costs. `progress` is told how many measurements are done, and of how many.
///
/// # Errors
/// When a measurement fails; the map is then as it was.
pub fn remeasure<M: Measure>(
    map: &mut FrontierMap,
    config: &RemeasureConfig,
    measure: &mut M,
    monitor: &mut dyn Monitor,
    progress: &mut dyn FnMut(usize, usize),
) -> Result<Remeasured, M::Error> {
    let best = map.knobs.highest();
    let mut random = RandomCameras::new(map.bounds, config.seed ^ SALT);
    let cells = find_cells(map, config.cameras, &mut random, |camera| measure.sees(camera), || monitor.keep_going());
    let most = anchor_count(config, cells.iter().map(|cell| cell.cameras.len()).sum(), monitor.remaining_seconds());
    let probes: Vec<Probe> = cells.iter().map(|cell| Probe::new(&map.octree.frontiers[cell.frontier], best, most)).collect();
    let total = cells.iter().zip(&probes).map(|(cell, probe)| cell.cameras.len() * probe.anchors.len()).sum();

    let mut done = Remeasured::default();
    let (mut power, mut error) = (Vec::new(), Vec::new());
    let visits = (0..config.cameras).flat_map(|camera| (0..cells.len()).map(move |cell| (camera, cell)));
    for (camera, cell) in visits {
        let Some(pose) = cells[cell].cameras.get(camera) else { continue };
        for (number, (point, slot)) in probes[cell].anchors().enumerate() {
            if !monitor.keep_going() {
                break;
            }
            progress(done.measurements, total);
            let FrontierPoint { settings, cost: promised } = probes[cell].points[point];
            let measured = measure.measure(pose, settings)?;
            done.cameras += usize::from(number == 0);
            done.measurements += 1;
            let reading = |promised: f64, measured: f64| Reading { cell, camera, point, slot, promised, measured };
            let (watts, wrong) = (measured.power.0, measured.error);
            power.extend((watts.is_finite() && watts > 0.0).then(|| reading(promised.power.0, watts)));
            let counts = settings != best && wrong.is_finite() && wrong >= 0.0;
            error.extend(counts.then(|| reading(promised.error, wrong)));
        }
    }
    progress(done.measurements, total);

    let (power, error) = (pool(&power), pool(&error));
    for (index, (cell, mut probe)) in cells.iter().zip(probes).enumerate() {
        // Nobody promised a power for it: without a measurement there is none.
        if probe.added && !power.has(index, probe.points.len() - 1) {
            probe.points.pop();
        }
        let promised = |cost: fn(CostPoint) -> f64| {
            let anchors = probe.anchors().filter_map(|(point, slot)| Some((point, slot, probe.points.get(point)?.cost)));
            anchors.map(move |(point, slot, promised)| Anchor { point, slot, promised: cost(promised) })
        };
        let of_power = power.of_cell(index, promised(|cost| cost.power.0));
        let mut of_error = error.of_cell(index, promised(|cost| cost.error));
        // It was the best of some cell, which has another last point.
        of_error.retain(|(point, _)| probe.points[*point].settings != best);
        let adjusted = adjust(&probe.points, &probe.positions, &of_power, &of_error, best);
        // Where nothing was measured at all this is the frontier as it was.
        map.octree.frontiers[cell.frontier] = adjusted;
        done.frontiers += usize::from(probe.anchors().any(|(point, _)| power.has(index, point)));
    }
    Ok(done)
}

/// How many anchors there is time for at `visits` cameras.
fn anchor_count(config: &RemeasureConfig, visits: usize, remaining_seconds: Option<f64>) -> usize {
    let most = config.anchors.max(2);
    let Some(seconds) = remaining_seconds else { return most };
    let least = LEAST_ANCHORS.min(most);
    let Some(pace) = config.pace.filter(|pace| *pace > 0.0) else { return least };
    // The cast saturates.
    ((seconds / pace / visits.max(1) as f64 - NEW_CAMERA) as usize).clamp(least, most)
}

/// The place of anchor `number` of `count` among `most`.
fn slot(number: usize, count: usize, most: usize) -> usize {
    if count > 1 { (number * (most - 1) + (count - 1) / 2) / (count - 1) } else { 0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn anchors_are_cut_before_cameras_and_never_below_three() {
        let config = RemeasureConfig { pace: Some(0.5), ..Default::default() };
        assert_eq!(anchor_count(&config, 100, None), 5);
        assert_eq!(anchor_count(&config, 100, Some(1e9)), 5);
        assert_eq!(anchor_count(&config, 100, Some(245.0)), 4);
        assert_eq!(anchor_count(&config, 100, Some(0.0)), 3);
        assert_eq!(anchor_count(&RemeasureConfig { pace: None, ..config }, 0, Some(245.0)), 3);
    }

    #[test]
    fn slots_spread_few_anchors_over_many() {
        let slots = |count, most| (0..count).map(|number| slot(number, count, most)).collect::<Vec<_>>();
        assert_eq!(slots(5, 5), [0, 1, 2, 3, 4]);
        assert_eq!(slots(3, 5), [0, 2, 4]);
        assert_eq!(slots(2, 5), [0, 4]);
        assert_eq!(slots(1, 5), [0]);
    }
}
