//! Presets for a settings menu, from a map's shared frontier.
//!
//! Non-dominated constants over the scene's cameras, for apps with a menu beside or in place of the
//! controller.

use std::collections::BTreeMap;

use bevy_frugal_gi::power::MeterInfo;
use frugal_core::frontier::{Capture, FrontierMap, FrontierPoint, SceneIdentity};
use frugal_core::knobs::{Knob, KnobLevels, KnobSpace};
use serde::{Deserialize, Serialize};

/// The presets, cheapest first.
pub(super) const PRESET_NAMES: [&str; 5] = ["battery", "low", "medium", "high", "ultra"];

/// Visible error: the cheapest preset has at most this, if any settings have.
const WORST_SHIPPED: f64 = 0.05;

/// A file of presets.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Presets {
    /// The scene.
    pub scene: SceneIdentity,
    /// The capture conditions of watts and errors.
    pub capture: Capture,
    /// The power meter.
    pub meter: MeterInfo,
    /// The presets, cheapest first: power never falls, error never rises.
    pub presets: Vec<Preset>,
}

/// Named settings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Preset {
    /// One of [`PRESET_NAMES`].
    pub name: String,
    /// Predicted power, mean over the map's cameras, in watts.
    pub power_w: f64,
    /// Predicted error, mean over the map's cameras.
    pub error: f64,
    /// Labels of levels by knob name. Absent knobs are at their best.
    pub settings: BTreeMap<String, String>,
}

/// The presets of `map`.
///
/// `ultra` has the least error. `battery` is the cheapest with an error of at most 0.05, or the
/// cheapest of all where none has. Each costs about the same factor more than the one before. No
/// two are equal where the frontier has five points or more, for which `battery` may exceed that
/// error.
///
/// # Errors
/// When the map has no shared frontier, or ambiguous labels.
pub(crate) fn presets(map: &FrontierMap) -> Result<Presets, String> {
    let points = map.shared.points();
    let chosen = choose(points).ok_or(
        "the map has no shared frontier to take presets from: run `frugal precompute` again",
    )?;
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
        PRESET_NAMES.into_iter().zip(chosen).map(preset).collect::<Result<_, String>>()?;
    Ok(Presets {
        scene: map.scene.clone(),
        capture: map.capture,
        meter: map.meter.clone(),
        presets,
    })
}

impl Presets {
    /// The presets as RON, one knob per line.
    ///
    /// # Errors
    /// When the serialiser fails, which it does not for these types.
    pub(crate) fn to_ron(&self) -> Result<String, String> {
        let text = ron::ser::to_string_pretty(self, ron::ser::PrettyConfig::new().new_line("\n"));
        text.map(|text| text + "\n").map_err(|error| format!("presets cannot be written: {error}"))
    }
}

/// Indices of a frontier's points, one for each name, in ascending order; `None` for an empty
/// frontier.
fn choose(points: &[FrontierPoint]) -> Option<[usize; PRESET_NAMES.len()]> {
    const LAST: usize = PRESET_NAMES.len() - 1;
    let best = points.len().checked_sub(1)?;
    if best < LAST {
        // Too few points for all presets to differ: spread evenly.
        return Some(std::array::from_fn(|number| (number * best + LAST / 2) / LAST));
    }
    let good = points.partition_point(|point| point.cost.error > WORST_SHIPPED);
    let first = if good > best { 0 } else { good.min(best - LAST) };
    let power = |index: usize| points[index].cost.power.0;
    let (low, high) = (power(first), power(best));
    let mut chosen = [first; LAST + 1];
    for number in 1..LAST {
        let share = number as f64 / LAST as f64;
        // Equal factors between presets; equal differences where the power is 0 W.
        let target =
            if low > 0.0 { low * (high / low).powf(share) } else { low + share * (high - low) };
        // Leaves a point for each of the remaining presets.
        let free = chosen[number - 1] + 1..=best - (LAST - number);
        let distance = |index: &usize| (power(*index) - target).abs();
        chosen[number] = free.min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
    }
    chosen[LAST] = best;
    Some(chosen)
}

/// The labels of `settings` by knob.
fn labels(space: &KnobSpace, settings: KnobLevels) -> Result<BTreeMap<String, String>, String> {
    let pair = |(index, knob): (usize, &Knob)| {
        let label = &knob.levels.get(settings.level(index))?.label;
        let same = knob.levels.iter().filter(|level| level.label == *label).count();
        Some(if same == 1 {
            Ok((knob.name.clone(), label.clone()))
        } else {
            Err(format!(
                "knob `{}` has two levels called `{label}`: give them labels of their own, then run `frugal precompute` again",
                knob.name
            ))
        })
    };
    space.knobs().iter().enumerate().filter_map(pair).collect()
}

#[cfg(test)]
mod tests {
    use frugal_core::frontier::{CostPoint, Frontier};

    use super::super::testing::map;
    use super::*;

    fn of(costs: &[(f64, f64)]) -> FrontierMap {
        let point = |(index, (power, error)): (usize, &(f64, f64))| FrontierPoint {
            settings: KnobLevels::default().with_level(0, index % 16).with_level(1, index / 16),
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
    fn they_span_from_the_error_limit_to_the_best_by_equal_factors() {
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
    fn presets_read_back_as_written() {
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
            // Nearly all at one power, first above and then below the error limit; and one
            // expensive point.
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
    fn without_settings_below_the_error_limit_battery_is_the_cheapest() {
        let bad: Vec<_> = (0..9).map(|i| (1.0 + f64::from(i), 0.9 - 0.05 * f64::from(i))).collect();
        let costs = chosen(&of(&bad));
        assert_eq!((costs[0], costs[4]), (bad[0], bad[8]));
        // Two of six are below the error limit; all five presets still differ.
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
    fn maps_without_presets_are_refused_with_a_reason() {
        let error = presets(&of(&[])).expect_err("no frontier");
        assert!(
            error.contains("shared frontier") && error.contains("frugal precompute"),
            "{error}"
        );
        let twice = vec![
            Knob::labelled("samples", (0..16).map(|level| (f64::from(level), "few"))),
            Knob::new("scale", [0.5, 1.0]),
        ];
        let ambiguous = FrontierMap { knobs: KnobSpace::new(twice).expect("a space"), ..map() };
        let error = presets(&ambiguous).expect_err("one label");
        assert!(error.contains("`samples`") && error.contains("`few`"), "{error}");
    }
}
