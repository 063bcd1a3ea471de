//! The frontier map: the octree of frontiers with everything that makes its numbers mean something.

use bevy::asset::Asset;
use bevy::math::Vec3;
use bevy::reflect::Reflect;
use serde::{Deserialize, Serialize};

use super::{ErrorRates, Frontier, FrontierMapError, Octree};
use crate::knobs::KnobSpace;
use crate::power::MeterInfo;
use crate::units::Watts;

/// Which scene a map was made for.
#[derive(Clone, Debug, Default, PartialEq, Eq, Reflect, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneIdentity {
    /// For people: the scene file's name.
    pub name: String,
    /// A hash of the scene's contents, in hexadecimal. Two scenes are the same when their
    /// fingerprints are.
    pub fingerprint: String,
}

/// How the pictures were rendered whose power and error the map holds.
#[derive(Clone, Copy, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Capture {
    /// Width and height, in pixels; neither is 0.
    pub size: [u32; 2],
    /// The frame rate that watts refer to, in hertz; finite and above 0.
    pub frames_per_second: f64,
    /// Vertical field of view, in degrees, in (0, 180).
    pub vertical_fov: f32,
    /// Exposure value at ISO 100; finite.
    pub exposure_ev100: f32,
}

/// How different the frontiers of adjacent corners may be before their node is subdivided (Wang et
/// al. 2016, section 3.5.3).
#[derive(Clone, Copy, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Thresholds {
    /// Distance in power, in watts; finite, at least 0. Higher values give a smaller and less exact
    /// map.
    pub power_w: f64,
    /// Distance in error, without unit; finite, at least 0. Higher values give a smaller and less
    /// exact map.
    pub error: f64,
}

/// The part of the world that the octree's root spans. A camera outside is treated as one at the
/// nearest position inside.
#[derive(Clone, Copy, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bounds {
    /// Least world coordinates, in metres.
    pub min: [f32; 3],
    /// Greatest world coordinates, in metres; each above its `min`.
    pub max: [f32; 3],
}

impl Bounds {
    /// Edge lengths, in metres.
    pub fn extent(&self) -> Vec3 {
        Vec3::from_array(self.max) - Vec3::from_array(self.min)
    }

    /// `position` with the bounds at 0 to 1 on each axis. What is outside is clamped; NaN counts as
    /// the least coordinate.
    pub fn to_unit(&self, position: Vec3) -> Vec3 {
        let unit = (position - Vec3::from_array(self.min)) / self.extent();
        // Not `clamp`, which lets NaN pass.
        Vec3::from_array(unit.to_array().map(|unit| if unit > 0.0 { unit.min(1.0) } else { 0.0 }))
    }

    /// The world position of `unit`: the opposite of [`to_unit`](Self::to_unit).
    pub fn from_unit(&self, unit: Vec3) -> Vec3 {
        Vec3::from_array(self.min) + unit * self.extent()
    }
}

