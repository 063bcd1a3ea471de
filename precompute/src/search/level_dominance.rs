//! Dominance of knob levels, from a table of combinations.

use bevy_frugal_gi::frontier::CostPoint;
use bevy_frugal_gi::knobs::{KnobLevels, KnobSpace};

/// Dominance of a level.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct LevelDominance {
    /// The knob.
    pub knob: String,
    /// The level.
    pub label: String,
    /// Pareto-optimal combinations that use this level.
    pub non_dominated: usize,
    /// Factor by which the best combination with this level is dominated: another has at most
    /// 1/`dominated_by` of its cost and at most 1/`dominated_by` of its error. At most 1 where one
    /// is non-dominated; values slightly above 1 may be noise.
    pub dominated_by: f64,
}

/// The dominance of every level in `table`. Costs may be in any unit; rows with a cost that is not
/// above 0 are left out. Levels without rows are left out, too.
pub(crate) fn level_dominance(
    space: &KnobSpace,
    table: &[(KnobLevels, CostPoint)],
) -> Vec<LevelDominance> {
    let rows: Vec<_> = table
        .iter()
        .filter(|(_, cost)| cost.power.0 > 0.0 && cost.error > 0.0 && cost.power.0.is_finite())
        .collect();
    let dominated: Vec<f64> = rows
        .iter()
        .map(|(_, own)| dominated_by(*own, rows.iter().map(|(_, other)| *other)))
        .collect();
    let mut levels = Vec::new();
    for (index, knob) in space.knobs().iter().enumerate() {
        for (number, level) in knob.levels.iter().enumerate() {
            let having = rows
                .iter()
                .zip(&dominated)
                .filter(|((settings, _), _)| settings.level(index) == number);
            let (mut non_dominated, mut least) = (0, f64::INFINITY);
            for (_, dominated) in having {
                non_dominated += usize::from(*dominated <= 1.0);
                least = least.min(*dominated);
            }
            if least.is_finite() {
                levels.push(LevelDominance {
                    knob: knob.name.clone(),
                    label: level.label.clone(),
                    non_dominated,
                    dominated_by: least,
                });
            }
        }
    }
    levels
}

/// Greatest factor by which one of `others` is better in both costs. At least 1 if `others`
/// contains `own`.
fn dominated_by(own: CostPoint, others: impl Iterator<Item = CostPoint>) -> f64 {
    others
        .map(|other| (own.power.0 / other.power.0).min(own.error / other.error))
        .fold(1.0, f64::max)
}

#[cfg(test)]
mod tests {
    use bevy_frugal_gi::knobs::Knob;

    use super::*;

    #[test]
    fn a_level_that_is_always_dominated_is_found() {
        let space =
            KnobSpace::new(vec![Knob::new("a", [0.0, 1.0, 2.0]), Knob::new("b", [0.0, 1.0])])
                .unwrap();
        // The middle level of `a` costs as much as the highest, and has nine tenths of the lowest
        // one's error.
        let cost = |a: usize, b: usize| {
            let (power, error) = [(1.0, 0.4), (3.0, 0.36), (3.0, 0.1)][a];
            CostPoint::new(power + b as f64, error / (1.0 + b as f64))
        };
        let mut table: Vec<_> = space
            .iter()
            .map(|settings| (settings, cost(settings.level(0), settings.level(1))))
            .collect();
        table.push((KnobLevels::default(), CostPoint::new(f64::NAN, 0.1)));
        table.push((KnobLevels::default(), CostPoint::new(0.0, 0.0)));
        let levels = level_dominance(&space, &table);
        assert_eq!(levels.len(), 5);
        let of = |knob: &str, label: &str| {
            levels.iter().find(|level| level.knob == knob && level.label == label).unwrap()
        };
        assert_eq!(
            (of("a", "1").non_dominated, of("a", "0").non_dominated, of("a", "2").non_dominated),
            (0, 2, 2)
        );
        // With b at 1 the factor is smaller: a = 2 and b = 0 costs 3 instead of 4 and has 0.1
        // instead of 0.18.
        assert!((of("a", "1").dominated_by - 4.0 / 3.0).abs() < 1e-12, "{levels:?}");
        assert_eq!((of("b", "0").dominated_by, of("b", "1").dominated_by), (1.0, 1.0));
        assert!(level_dominance(&space, &[]).is_empty());
    }
}
