//! What lies between sample cameras: how far predictions were off where nobody had searched.

use bevy::reflect::Reflect;
use serde::{Deserialize, Serialize};

use super::CostPoint;

/// Measured ÷ predicted error at cameras that are no sample cameras.
///
/// A camera of an app stands between corners and looks between axes, and so do its costs; Wang et al. 2016 leave that to finer subdivision. A map
/// made in minutes has few corners. `frugal precompute` therefore gives a frontier the mean costs of the cameras that it serves, and measures at
/// further cameras what error budgets get there; an error budget is tightened by a factor that covers most of them. It never loosens a budget: a map that
/// promises too little is already safe. Power has no such factor: the app can meter it, and correct itself, while nobody sees the error of a
/// frame that was not also rendered at its best.
#[derive(Clone, Copy, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Correction {
    /// Factor on error; 1 to [`MAX`](Self::MAX).
    pub error: f64,
    /// Cameras that it comes from; 0 where none were asked.
    pub samples: u32,
}

impl Default for Correction {
    fn default() -> Self {
        Self { error: 1.0, samples: 0 }
    }
}

impl Correction {
    /// Largest factor: beyond it, something else is wrong with the map.
    pub const MAX: f64 = 8.0;

    /// Share of the cameras that the factor covers. What budgets pick is wrong by little at most cameras and by much at few, and a path may
    /// lead past the few: a factor that holds the mean of 24 random cameras let a tour of an arena go over by half.
    pub const QUANTILE: f64 = 0.9;

    /// Errors below this look the same; a ratio to a smaller one says nothing.
    pub const LEAST_ERROR: f64 = 1e-3;

    /// From each camera's predicted and measured error as shares of the budget that picked its settings, so that no prediction is above 1. Cameras with
    /// errors that are not finite are left out.
    ///
    /// The factor covers [`QUANTILE`](Self::QUANTILE) of the cameras' shares of the budget; and the mean of all, with its standard error on top, by the
    /// mean that was predicted. Not the quantile of measured ÷ predicted: what is promised next to nothing is off by any factor, and still
    /// within the budget.
    pub fn fit(cameras: &[(f64, f64)]) -> Self {
        let sound: Vec<_> = cameras.iter().filter(|(predicted, measured)| predicted.is_finite() && measured.is_finite()).collect();
        let count = sound.len() as f64;
        let predicted = sound.iter().map(|camera| camera.0).sum::<f64>() / count;
        let measured = sound.iter().map(|camera| camera.1).sum::<f64>() / count;
        let squares: f64 = sound.iter().map(|camera| (camera.1 - measured).powi(2)).sum();
        let standard_error = if count > 1.0 { (squares / (count * (count - 1.0))).sqrt() } else { 0.0 };
        let of_mean = (measured + standard_error) / predicted.max(Self::LEAST_ERROR);

        let mut shares: Vec<f64> = sound.iter().map(|camera| camera.1).collect();
        shares.sort_by(f64::total_cmp);
        let covering = (Self::QUANTILE * count).ceil() as usize;
        let of_most = covering.checked_sub(1).and_then(|index| shares.get(index)).copied().unwrap_or(1.0);
        // Of no cameras the mean is not a number, which `max` leaves out.
        Self { error: of_mean.max(of_most).clamp(1.0, Self::MAX), samples: sound.len() as u32 }
    }

    /// Whether the factor is what it must be.
    pub fn is_sound(self) -> bool {
        (1.0..=Self::MAX).contains(&self.error)
    }

    /// What a frontier's cost comes to in the app, at the worst that is likely.
    #[must_use]
    pub fn predict(self, cost: CostPoint) -> CostPoint {
        CostPoint { error: cost.error * self.error, ..cost }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_factor_covers_most_cameras_and_the_mean() {
        // Nine of 1 to 3 budgets and one of 4: the mean is 2.2, and most are below 3.
        let mut cameras: Vec<_> = (0..9).map(|i| (1.0, 1.0 + 0.25 * f64::from(i))).collect();
        cameras.extend([(1.0, 4.0), (f64::NAN, 1.0)]);
        let most = Correction::fit(&cameras);
        assert!((most.error - 3.0).abs() < 1e-12 && most.samples == 10, "{most:?}");
        // A mean that one camera makes is covered, too: 1 budget, and a standard error of as much.
        cameras = vec![(1.0, 0.0); 19];
        cameras.push((1.0, 20.0));
        assert!((Correction::fit(&cameras).error - 2.0).abs() < 1e-9, "{:?}", Correction::fit(&cameras));
        // Where half a budget was promised, a mean of a whole one is twice too much.
        assert!((Correction::fit(&[(0.5, 1.0); 9]).error - 2.0).abs() < 1e-12);
        assert_eq!(most.predict(CostPoint::new(3.0, 0.01)).power, CostPoint::new(3.0, 0.01).power);
        assert_eq!(Correction::fit(&[(0.1, 0.01)]).error, 1.0, "never loosens");
    }

    #[test]
    fn nothing_measured_and_absurd_ratios_stay_sound() {
        assert_eq!(Correction::fit(&[]), Correction::default());
        let absurd = Correction::fit(&[(0.0, 1.0)]);
        assert_eq!(absurd.error, Correction::MAX);
        assert!(absurd.is_sound() && !Correction { error: f64::NAN, ..Correction::default() }.is_sound());
    }
}
