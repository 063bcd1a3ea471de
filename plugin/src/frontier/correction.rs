//! What lies between sample cameras: how far predictions were off where nobody had searched.

use bevy::reflect::Reflect;
use serde::{Deserialize, Serialize};

use super::CostPoint;

/// Measured ÷ predicted error at cameras that are no sample cameras.
///
/// A camera of an app stands between corners and looks between axes, and so do its costs; Wang et al. 2016 leave that to finer subdivision. A map
/// made in minutes has few corners. `frugal precompute` therefore gives a frontier the mean costs of the cameras that it serves, and measures at
/// further cameras what error budgets get there; an error budget is tightened by the factor by which their mean is over. It never loosens a budget: a
/// map that promises too little is already safe. Power has no such factor: the app can meter it, and correct itself, while nobody sees the error
/// of a frame that was not also rendered at its best.
///
/// It is the *mean* error of a run that is held, as it is mean power. A factor that covers nine frames in ten leaves so little of a budget that it buys
/// nothing but the best settings.
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

    /// Errors below this look the same; a ratio to a smaller one says nothing.
    pub const LEAST_ERROR: f64 = 1e-3;

    /// From each camera's predicted and measured error, in any unit that all share. Cameras with errors that are not finite are left out.
    ///
    /// The mean that was measured, and its standard error on top, ÷ the mean that was predicted: few cameras that differ much say little, and make
    /// the factor larger.
    pub fn fit(cameras: &[(f64, f64)]) -> Self {
        let sound: Vec<_> = cameras.iter().filter(|(predicted, measured)| predicted.is_finite() && measured.is_finite()).collect();
        let count = sound.len() as f64;
        let predicted = sound.iter().map(|camera| camera.0).sum::<f64>() / count;
        let measured = sound.iter().map(|camera| camera.1).sum::<f64>() / count;
        let squares: f64 = sound.iter().map(|camera| (camera.1 - measured).powi(2)).sum();
        let standard_error = if count > 1.0 { (squares / (count * (count - 1.0))).sqrt() } else { 0.0 };
        let factor = (measured + standard_error) / predicted.max(Self::LEAST_ERROR);
        // Of no cameras it is not a number.
        let factor = if factor.is_finite() { factor } else { 1.0 };
        Self { error: factor.clamp(1.0, Self::MAX), samples: sound.len() as u32 }
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
    fn the_factor_is_that_of_the_means_and_their_uncertainty() {
        let alike = Correction::fit(&[(0.01, 0.02); 9]);
        assert!((alike.error - 2.0).abs() < 1e-12 && alike.samples == 9, "{alike:?}");
        // Means of 0.01 and 0.02; a standard deviation of 0.02 over the root of 4.
        let spread = Correction::fit(&[(0.01, 0.0), (0.01, 0.0), (0.01, 0.04), (0.01, 0.04), (f64::NAN, 1.0)]);
        let standard_error = (4.0 * 0.0004f64 / 3.0).sqrt() / 2.0;
        assert!((spread.error - (2.0 + 100.0 * standard_error)).abs() < 1e-9 && spread.samples == 4, "{spread:?}");
        assert_eq!(alike.predict(CostPoint::new(3.0, 0.01)), CostPoint::new(3.0, 0.02));
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
