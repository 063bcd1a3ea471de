//! Which levels of which knobs are worth having, from a table of combinations.

use bevy_frugal_gi::frontier::CostPoint;
use bevy_frugal_gi::knobs::{KnobSpace, RenderSettings};

/// What a level is good for.
#[derive(Clone, Debug, PartialEq)]
pub struct LevelWorth {
    /// The knob.
    pub knob: String,
    /// The level.
    pub label: String,
    /// How many of the combinations that nothing beats have it.
    pub unbeaten: usize,
    /// How clearly the best combination with this level is beaten: another has at most 1/`beaten_by` of its cost and at most 1/`beaten_by` of its
    /// error. At most 1 where one is unbeaten; what is only just above may be noise.
    pub beaten_by: f64,
}

/// The worth of every level in `table`, whose costs may be in any unit but must be above 0; other rows are left out. Levels that no row has
/// are left out, too.
pub fn level_worth(space: &KnobSpace, table: &[(RenderSettings, CostPoint)]) -> Vec<LevelWorth> {
    let rows: Vec<_> = table.iter().filter(|(_, cost)| cost.power.0 > 0.0 && cost.error > 0.0 && cost.power.0.is_finite()).collect();
    let beaten: Vec<f64> = rows.iter().map(|(_, own)| beaten_by(*own, rows.iter().map(|(_, other)| *other))).collect();
    let mut worth = Vec::new();
    for (index, knob) in space.knobs().iter().enumerate() {
        for (number, level) in knob.levels.iter().enumerate() {
            let having = rows.iter().zip(&beaten).filter(|((settings, _), _)| settings.level(index) == number);
            let (mut unbeaten, mut least) = (0, f64::INFINITY);
            for (_, beaten) in having {
                unbeaten += usize::from(*beaten <= 1.0);
                least = least.min(*beaten);
            }
            if least.is_finite() {
                worth.push(LevelWorth { knob: knob.name.clone(), label: level.label.clone(), unbeaten, beaten_by: least });
            }
        }
    }
    worth
}

/// Largest factor by which one of `others` is better in both. A row is among its own others, and as good as itself.
fn beaten_by(own: CostPoint, others: impl Iterator<Item = CostPoint>) -> f64 {
    others.map(|other| (own.power.0 / other.power.0).min(own.error / other.error)).fold(1.0, f64::max)
}

#[cfg(test)]
mod tests {
    use bevy_frugal_gi::knobs::Knob;

    use super::*;

    #[test]
    fn a_level_that_something_else_always_beats_is_told_apart() {
        let space = KnobSpace::new(vec![Knob::new("a", [0.0, 1.0, 2.0]), Knob::new("b", [0.0, 1.0])]).unwrap();
        // The middle level of `a` costs as much as the highest, and is as wrong as the lowest but for a tenth.
        let cost = |a: usize, b: usize| {
            let (power, error) = [(1.0, 0.4), (3.0, 0.36), (3.0, 0.1)][a];
            CostPoint::new(power + b as f64, error / (1.0 + b as f64))
        };
        let mut table: Vec<_> = space.iter().map(|settings| (settings, cost(settings.level(0), settings.level(1)))).collect();
        table.push((RenderSettings::default(), CostPoint::new(f64::NAN, 0.1)));
        table.push((RenderSettings::default(), CostPoint::new(0.0, 0.0)));
        let worth = level_worth(&space, &table);
        assert_eq!(worth.len(), 5);
        let of = |knob: &str, label: &str| worth.iter().find(|worth| worth.knob == knob && worth.label == label).unwrap();
        assert_eq!((of("a", "1").unbeaten, of("a", "0").unbeaten, of("a", "2").unbeaten), (0, 2, 2));
        // With b at 1 it is beaten less: by a = 2 and b = 0, which costs 3 instead of 4 and has 0.1 instead of 0.18.
        assert!((of("a", "1").beaten_by - 4.0 / 3.0).abs() < 1e-12, "{worth:?}");
        assert_eq!((of("b", "0").beaten_by, of("b", "1").beaten_by), (1.0, 1.0));
        assert!(level_worth(&space, &[]).is_empty());
    }
}
