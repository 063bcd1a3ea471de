//! What lies between sample cameras: how far predictions were off where nobody had searched.

use bevy::reflect::Reflect;
use serde::{Deserialize, Serialize};

use super::CostPoint;

/// Measured ÷ predicted error at cameras that are no sample cameras.
///
/// A camera of an app stands between corners and looks between axes, and so do its costs; Wang et al. 2016 leave that to finer subdivision. A map
/// made in minutes has few corners. `frugal precompute` therefore gives a frontier the mean costs of the cameras that it serves, and measures at
/// further cameras by which factor most of them stay below; an error budget is tightened by it. It never loosens a budget: a map that promises too
/// little is already safe. Power has no such factor: the app can meter it, and correct itself, while nobody sees the error of a frame that was not
/// also rendered at its best.
#[derive(Clone, Copy, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Correction {
    /// Factor on error that covers [`QUANTILE`](Self::QUANTILE) of the measurements; 1 to [`MAX`](Self::MAX).
    pub error: f64,
    /// Measurements that it comes from; 0 where none were made.
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

    /// A budget is a limit, so most frames should keep it, not the mean alone. Three in four are not enough: on an indoor level the mean then went
    /// over by two fifths, since frames that are over are over by much.
    pub const QUANTILE: f64 = 0.9;

    /// Errors below this look the same; a ratio to a smaller one says nothing.
    pub const LEAST_ERROR: f64 = 1e-3;

    /// From pairs of predicted and measured error. Pairs that are not finite are left out.
    pub fn fit(pairs: &[(f64, f64)]) -> Self {
        let sound = pairs.iter().filter(|(predicted, measured)| predicted.is_finite() && measured.is_finite());
        let mut factors: Vec<f64> = sound.map(|(predicted, measured)| measured / predicted.max(Self::LEAST_ERROR)).collect();
        factors.sort_by(f64::total_cmp);
        let covering = (Self::QUANTILE * factors.len() as f64).ceil() as usize;
        let factor = covering.checked_sub(1).and_then(|index| factors.get(index)).copied().unwrap_or(1.0);
        Self { error: factor.clamp(1.0, Self::MAX), samples: factors.len() as u32 }
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
    fn the_factor_covers_most_measurements_and_never_loosens() {
        // Nine ratios of 1 to 3 and one of 100.
        let mut pairs: Vec<_> = (0..9).map(|i| (0.01, 0.01 * (1.0 + 0.25 * f64::from(i)))).collect();
        pairs.push((0.01, 1.0));
        pairs.push((f64::NAN, 1.0));
        let fitted = Correction::fit(&pairs);
        assert!((fitted.error - 3.0).abs() < 1e-12 && fitted.samples == 10, "{fitted:?}");
        assert_eq!(fitted.predict(CostPoint::new(3.0, 0.01)).power, CostPoint::new(3.0, 0.03).power);
        assert_eq!(Correction::fit(&[(0.1, 0.01)]).error, 1.0);
    }

    #[test]
    fn nothing_measured_and_absurd_ratios_stay_sound() {
        assert_eq!(Correction::fit(&[]), Correction::default());
        let absurd = Correction::fit(&[(0.0, 1.0)]);
        assert_eq!(absurd.error, Correction::MAX);
        assert!(absurd.is_sound() && !Correction { error: f64::NAN, ..Correction::default() }.is_sound());
    }
}
