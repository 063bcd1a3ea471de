//! One-at-a-time screening: the effect of each knob on the error, and knobs without effect.

use frugal_core::knobs::{KnobLevels, KnobSpace};

use super::LEAST_ERROR;
use crate::table::CostTable;

/// Greatest error, over all levels and pilot cameras, of a knob that counts as having no effect in
/// the scene. Well below the error of a different sampling pattern.
const NO_EFFECT: f64 = 2e-4;

/// Greatest number of levels of which all are rendered; of a knob with more, the one below the
/// best, the middle one, and the lowest.
const ALL_LEVELS: usize = 4;

/// The best settings, then those with one knob lowered, then the cheapest and two presets in
/// between. Without `all_levels` a knob is lowered by one level and to the lowest, no more.
pub(crate) fn screening_settings(space: &KnobSpace, all_levels: bool) -> Vec<KnobLevels> {
    let best = space.highest();
    let mut all = vec![best];
    for (index, knob) in space.knobs().iter().enumerate() {
        let top = knob.levels.len() - 1;
        let levels: Vec<usize> = match top {
            0 => Vec::new(),
            _ if !all_levels => vec![top - 1, 0],
            _ if top < ALL_LEVELS => (0..top).rev().collect(),
            _ => vec![top - 1, top / 2, 0],
        };
        all.extend(levels.into_iter().map(|level| best.with_level(index, level)));
    }
    all.extend([2.0 / 3.0, 1.0 / 3.0, 0.0].map(|share| space.preset(share)));
    space.canonical_once(all)
}

/// Single effects of the knobs.
#[derive(Clone, Debug, PartialEq)]
pub struct Screening {
    /// Mean error by knob and level; 0 at the best. Levels that were not rendered are interpolated
    /// in the logarithm.
    pub effects: Vec<Vec<f64>>,
    /// Knobs without effect: they stay at their cheapest and are not searched.
    pub without_effect: Vec<usize>,
}

impl Screening {
    /// Effects from a table of pilot cameras that contains [`screening_settings`].
    pub fn of(space: &KnobSpace, table: &CostTable) -> Self {
        let best = space.highest();
        let mut effects = Vec::new();
        let mut without_effect = Vec::new();
        for (index, knob) in space.knobs().iter().enumerate() {
            let lowered = |level: usize| space.canonical(best.with_level(index, level));
            let column = |level: usize| table.column(lowered(level));
            let top = knob.levels.len() - 1;
            let mut errors: Vec<f64> = vec![0.0; knob.levels.len()];
            let mut above = top;
            for level in (0..top).rev() {
                let Some(error) = table.known_mean_error(lowered(level)) else { continue };
                // A lower level is never better: a lower error is noise.
                errors[level] = error.max(errors[above]);
                for between in level + 1..above {
                    let share = (above - between) as f64 / (above - level) as f64;
                    let logarithm = |error: f64| (error + LEAST_ERROR).ln();
                    errors[between] = (logarithm(errors[above]) * (1.0 - share)
                        + logarithm(errors[level]) * share)
                        .exp()
                        - LEAST_ERROR;
                }
                above = level;
            }
            let mut known = (0..top)
                .filter_map(column)
                .flat_map(|column| table.known(column).map(|(_, cost)| cost.error));
            if top > 0 && known.all(Self::is_without_effect) && column(0).is_some() {
                without_effect.push(index);
            }
            effects.push(errors);
        }
        Self { effects, without_effect }
    }

    /// Whether an error is that of a knob without effect.
    pub(crate) fn is_without_effect(error: f64) -> bool {
        error < NO_EFFECT
    }

    /// `settings` with the knobs that have no effect at their cheapest.
    pub fn fixed(&self, space: &KnobSpace, settings: KnobLevels) -> KnobLevels {
        space.canonical(
            self.without_effect
                .iter()
                .fold(settings, |settings, knob| settings.with_level(*knob, 0)),
        )
    }
}

#[cfg(test)]
mod tests {
    use frugal_core::frontier::CostPoint;
    use frugal_core::knobs::Knob;

    use super::*;

    fn space() -> KnobSpace {
        let knobs = vec![
            Knob::new("gi", [0.0, 1.0, 2.0]),
            Knob::new("rays", [0.0, 1.0]).needing("gi", 1),
            Knob::new("idle", [0.0, 1.0, 2.0]),
        ];
        KnobSpace::new(knobs).expect("a valid space")
    }

    #[test]
    fn every_one_level_step_is_tried_once() {
        let space = space();
        for all_levels in [true, false] {
            let all = screening_settings(&space, all_levels);
            assert_every_step(&space, &all);
        }
    }

    fn assert_every_step(space: &KnobSpace, all: &[KnobLevels]) {
        for (index, knob) in space.knobs().iter().enumerate() {
            for level in [knob.levels.len() - 2, 0] {
                assert!(all.contains(&space.canonical(space.highest().with_level(index, level))));
            }
        }
        assert!(all.contains(&space.canonical(space.lowest())) && all[0] == space.highest());
        let unique: std::collections::HashSet<_> = all.iter().collect();
        assert_eq!(unique.len(), all.len());
    }

    #[test]
    fn a_knob_without_effect_is_found_and_fixed() {
        let space = space();
        let mut table = CostTable::new(2);
        for row in 0..2 {
            for settings in screening_settings(&space, true) {
                let missing = 2 - settings.level(0);
                let rays = if settings.level(1) == 0 { 0.05 } else { 0.0 };
                table.set(row, settings, CostPoint::new(3.0, 0.1 * missing as f64 + rays));
            }
        }
        let screening = Screening::of(&space, &table);
        assert_eq!(screening.without_effect, [2]);
        assert_eq!(
            screening.effects[0].iter().map(|e| (e * 100.0).round()).collect::<Vec<_>>(),
            [25.0, 10.0, 0.0]
        );
        assert_eq!(screening.fixed(&space, space.highest()), space.highest().with_level(2, 0));
        // A knob that was not rendered does not count as without effect.
        assert!(Screening::of(&space, &CostTable::new(2)).without_effect.is_empty());
    }
}
