//! What the numbers of a map refer to.

#[cfg(feature = "bevy")]
use bevy_reflect::Reflect;
use glam::Vec3;
use serde::{Deserialize, Serialize};

use super::SharedKnobs;
use crate::units::Watts;

/// Identity of the scene that a map was made for.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "bevy", derive(Reflect))]
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
