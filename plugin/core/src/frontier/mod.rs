//! Pareto frontiers and the map that stores one for every sample camera: the octree of frontiers with
//! the metadata that its numbers refer to.
//!
//! The file lists all settings once, and frontier points refer to them by index: packed settings
//! take up to 16 digits and occur in most frontiers.

mod conditions;
mod metadata;
mod octree;
mod pareto;
mod shared_knobs;
mod store;
mod validate;
mod view;
mod view_cube;

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};

use crate::knobs::{KnobLevels, KnobSpace};
use crate::power::MeterInfo;

pub use conditions::{AppConditions, Conditions, MapFit, Misfit, ShownScene};
pub use metadata::{
    Bounds, Capture, ErrorRate, ErrorRates, KnobEffects, SceneIdentity, Thresholds, WorkPrices,
};
pub use octree::{Corner, Leaf, Octree};
pub use pareto::{CostPoint, Frontier, FrontierPoint};
pub use shared_knobs::{SharedKnobs, SharedLevels};
pub use store::{Address, FrontierStore, SampleCamera, SampleRef, address_in, look_up_in};
pub use validate::FrontierMapError;
use validate::VERSION;
pub use view::{CUT_DISTANCE, CameraView, ViewDirection, is_cut};

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
    /// Calibrated error budgets. Where empty, predicted errors are taken as they are.
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
    pub const VERSION: u32 = VERSION;

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
    /// Numbers are rounded as [`Frontier::rounded`] says.
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

/// The fields of a [`FrontierMap`] in the order of its file, with the list of settings.
#[derive(Serialize, Deserialize)]
#[serde(rename = "FrontierMap")]
struct StoredMap {
    version: u32,
    scene: SceneIdentity,
    capture: Capture,
    meter: MeterInfo,
    thresholds: Thresholds,
    seed: u64,
    knobs: KnobSpace,
    bounds: Bounds,
    /// All settings of the frontiers, in ascending order.
    settings: Vec<KnobLevels>,
    shared: Frontier,
    error_rates: ErrorRates,
    work_prices: WorkPrices,
    knob_effects: KnobEffects,
    octree: Octree,
}

/// The frontier with other settings at the same costs; `None` where one has no counterpart.
fn with_settings(
    frontier: &Frontier,
    other: impl Fn(KnobLevels) -> Option<KnobLevels>,
) -> Option<Frontier> {
    let points = frontier.points().iter();
    let points: Option<Vec<FrontierPoint>> = points
        .map(|point| other(point.settings).map(|settings| FrontierPoint { settings, ..*point }))
        .collect();
    points.map(Frontier::from_points)
}

impl From<FrontierMap> for StoredMap {
    fn from(mut map: FrontierMap) -> Self {
        // Rounding drops points, and with them settings that only they have.
        for frontier in map.octree.frontiers.iter_mut().chain([&mut map.shared]) {
            *frontier = frontier.rounded();
        }
        let settings: Vec<KnobLevels> = map.settings().into_iter().collect();
        let index = |one: KnobLevels| {
            let index = settings.binary_search(&one).ok()?;
            Some(KnobLevels::from_bits(index as u128))
        };
        for frontier in map.octree.frontiers.iter_mut().chain([&mut map.shared]) {
            // Every settings is in the list, which was made of these frontiers.
            if let Some(indexed) = with_settings(frontier, index) {
                *frontier = indexed;
            }
        }
        Self {
            version: map.version,
            scene: map.scene,
            capture: map.capture,
            meter: map.meter,
            thresholds: map.thresholds,
            seed: map.seed,
            knobs: map.knobs,
            bounds: map.bounds,
            settings,
            shared: map.shared,
            error_rates: map.error_rates,
            work_prices: map.work_prices,
            knob_effects: map.knob_effects,
            octree: map.octree,
        }
    }
}

impl TryFrom<StoredMap> for FrontierMap {
    type Error = FrontierMapError;

    fn try_from(stored: StoredMap) -> Result<Self, FrontierMapError> {
        FrontierMapError::check_version(stored.version)?;
        let StoredMap { mut shared, mut octree, settings, .. } = stored;
        let at = |index: KnobLevels| settings.get(usize::try_from(index.bits()).ok()?).copied();
        for (number, frontier) in octree.frontiers.iter_mut().chain([&mut shared]).enumerate() {
            *frontier = with_settings(frontier, at).ok_or_else(|| {
                let count = settings.len();
                FrontierMapError::Invalid(format!(
                    "frontier {number} has settings beyond the {count} that the map lists"
                ))
            })?;
        }
        Ok(Self {
            version: stored.version,
            scene: stored.scene,
            capture: stored.capture,
            meter: stored.meter,
            thresholds: stored.thresholds,
            seed: stored.seed,
            knobs: stored.knobs,
            bounds: stored.bounds,
            shared,
            error_rates: stored.error_rates,
            work_prices: stored.work_prices,
            knob_effects: stored.knob_effects,
            octree,
        })
    }
}

#[cfg(test)]
#[path = "map_tests.rs"]
mod tests;
