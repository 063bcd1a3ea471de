//! The frontier map: the octree of frontiers with the metadata that its numbers refer to.

#[cfg(feature = "bevy")]
use bevy_reflect::Reflect;
use std::collections::BTreeSet;

use glam::Vec3;
use serde::{Deserialize, Serialize};

use super::stored::StoredMap;
use super::{ErrorRates, Frontier, FrontierMapError, KnobEffects, Octree, SharedKnobs};
use crate::knobs::{KnobLevels, KnobSpace};
use crate::power::MeterInfo;
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
    /// Number of point lights of the scene, which have six smaller maps each. 0 in maps of earlier
    /// versions.
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

/// Pareto frontiers of sample cameras throughout a scene (Wang et al. 2016, section 3.5), with the
/// conditions of their measurement.
///
/// Written by `frugal precompute` as `*.pareto.ron`, loaded as a Bevy asset. The fields are public
/// so that tools can build and inspect maps; a map that does not come from
/// [`from_ron`](Self::from_ron) should be [validated](Self::validate). Look-ups never panic, even
/// in an invalid map.
///
/// Unknown fields are ignored.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "asset", derive(bevy_asset::Asset, bevy_reflect::TypePath))]
#[serde(try_from = "StoredMap", into = "StoredMap")]
pub struct FrontierMap {
    /// Version of the format; valid is [`VERSION`](Self::VERSION) only, which a map that was read has.
    pub version: u32,
    /// The scene.
    pub scene: SceneIdentity,
    /// Rendering conditions of its power and error.
    pub capture: Capture,
    /// The power meter, measured or modelled.
    pub meter: MeterInfo,
    /// Subdivision thresholds of the octree.
    pub thresholds: Thresholds,
    /// Random seed of the search: the same seed, scene and meter readings give the same map.
    pub seed: u64,
    /// The knobs of the frontiers' settings. Other knobs of the app stay unchanged.
    pub knobs: KnobSpace,
    /// World-space bounds of the camera positions.
    pub bounds: Bounds,
    /// Frontier over all training cameras together: the fallback where no local frontier is known.
    pub shared: Frontier,
    /// Calibrated exchange rates of error budgets. Where empty, they limit every frame.
    pub error_rates: ErrorRates,
    /// Energy prices of work on the map's device.
    pub work_prices: WorkPrices,
    /// What each knob saves and costs alone.
    pub knob_effects: KnobEffects,
    /// The frontiers by camera position and view direction.
    pub octree: Octree,
}

/// The only field that is read before the version check.
#[derive(Deserialize)]
struct VersionOnly {
    version: u32,
}

impl FrontierMap {
    /// The version of the format that this build reads and writes.
    pub const VERSION: u32 = 1;

    /// Parses and validates a map.
    ///
    /// # Errors
    /// [`FrontierMapError`] when the text is not a map, is truncated, is of another version, or
    /// fails [validation](Self::validate).
    pub fn from_ron(text: &str) -> Result<Self, FrontierMapError> {
        // The version is checked alone first, so that a newer map is reported as newer and not as
        // one with an unknown field.
        let VersionOnly { version } = ron::from_str(text)?;
        FrontierMapError::check_version(version)?;
        let map: Self = ron::from_str::<StoredMap>(text)?.try_into()?;
        map.validate()?;
        Ok(map)
    }

    /// The map as RON text: one frontier, corner, node or settings per line, so that diffs are readable.
    /// Numbers are rounded as [`Frontier::rounded`](super::Frontier::rounded) says.
    ///
    /// # Errors
    /// [`FrontierMapError::Unwritable`] when the serialiser fails, which it does not for this
    /// crate's types.
    pub fn to_ron(&self) -> Result<String, FrontierMapError> {
        let layout =
            ron::ser::PrettyConfig::new().depth_limit(3).indentor("").separator("").new_line("\n");
        let mut text = ron::ser::to_string_pretty(self, layout)
            .map_err(|error| FrontierMapError::Unwritable { reason: error.to_string() })?;
        text.push('\n');
        Ok(text)
    }

    /// All settings that the map may select, each once, in ascending order.
    pub fn settings(&self) -> BTreeSet<KnobLevels> {
        std::iter::once(&self.shared)
            .chain(&self.octree.frontiers)
            .flat_map(|frontier| frontier.points().iter().map(|point| point.settings))
            .collect()
    }

