//! What the numbers of a map refer to.

use glam::Vec3;
use serde::{Deserialize, Serialize};

use super::{CostPoint, SharedKnobs};
use crate::knobs::KnobSpace;
use crate::units::Watts;

/// Identity of the scene that a map was made for.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "bevy", derive(bevy_reflect::Reflect))]
#[serde(deny_unknown_fields)]
pub struct SceneIdentity {
    /// Name of the scene file, for messages only.
    pub name: String,
    /// Hash of the scene's contents, in hexadecimal. Scenes with equal fingerprints are the same.
    pub fingerprint: String,
}

/// Rendering conditions of the map's power and error.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Capture {
    /// Width and height, in pixels; each at least 1.
    pub size: [u32; 2],
    /// Frame rate that the map's watts refer to, in hertz; finite, above 0.
    pub frames_per_second: f64,
    /// Vertical field of view, in degrees, in (0, 180).
    pub vertical_fov: f32,
    /// Exposure value at ISO 100; finite.
    pub exposure_ev100: f32,
}

/// Largest distance between the frontiers of adjacent corners without subdivision of their octree
/// node (Wang et al. 2016, section 3.5.3).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Thresholds {
    /// Distance in power, in watts; finite, at least 0. Higher values give a smaller, less accurate
    /// map that takes less time to make; lower values a larger, more accurate one.
    pub power_w: f64,
    /// Distance in error (1 − SSIM, no unit); finite, at least 0. Higher values give a smaller,
    /// less accurate map that takes less time to make; lower values a larger, more accurate one.
    pub error: f64,
}

/// The world-space box of the octree's root. A camera outside counts as one at the nearest position
/// inside.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bounds {
    /// Minimum world coordinates, in metres; finite.
    pub min: [f32; 3],
    /// Maximum world coordinates, in metres; finite, each above its `min`.
    pub max: [f32; 3],
}

impl Bounds {
    /// Edge lengths, in metres.
    pub fn extent(&self) -> Vec3 {
        Vec3::from_array(self.max) - Vec3::from_array(self.min)
    }

    /// `position` (world, metres) scaled so that the bounds span 0 to 1 on each axis. Positions
    /// outside are clamped; NaN counts as 0.
    pub fn to_unit(&self, position: Vec3) -> Vec3 {
        let unit = (position - Vec3::from_array(self.min)) / self.extent();
        // Not `clamp`, which passes NaN through.
        Vec3::from_array(unit.to_array().map(|unit| if unit > 0.0 { unit.min(1.0) } else { 0.0 }))
    }

    /// World position of `unit`, in metres: the inverse of [`to_unit`](Self::to_unit), not clamped.
    pub fn from_unit(&self, unit: Vec3) -> Vec3 {
        Vec3::from_array(self.min) + unit * self.extent()
    }
}

/// Energy prices of a frame's work on one device.
///
/// A frontier's energy per frame is the energy of its settings' work at these prices, times a
/// factor that its cameras have in common. For another device, image size or frame rate the map
/// needs no new search: `frugal reprice` recomputes its power.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct WorkPrices {
    /// Names of the kinds of work, counted per frame: pixels, rays, shadow texels and so on.
    pub kinds: Vec<String>,
    /// Energy per unit of each kind, in joules, in the order of `kinds`; finite, at least 0.
    pub joules: Vec<f64>,
    /// Idle power of the device, in watts, as far as the map's power includes it; finite, at least
    /// 0.
    pub idle: Watts,
    /// Number of reflective shadow maps of the scene, without those of point lights.
    pub maps: u32,
    /// Number of point lights of the scene, which have six smaller maps each. 0 where not recorded.
    #[serde(default)]
    pub point_lights: u32,
    /// Whether the scene gathers light from an environment map.
    pub has_sky: bool,
    /// What levels of knobs of app scope cost each camera.
    #[serde(default)]
    pub shared: SharedKnobs,
}

impl WorkPrices {
    /// Whether there is one finite price, 0 or above, for each kind of work.
    pub fn is_sound(&self) -> bool {
        let number = |value: f64| value.is_finite() && value >= 0.0;
        self.kinds.len() == self.joules.len()
            && self.joules.iter().all(|joules| number(*joules))
            && number(self.idle.0)
    }
}

