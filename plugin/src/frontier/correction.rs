//! What lies between sample cameras: how far predictions were off where nobody had searched.

use bevy::reflect::Reflect;
use serde::{Deserialize, Serialize};

use super::CostPoint;
use crate::units::Watts;

/// Measured ÷ predicted cost at cameras that are no sample cameras.
///
/// A camera of an app stands between corners and looks between axes, and so do its costs; Wang et al. 2016 leave that to finer subdivision. A map
/// made in minutes has few corners. What its nearest corner promises is off by a factor that can be measured when the map is made, and then a
/// budget be tightened by it. It never loosens a budget: a map that promises too little is already safe.
#[derive(Clone, Copy, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Correction {
    /// Factor on power; finite, at least 1.
    pub power: f64,
    /// Factor on error; finite, at least 1.
    pub error: f64,
    /// Measurements that it comes from; 0 where none were made.
    pub samples: u32,
}

impl Default for Correction {
    fn default() -> Self {
        Self { power: 1.0, error: 1.0, samples: 0 }
    }
}

impl Correction {
    /// Largest factor: beyond it, something else is wrong with the map.
    pub const MAX: f64 = 8.0;

    /// From pairs of predicted and measured costs: the factor between their sums. Pairs that are not finite are left out.
    pub fn fit(pairs: &[(CostPoint, CostPoint)]) -> Self {
        let sound = || pairs.iter().filter(|(predicted, measured)| predicted.is_finite() && measured.is_finite());
        let factor = |of: fn(&CostPoint) -> f64| {
            let predicted: f64 = sound().map(|(predicted, _)| of(predicted)).sum();
            let measured: f64 = sound().map(|(_, measured)| of(measured)).sum();
            let factor = measured / predicted;
            // NaN where nothing was predicted.
            if factor > 1.0 { factor.min(Self::MAX) } else { 1.0 }
        };
        Self { power: factor(|cost| cost.power.0), error: factor(|cost| cost.error), samples: sound().count() as u32 }
    }

    /// Whether both factors are what they must be.
    pub fn is_sound(self) -> bool {
        let sound = |factor: f64| (1.0..=Self::MAX).contains(&factor);
        sound(self.power) && sound(self.error)
    }

    /// What a frontier's cost should come to in the app.
    #[must_use]
    pub fn predict(self, cost: CostPoint) -> CostPoint {
        CostPoint { power: Watts(cost.power.0 * self.power), error: cost.error * self.error }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_factor_is_that_of_the_sums_and_never_loosens() {
        let pair = |predicted: (f64, f64), measured: (f64, f64)| {
            (CostPoint::new(predicted.0, predicted.1), CostPoint::new(measured.0, measured.1))
        };
        let fitted = Correction::fit(&[pair((2.0, 0.01), (1.0, 0.03)), pair((4.0, 0.03), (4.0, 0.05)), pair((f64::NAN, 0.0), (1.0, 1.0))]);
        assert_eq!(fitted, Correction { power: 1.0, error: 2.0, samples: 2 });
        assert_eq!(fitted.predict(CostPoint::new(3.0, 0.01)), CostPoint::new(3.0, 0.02));
    }

    #[test]
    fn nothing_measured_and_absurd_ratios_stay_sound() {
        assert_eq!(Correction::fit(&[]), Correction::default());
        let absurd = Correction::fit(&[(CostPoint::new(1e-9, 0.0), CostPoint::new(1e9, 1.0))]);
        assert_eq!((absurd.power, absurd.error), (Correction::MAX, Correction::MAX));
        assert!(absurd.is_sound() && !Correction { power: f64::NAN, ..Correction::default() }.is_sound());
    }
}
