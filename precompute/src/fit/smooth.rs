//! What settings cost at a view, from cameras near it: kernel regression (Nadaraya 1964, Watson
//! 1964).
//!
//! A camera that was rendered tells of views metres and tens of degrees away. On 13 frames of a
//! tour, 13 training cameras smoothed so picked settings for 10.9 W, in the mean over nine error
//! budgets, where the best constants took 13.5 W and the best of every frame 10.4 W. Errors are
//! averaged as they are: budgets hold for their mean, of which a mean of logarithms falls short the
//! more views differ.

use bevy::math::Vec3;
use bevy_frugal_gi::frontier::{CameraView, CostPoint};

use super::estimate::{Estimate, Training};

/// Metres, and radians of turning, that count as one step away.
const STEP: (f32, f32) = (2.0, 0.7);
/// Steps at which a camera counts for 1/e: as far as the second nearest camera is, within these.
/// Narrow where cameras are dense, wide where they are rare (Breiman, Meisel, Purcell 1977).
const REACH: (f32, f32) = (0.3, 2.0);
/// What all cameras together count for, where one at the very place counts for 1.
const SHARED_WEIGHT: f64 = 0.1;

/// Where a camera is, and where it looks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    position: Vec3,
    forward: Vec3,
}

impl From<&CameraView> for Place {
    fn from(view: &CameraView) -> Self {
        Self { position: view.position, forward: view.rotation * Vec3::NEG_Z }
    }
}

impl Place {
    /// How far apart two views are, in steps. Infinite where that is no number.
    fn steps(&self, other: &Self) -> f32 {
        let metres = self.position.distance(other.position) / STEP.0;
        let turn = self.forward.angle_between(other.forward) / STEP.1;
        if (metres + turn).is_finite() { metres + turn } else { f32::INFINITY }
    }
}

/// Estimates anywhere from the training cameras.
#[derive(Clone, Debug)]
pub struct Smoother<'a> {
    training: &'a Training,
    places: Vec<Place>,
}

impl<'a> Smoother<'a> {
    /// Over `training`, whose cameras have these views.
    pub fn new(training: &'a Training, views: &[CameraView]) -> Self {
        Self { training, places: views.iter().map(Place::from).collect() }
    }

    /// Where a training camera is.
    pub fn place(&self, camera: usize) -> Place {
        self.places[camera]
    }

    /// What settings cost at `places`, in the mean, from cameras `from`, drawn towards `shared`.
    pub fn at(&self, places: &[Place], from: &[usize], shared: &Estimate) -> Estimate {
        let count = places.len().max(1) as f64;
        let mut sums = vec![0.0; from.len()];
        // How many cameras are here: one a step away counts for 1/e, however rare cameras are.
        let mut presence = 0.0;
        for place in places {
            let steps: Vec<f32> =
                from.iter().map(|camera| place.steps(&self.places[*camera])).collect();
            presence += steps.iter().map(|steps| f64::from((-steps).exp())).sum::<f64>();
            let reach = reach(&steps);
            sums.iter_mut()
                .zip(&steps)
                .for_each(|(sum, steps)| *sum += f64::from((-steps / reach).exp()) / count);
        }
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
        Estimate {
            costs: shared.costs.iter().enumerate().map(blend).collect(),
            weight: presence / count,
        }
    }
}

/// Steps at which a camera counts for 1/e, where cameras are this many steps away.
fn reach(steps: &[f32]) -> f32 {
    let mut sorted = steps.to_vec();
    sorted.sort_by(f32::total_cmp);
    let second = sorted.get(1).or(sorted.first()).copied().unwrap_or(REACH.1);
    second.clamp(REACH.0, REACH.1)
}
