//! Presets for a settings menu, from a map's shared frontier instead of by hand.
//!
//! Constants that nothing beats over the scene's cameras, for apps that want a menu beside or in
//! place of the controller.

use std::collections::BTreeMap;

use bevy_frugal_gi::frontier::{
    Capture, FrontierMap, FrontierMapError, FrontierPoint, SceneIdentity,
};
use bevy_frugal_gi::knobs::{Knob, KnobSpace, RenderSettings};
use bevy_frugal_gi::power::MeterInfo;
use serde::{Deserialize, Serialize};

/// The presets, cheapest first.
pub const PRESET_NAMES: [&str; 5] = ["battery", "low", "medium", "high", "ultra"];

/// Errors above it are seen at once: the cheapest preset has less, where anything has.
const WORST_SHIPPED: f64 = 0.05;

/// A file of presets.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Presets {
    /// The scene that they are for.
    pub scene: SceneIdentity,
    /// The images that watts and errors are of.
    pub capture: Capture,
    /// Where the watts come from.
    pub meter: MeterInfo,
    /// The presets, cheapest first: power never falls, error never rises.
    pub presets: Vec<Preset>,
}

/// Settings with a name.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Preset {
    /// One of [`PRESET_NAMES`].
    pub name: String,
    /// Predicted power, mean over the map's cameras, in watts.
    pub power_w: f64,
    /// Predicted error, mean over the map's cameras.
    pub error: f64,
    /// A level's label for each knob's name. Knobs that are not here are meant to be at their best.
    pub settings: BTreeMap<String, String>,
}

/// Why a map gives no presets.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PresetsError {
    /// The map contradicts itself.
    #[error(transparent)]
    Broken(#[from] FrontierMapError),
    /// A map of an earlier version, or of a scene that no camera sees.
    #[error("the map has no shared frontier to take presets from: run `frugal precompute` again")]
    NoSharedFrontier,
    /// A label that tells nothing.
    #[error(
        "knob `{knob}` has two levels called `{label}`: give them labels of their own, then run `frugal precompute` again"
    )]
    AmbiguousLevel {
        /// The knob.
        knob: String,
        /// The label.
        label: String,
    },
    /// The serialiser failed.
    #[error("presets cannot be written: {reason}")]
    Unwritable {
        /// What it said.
        reason: String,
    },
}

/// The presets of `map`.
///
/// `ultra` is the best that there is. `battery` is the cheapest with an error of at most 0.05, or
/// the cheapest of all where nothing is that good. Each costs about the same share more than the
/// one before. No two are equal where the frontier has five points or more, for which `battery` may
/// be worse.
///
/// # Errors
/// When the map contradicts itself, has no shared frontier, or labels that tell nothing.
pub fn presets(map: &FrontierMap) -> Result<Presets, PresetsError> {
    map.validate()?;
    let points = map.shared.points();
    let chosen = choose(points).ok_or(PresetsError::NoSharedFrontier)?;
    let preset = |(name, index): (&str, usize)| {
        let FrontierPoint { settings, cost } = points[index];
        Ok(Preset {
            name: name.to_owned(),
            power_w: cost.power.0,
            error: cost.error,
            settings: labels(&map.knobs, settings)?,
        })
    };
    let presets =
        PRESET_NAMES.into_iter().zip(chosen).map(preset).collect::<Result<_, PresetsError>>()?;
    Ok(Presets {
        scene: map.scene.clone(),
        capture: map.capture,
        meter: map.meter.clone(),
        presets,
    })
}

impl Presets {
    /// As text, a knob to a line.
    ///
    /// # Errors
    /// None for these types; the serialiser's, if it has any.
    pub fn to_ron(&self) -> Result<String, PresetsError> {
        let text = ron::ser::to_string_pretty(self, ron::ser::PrettyConfig::new().new_line("\n"));
        text.map(|text| text + "\n")
            .map_err(|error| PresetsError::Unwritable { reason: error.to_string() })
    }
}

/// Indices of a frontier's points, one for each name, none below the one before; `None` of an empty
/// frontier.
fn choose(points: &[FrontierPoint]) -> Option<[usize; PRESET_NAMES.len()]> {
    const LAST: usize = PRESET_NAMES.len() - 1;
    let best = points.len().checked_sub(1)?;
    if best < LAST {
        // Too few for all to differ: spread as evenly as they go.
        return Some(std::array::from_fn(|number| (number * best + LAST / 2) / LAST));
    }
    let good = points.partition_point(|point| point.cost.error > WORST_SHIPPED);
    let first = if good > best { 0 } else { good.min(best - LAST) };
    let power = |index: usize| points[index].cost.power.0;
    let (low, high) = (power(first), power(best));
    let mut chosen = [first; LAST + 1];
    for number in 1..LAST {
        let share = number as f64 / LAST as f64;
        // The same factor from each to the next; the same difference where nothing can be a factor
        // of 0 W.
        let wanted =
            if low > 0.0 { low * (high / low).powf(share) } else { low + share * (high - low) };
        // As many points are left above as there are presets to come.
        let free = chosen[number - 1] + 1..=best - (LAST - number);
        let distance = |index: &usize| (power(*index) - wanted).abs();
        chosen[number] = free.min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
    }
    chosen[LAST] = best;
    Some(chosen)
}

/// The labels of `settings` by knob.
fn labels(
    space: &KnobSpace,
    settings: RenderSettings,
) -> Result<BTreeMap<String, String>, PresetsError> {
    let pair = |(index, knob): (usize, &Knob)| {
        let label = &knob.levels.get(settings.level(index))?.label;
        let same = knob.levels.iter().filter(|level| level.label == *label).count();
        let ambiguous =
            || PresetsError::AmbiguousLevel { knob: knob.name.clone(), label: label.clone() };
        Some(if same == 1 { Ok((knob.name.clone(), label.clone())) } else { Err(ambiguous()) })
    };
    space.knobs().iter().enumerate().filter_map(pair).collect()
}