/// Effects of lowering one knob from the best settings, by knob and level, in the order of the map's
/// knobs. For people: the controller does not read them, since effects of several knobs do not add up.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct KnobEffects {
    /// Energy that the level saves in a frame, in joules; finite, at least 0.
    pub joules: Vec<Vec<f64>>,
    /// Mean error (1 − SSIM) of the level at the search's pilot cameras; from 0 to 2.
    pub errors: Vec<Vec<f64>>,
}

impl KnobEffects {
    /// Whether there is nothing, or one valid number for each level of each knob of `space`.
    pub fn is_sound(&self, space: &KnobSpace) -> bool {
        let fits = |values: &[Vec<f64>], most: f64| {
            values.len() == space.len()
                && values.iter().zip(space.knobs()).all(|(values, knob)| {
                    values.len() == knob.levels.len()
                        && values.iter().all(|value| (0.0..=most).contains(value))
                })
        };
        let is_empty = self.joules.is_empty() && self.errors.is_empty();
        is_empty || (fits(&self.joules, f64::MAX) && fits(&self.errors, 2.0))
    }

    /// Power that the `level`-th level of the `knob`-th knob saves at `frames_per_second`, and its
    /// error; `None` where it is not known.
    pub fn of(&self, knob: usize, level: usize, frames_per_second: f64) -> Option<CostPoint> {
        let joules = self.joules.get(knob)?.get(level)?;
        let error = *self.errors.get(knob)?.get(level)?;
        Some(CostPoint { power: Watts(joules * frames_per_second), error })
    }
}

/// A calibrated error budget with its exchange rate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ErrorRate {
    /// Budget of the mean error, 1 − SSIM; finite, above 0.
    pub budget: f64,
    /// Exchange rate λ, in watts per unit of error; finite, at least 0. Higher values select better and
    /// more expensive settings.
    pub watts_per_error: f64,
    /// Mean predicted error at which the measured error just meets the budget: the controller's
    /// target for the mean of its predictions. 1 − SSIM, finite, above 0. `None` where the map has
    /// none: the budget itself is then the target.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub predicted: Option<f64>,
}

/// Exchange rates between power and error under an error budget, by budget: budgets strictly increase,
/// rates never increase. Empty in maps without calibration.
///
/// An error budget limits the mean error of the rendered frames. A mean takes the least power when
/// a watt reduces the error equally everywhere: each camera minimises P + λe with one exchange rate
/// λ (Everett 1963, "Generalized Lagrange multiplier method for solving problems of optimum
/// allocation of resources"). A limit on every frame's error (Wang et al. 2016, equation 3.3)
/// spends most where error is most expensive to reduce.
///
/// Held-out cameras calibrate the λ of each budget: the least at which the mean predicted error,
/// plus an upper confidence bound on the error of predictions, is within the budget
/// (risk-controlling sets; Bates, Angelopoulos, Lei, Malik, Jordan 2021). In play the controller
/// steers λ so that the mean prediction stays at the target.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct ErrorRates(pub Vec<ErrorRate>);

impl ErrorRates {
    /// The largest calibrated budget that is at most `budget` (1 − SSIM). No interpolation: a frontier's
    /// errors are discrete.
    fn within(&self, budget: f64) -> Option<&ErrorRate> {
        let within = self.0.partition_point(|known| known.budget <= budget);
        within.checked_sub(1).and_then(|last| self.0.get(last))
    }

    /// Mean predicted error (1 − SSIM) at which `budget` is just met: that of the largest
    /// calibrated budget within it, scaled in proportion. 0 below the smallest calibrated budget, where
    /// only the best settings are safe. `None` where it is unknown, or `budget` is not finite.
    pub fn target(&self, budget: f64) -> Option<f64> {
        if !budget.is_finite() || self.0.is_empty() {
            return None;
        }
        let Some(known) = self.within(budget) else { return Some(0.0) };
        known.predicted.map(|predicted| predicted * budget / known.budget)
    }

    /// Whether budgets strictly increase, rates never increase, and all values are in their ranges.
    pub fn is_sound(&self) -> bool {
        let number = |rate: &ErrorRate| {
            let predicted = rate.predicted.is_none_or(|error| error > 0.0 && error.is_finite());
            rate.budget > 0.0
                && rate.budget.is_finite()
                && rate.watts_per_error >= 0.0
                && rate.watts_per_error.is_finite()
                && predicted
        };
        self.0.iter().all(number)
            && self.0.windows(2).all(|two| {
                two[0].budget < two[1].budget && two[0].watts_per_error >= two[1].watts_per_error
            })
    }
}

#[cfg(test)]
#[path = "metadata_tests.rs"]
mod tests;
