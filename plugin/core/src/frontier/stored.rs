//! A map as its file stores it: a list of all settings, and their index at each frontier point.
//!
//! Packed settings take up to 16 digits and occur in most frontiers: written out at every point they
//! were half of a file.

use serde::{Deserialize, Serialize};

use super::{
    Bounds, Capture, ErrorRates, Frontier, FrontierMap, FrontierMapError, FrontierPoint,
    KnobEffects, Octree, SceneIdentity, Thresholds, WorkPrices,
};
use crate::knobs::{KnobLevels, KnobSpace};
use crate::power::MeterInfo;

/// The fields of a [`FrontierMap`] in the order of its file, with the list of settings.
#[derive(Serialize, Deserialize)]
#[serde(rename = "FrontierMap")]
pub struct StoredMap {
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
            *frontier = with_settings(frontier, at).ok_or(FrontierMapError::UnlistedSettings {
                frontier: number,
                count: settings.len(),
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
mod tests {
    use super::super::testing;
    use super::*;

    #[test]
    fn an_index_beyond_the_list_is_one_clear_error() {
        let text = testing::map(1).to_ron().expect("writable");
        let start = text.find("settings:[\n").expect("a list");
        let end = start + text[start..].find("],\n").expect("its end");
        let emptied = format!("{}settings:[\n{}", &text[..start], &text[end..]);
        let error = FrontierMap::from_ron(&emptied).expect_err("no settings");
        assert_eq!(error, FrontierMapError::UnlistedSettings { frontier: 0, count: 0 });
        assert!(error.to_string().contains("frugal precompute"), "{error}");
    }

    #[test]
    fn settings_are_written_once() {
        let text = testing::map(3).to_ron().expect("writable");
        let map = FrontierMap::from_ron(&text).expect("readable");
        let start = text.find("settings:[\n").expect("a list");
        let list = text[start..].lines().skip(1).take_while(|line| *line != "],").count();
        assert_eq!(list, map.settings().len());
    }
}