/// Prices of a frame's work on one device: what turns work into energy.
///
/// A frontier's energy per frame is that of its settings' work at these prices, times what its
/// cameras have in common beyond that. At another device's prices, another size or another frame
/// rate, the map needs no new search: `frugal reprice` works its power out anew.
#[derive(Clone, Debug, Default, PartialEq, Reflect, Serialize, Deserialize)]
pub struct WorkPrices {
    /// Kinds of work, by name: pixels, rays, shadow texels and so on, counted in each frame.
    pub kinds: Vec<String>,
    /// Joules for one of each; finite, at least 0.
    pub joules: Vec<f64>,
    /// Power of the device while nothing is rendered, as far as the map's watts hold it; finite, at
    /// least 0.
    pub idle: Watts,
    /// Reflective shadow maps of the scene.
    pub maps: u32,
    /// Whether a sky is gathered.
    pub has_sky: bool,
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

/// Pareto frontiers of sample cameras all over a scene (Wang et al. 2016, section 3.5), with what
/// they were measured on.
///
/// Written by `frugal precompute` as `*.pareto.ron`, loaded as a Bevy asset. The fields are open so
/// that tools can build and inspect maps; a map that did not come from [`from_ron`](Self::from_ron)
/// should be [validated](Self::validate). Look-ups never panic, valid or not.
///
/// Fields that a later version adds are passed over by an earlier one, and those that an earlier
/// one lacks have defaults.
#[derive(Asset, Clone, Debug, PartialEq, Reflect, Serialize, Deserialize)]
pub struct FrontierMap {
    /// Version of the format: [`VERSION`](Self::VERSION).
    pub version: u32,
    /// The scene.
    pub scene: SceneIdentity,
    /// How its pictures were rendered.
    pub capture: Capture,
    /// Where the watts come from.
    pub meter: MeterInfo,
    /// How fine the octree is.
    pub thresholds: Thresholds,
    /// Seed of the search: the same seed, scene and meter readings give the same map.
    pub seed: u64,
    /// The knobs that the frontiers' settings set. Knobs of the app that are not among them stay as
    /// they are.
    pub knobs: KnobSpace,
    /// Where cameras go.
    pub bounds: Bounds,
    /// The frontier of all training cameras together: what holds where nothing better is known.
    /// Empty in maps of earlier versions.
    #[serde(default)]
    pub shared: Frontier,
    /// What error is worth under an error budget. Empty in maps of earlier versions, whose error
    /// budgets limit every frame.
    #[serde(default)]
    pub error_rates: ErrorRates,
    /// Prices of work on the device that the map was made on. Empty in maps of earlier versions.
    #[serde(default)]
    pub work_prices: WorkPrices,
    /// The frontiers.
    pub octree: Octree,
}

/// All that is read of a file before its version is known to be ours.
#[derive(Deserialize)]
struct VersionOnly {
    version: u32,
}

impl FrontierMap {
    /// The version of the format that this build reads and writes.
    pub const VERSION: u32 = 1;

    /// Reads a map and validates it.
    ///
    /// # Errors
    /// When the text is no map, cut off, of another version, or contradicts itself.
    pub fn from_ron(text: &str) -> Result<Self, FrontierMapError> {
        // The version comes first and alone, so that a newer map is called newer and not wrong for
        // a field that this build does not know.
        let VersionOnly { version } = ron::from_str(text)?;
        FrontierMapError::check_version(version)?;
        let map: Self = ron::from_str(text)?;
        map.validate()?;
        Ok(map)
    }

    /// The map as text: a frontier, a corner and a node to a line, so that differences can be read.
    /// Numbers are rounded as [`Frontier::rounded`](super::Frontier::rounded) says.
    ///
    /// # Errors
    /// None for a map of this crate's types; the serialiser's, if it has any.
    pub fn to_ron(&self) -> Result<String, FrontierMapError> {
        let layout =
            ron::ser::PrettyConfig::new().depth_limit(3).indentor("").separator("").new_line("\n");
        let mut text = ron::ser::to_string_pretty(self, layout)
            .map_err(|error| FrontierMapError::Unwritable { reason: error.to_string() })?;
        text.push('\n');
        Ok(text)
    }

    /// Checks everything that the controller relies on.
    ///
    /// # Errors
    /// The first fault: a wrong version, a number out of its range, an octree that is none, or
    /// settings that the knobs do not have.
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
        let sound = self.error_rates.is_sound();
        check(
            "error_rates",
            &self.error_rates,
            sound,
            "budgets that rise, with finite rates of at least 0 that do not",
        )?;
        let sound = self.work_prices.is_sound();
        check(
            "work_prices",
            &self.work_prices,
            sound,
            "as many kinds as prices, all finite and at least 0",
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

    /// Checks that this map was made for `scene`. Names may differ: a scene that was only renamed
    /// is still the same.
    ///
    /// # Errors
    /// When the fingerprints differ.
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