    /// Checks everything that the controller relies on: version, ranges, octree, settings and
    /// costs.
    ///
    /// # Errors
    /// The first fault found: another version, a number out of range, an invalid octree, or
    /// settings with a level that the knobs lack.
    pub fn validate(&self) -> Result<(), FrontierMapError> {
        FrontierMapError::check_version(self.version)?;
        let Capture { size, frames_per_second, vertical_fov, exposure_ev100 } = self.capture;
        check("capture.size", size, size[0] > 0 && size[1] > 0, "two numbers above 0")?;
        let positive = frames_per_second.is_finite() && frames_per_second > 0.0;
        check("capture.frames_per_second", frames_per_second, positive, "finite and above 0")?;
        check(
            "capture.vertical_fov",
            vertical_fov,
            vertical_fov > 0.0 && vertical_fov < 180.0,
            "above 0 and below 180 degrees",
        )?;
        check("capture.exposure_ev100", exposure_ev100, exposure_ev100.is_finite(), "finite")?;
        let Thresholds { power_w, error } = self.thresholds;
        check(
            "thresholds.power_w",
            power_w,
            power_w.is_finite() && power_w >= 0.0,
            "finite and at least 0",
        )?;
        check(
            "thresholds.error",
            error,
            error.is_finite() && error >= 0.0,
            "finite and at least 0",
        )?;
        let Bounds { min, max } = self.bounds;
        check("bounds.min", min, min.iter().all(|coordinate| coordinate.is_finite()), "finite")?;
        check("bounds.max", max, max.iter().all(|coordinate| coordinate.is_finite()), "finite")?;
        let extent = self.bounds.extent();
        check(
            "bounds",
            self.bounds,
            extent.is_finite() && extent.min_element() > 0.0,
            "of an extent above 0 on each axis",
        )?;
        let valid = self.error_rates.is_sound();
        check(
            "error_rates",
            &self.error_rates,
            valid,
            "increasing budgets with finite, non-increasing rates of at least 0",
        )?;
        let valid = self.work_prices.is_sound();
        check(
            "work_prices",
            &self.work_prices,
            valid,
            "as many kinds as prices, all finite and at least 0",
        )?;
        check(
            "work_prices.shared",
            &self.work_prices.shared,
            self.work_prices.shared.is_sound(&self.knobs),
            "at most four of the map's knobs, with a finite energy of at least 0 for each combination of levels",
        )?;
        check(
            "knob_effects",
            &self.knob_effects,
            self.knob_effects.is_sound(&self.knobs),
            "a finite energy of at least 0 and an error from 0 to 2 for each level of each knob",
        )?;
        self.octree.validate()?;
        self.validate_frontiers()
    }

    fn validate_frontiers(&self) -> Result<(), FrontierMapError> {
        for (frontier, points) in self.octree.frontiers.iter().chain([&self.shared]).enumerate() {
            for point in points.points() {
                let bits = point.settings.bits();
                if !self.knobs.contains(point.settings) {
                    return Err(FrontierMapError::UnknownSettings { frontier, bits });
                }
                let (power_w, error) = (point.cost.power.0, point.cost.error);
                if !(power_w.is_finite() && power_w >= 0.0 && (0.0..=2.0).contains(&error)) {
                    return Err(FrontierMapError::ImpossibleCost { frontier, power_w, error });
                }
            }
        }
        Ok(())
    }

    /// Checks that this map was made for `scene`. Only fingerprints count: a renamed scene is still
    /// the same.
    ///
    /// # Errors
    /// [`FrontierMapError::OtherScene`] when the fingerprints differ.
    pub fn matches_scene(&self, scene: &SceneIdentity) -> Result<(), FrontierMapError> {
        if self.scene.fingerprint == scene.fingerprint {
            return Ok(());
        }
        Err(FrontierMapError::OtherScene { map: self.scene.clone(), scene: scene.clone() })
    }
}

fn check(
    field: &'static str,
    value: impl std::fmt::Debug,
    holds: bool,
    expected: &'static str,
) -> Result<(), FrontierMapError> {
    if holds {
        Ok(())
    } else {
        Err(FrontierMapError::OutOfRange { field, value: format!("{value:?}"), expected })
    }
}

#[cfg(test)]
#[path = "map_tests.rs"]
mod tests;
