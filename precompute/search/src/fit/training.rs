//! What the cameras of a search measured, and means of it.

use frugal_core::frontier::{CostPoint, Frontier, FrontierPoint};
use frugal_core::knobs::KnobLevels;

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
    pub(super) cameras: Vec<MovingCamera>,
}

impl Training {
    /// Takes the cameras of `table` at which all of `settings` are known.
    pub(crate) fn new(
        table: &CostTable,
        cameras: &[MovingCamera],
        settings: &[KnobLevels],
    ) -> (Self, Vec<usize>) {
        let (settings, costs) = (settings.to_vec(), Vec::new());
        let mut training = Self { settings, costs, cameras: Vec::new() };
        let mut rows = Vec::new();
        let is_valid = |cost: &CostPoint| cost.power.0 > 0.0 && cost.error >= 0.0;
        for (row, camera) in cameras.iter().enumerate().take(table.rows()) {
            let known = training.settings.iter().map(|settings| table.get(row, *settings));
            let costs = known.collect::<Option<Vec<CostPoint>>>();
            if let Some(costs) = costs.filter(|costs| costs.iter().all(is_valid)) {
                training.costs.push(costs);
                training.cameras.push(*camera);
                rows.push(row);
            }
        }
        (training, rows)
    }

    /// Number of cameras.
    pub(crate) fn cameras(&self) -> usize {
        self.cameras.len()
    }

    /// Cost of each setting at a camera.
    pub(crate) fn costs(&self, camera: usize) -> &[CostPoint] {
        &self.costs[camera]
    }

    /// Cameras on tracks, which are representative of an app; all cameras where those are too few.
    pub(crate) fn representative(&self) -> Vec<usize> {
        let all = 0..self.cameras();
        let is_on_track = |camera: &usize| self.cameras[*camera].is_on_track();
        let on_track: Vec<usize> = all.clone().filter(is_on_track).collect();
        if on_track.len() >= LEAST_ON_TRACK { on_track } else { all.collect() }
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
        let settings = if cameras.is_empty() { 0 } else { self.settings.len() };
        Estimate { costs: (0..settings).map(mean).collect(), weight: cameras.len() as f64 }
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
