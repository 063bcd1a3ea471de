//! Costs at a viewpoint from nearby cameras: kernel regression (Nadaraya 1964, Watson 1964).
//!
//! A rendered camera predicts costs of views metres and tens of degrees away. Errors are averaged
//! without a logarithm: budgets limit their arithmetic mean, which a mean of logarithms underestimates
//! the more views differ.

use frugal_core::frontier::{CameraView, CostPoint};

use super::regression::Viewpoint;
use super::training::{Estimate, Training};

/// Prior weight of the shared estimate, in cameras at the exact viewpoint.
const SHARED_WEIGHT: f64 = 0.1;

/// Kernel estimates from the training cameras.
#[derive(Clone, Debug)]
pub(crate) struct Smoother<'a> {
    training: &'a Training,
    viewpoints: Vec<Viewpoint>,
}

impl<'a> Smoother<'a> {
    /// An estimator over `training`; `views`: its cameras.
    pub(crate) fn new(training: &'a Training, views: &[CameraView]) -> Self {
        Self { training, viewpoints: views.iter().map(Viewpoint::from).collect() }
    }

    /// The viewpoint of a training camera.
    pub(crate) fn viewpoint(&self, camera: usize) -> Viewpoint {
        self.viewpoints[camera]
    }

    /// Mean costs at `viewpoints`, from cameras `from`, shrunk towards `shared`.
    pub(crate) fn at(
        &self,
        viewpoints: &[Viewpoint],
        from: &[usize],
        shared: &Estimate,
    ) -> Estimate {
        let count = viewpoints.len().max(1) as f64;
        let mut sums = vec![0.0; from.len()];
        for viewpoint in viewpoints {
            for (sum, camera) in sums.iter_mut().zip(from) {
                let steps = viewpoint.steps(&self.viewpoints[*camera]);
                *sum += f64::from((-steps).exp()) / count;
            }
        }
        let weight = sums.iter().sum();
        let weights: Vec<(usize, f64)> =
            from.iter().copied().zip(sums).filter(|(_, weight)| *weight > 1e-4).collect();
        let total = SHARED_WEIGHT + weights.iter().map(|(_, weight)| weight).sum::<f64>();
        let mean = |setting: usize, value: fn(&CostPoint) -> f64, shared: f64| {
            let sum: f64 = weights
                .iter()
                .map(|(camera, weight)| weight * value(&self.training.costs(*camera)[setting]))
                .sum();
            (sum + SHARED_WEIGHT * shared) / total
        };
        let blend = |(setting, cost): (usize, &CostPoint)| {
            let power =
                mean(setting, |cost| cost.power.0.max(1e-9).ln(), cost.power.0.max(1e-9).ln())
                    .exp();
            CostPoint::new(power, mean(setting, |cost| cost.error, cost.error))
        };
        Estimate { costs: shared.costs.iter().enumerate().map(blend).collect(), weight }
    }
}