#[cfg(test)]
mod tests {
    use bevy_frugal_gi::frontier::{CostPoint, Frontier};

    use super::super::testing::map;
    use super::*;

    fn of(costs: &[(f64, f64)]) -> FrontierMap {
        let point = |(index, (power, error)): (usize, &(f64, f64))| FrontierPoint {
            settings: RenderSettings::default().with_level(0, index % 16).with_level(1, index / 16),
            cost: CostPoint::new(*power, *error),
        };
        FrontierMap { shared: Frontier::from_points(costs.iter().enumerate().map(point)), ..map() }
    }

    fn chosen(map: &FrontierMap) -> Vec<(f64, f64)> {
        let presets = presets(map).expect("presets").presets;
        assert!(presets.iter().map(|preset| preset.name.as_str()).eq(PRESET_NAMES));
        let costs: Vec<_> = presets.iter().map(|preset| (preset.power_w, preset.error)).collect();
        assert!(
            costs.windows(2).all(|pair| pair[0].0 <= pair[1].0 && pair[0].1 >= pair[1].1),
            "{costs:?}"
        );
        costs
    }

    #[test]
    fn they_go_from_what_can_be_shipped_to_the_best_by_equal_factors() {
        let costs = chosen(&map());
        let (battery, ultra) = (costs[0], costs[4]);
        assert!(battery.1 <= WORST_SHIPPED && battery.1 > 0.04 && ultra.1 == 0.0, "{costs:?}");
        let even = (ultra.0 / battery.0).powf(0.25);
        assert!(
            costs.windows(2).all(|pair| (pair[1].0 / pair[0].0 / even - 1.0).abs() < 0.1),
            "{costs:?}"
        );
    }

    #[test]
    fn settings_are_labels_that_the_space_reads_back() {
        let map = map();
        for preset in presets(&map).expect("presets").presets {
            let text: Vec<_> =
                preset.settings.iter().map(|(knob, level)| format!("{knob}={level}")).collect();
            let settings = map.knobs.parse(&text.join(",")).expect("labels of the space");
            let point = map
                .shared
                .points()
                .iter()
                .find(|point| point.settings == settings)
                .expect("a point of the frontier");
            assert_eq!((point.cost.power.0, point.cost.error), (preset.power_w, preset.error));
        }
    }

    #[test]
    fn what_is_written_is_read_back() {
        let presets = presets(&map()).expect("presets");
        let text = presets.to_ron().expect("text");
        assert_eq!(ron::from_str(&text), Ok(presets), "{text}");
        assert!(
            text.contains("name: \"battery\"") && text.contains("\"scale\": \"50%\""),
            "{text}"
        );
    }

    #[test]
    fn from_five_points_on_all_differ() {
        for count in 5..=32 {
            // Nearly all at one power, above what can be shipped at first and below it then; and
            // one that is dear.
            let crowd = (0..count).map(|i| (1.0 + 1e-6 * f64::from(i), 0.3 - 0.009 * f64::from(i)));
            for costs in [
                crowd.clone().collect::<Vec<_>>(),
                crowd.take(count as usize - 1).chain([(100.0, 0.0)]).collect(),
            ] {
                let chosen = chosen(&of(&costs));
                assert!(chosen.windows(2).all(|pair| pair[0].0 < pair[1].0), "{chosen:?}");
            }
        }
    }

    #[test]
    fn nothing_that_can_be_shipped_begins_at_the_cheapest() {
        let bad: Vec<_> = (0..9).map(|i| (1.0 + f64::from(i), 0.9 - 0.05 * f64::from(i))).collect();
        let costs = chosen(&of(&bad));
        assert_eq!((costs[0], costs[4]), (bad[0], bad[8]));
        // Two of six are good enough; all five differ all the same.
        let few = [(1.0, 0.5), (2.0, 0.4), (3.0, 0.3), (4.0, 0.2), (5.0, 0.04), (6.0, 0.0)];
        assert_eq!(chosen(&of(&few)), few[1..]);
    }

    #[test]
    fn few_points_and_no_power_still_make_a_list() {
        let costs = [(1.0, 0.3), (2.0, 0.2), (3.0, 0.1), (4.0, 0.0)];
        for count in 1..=4 {
            let chosen = chosen(&of(&costs[..count]));
            assert_eq!((chosen[0], chosen[4]), (costs[0], costs[count - 1]));
        }
        let free: Vec<_> = (0..9).map(|i| (f64::from(i), 0.04 - 0.005 * f64::from(i))).collect();
        assert_eq!(
            chosen(&of(&free)).iter().map(|cost| cost.0).collect::<Vec<_>>(),
            [0.0, 2.0, 4.0, 6.0, 8.0]
        );
    }

    #[test]
    fn maps_that_cannot_have_presets_say_why() {
        let error = presets(&of(&[])).expect_err("no frontier").to_string();
        assert!(
            error.contains("shared frontier") && error.contains("frugal precompute"),
            "{error}"
        );
        let twice = vec![
            Knob::labelled("samples", (0..16).map(|level| (f64::from(level), "few"))),
            Knob::new("scale", [0.5, 1.0]),
        ];
        let ambiguous = FrontierMap { knobs: KnobSpace::new(twice).expect("a space"), ..map() };
        let error = presets(&ambiguous).expect_err("one label").to_string();
        assert!(error.contains("`samples`") && error.contains("`few`"), "{error}");
        let mut broken = map();
        broken.capture.frames_per_second = f64::NAN;
        assert!(matches!(presets(&broken), Err(PresetsError::Broken(_))));
    }
}
