//! Initial evaluations of a search.
//!
//! A neighbour's frontier, if known, comes first (Wang et al. 2016, section 3.5.1.2: children start
//! from their parents' settings). Without one the source starts at random, which wastes a small
//! evaluation budget: almost all random settings are dominated. Instead each knob is lowered alone
//! to measure its saving and its error (one-at-a-time screening), and then all are lowered in
//! sequence, the least error per watt first. Were power and error sums over the knobs, those steps
//! would be exactly the convex part of the frontier (the greedy fractional knapsack, Dantzig 1957).

use bevy_frugal_gi::frontier::CostPoint;
use bevy_frugal_gi::knobs::{KnobLevels, KnobSpace};

/// At most `count` of `settings`, each once, spread evenly over the list.
pub(crate) fn spread(space: &KnobSpace, settings: &[KnobLevels], count: usize) -> Vec<KnobLevels> {
    let unique =
        space.canonical_once(settings.iter().copied().filter(|settings| space.contains(*settings)));
    if unique.len() <= count {
        return unique;
    }
    (0..count).map(|index| unique[index * unique.len() / count]).collect()
}

/// Presets as engines ship them, between the highest and the lowest.
pub(crate) fn presets(space: &KnobSpace) -> [KnobLevels; 3] {
    [0.5, 0.25, 0.75].map(|share| space.preset(share))
}

/// One-at-a-time screening: the knobs that can be lowered, each with the highest settings but that
/// knob at its lowest.
pub(crate) fn one_at_a_time(space: &KnobSpace) -> Vec<(usize, KnobLevels)> {
    let highest = space.highest();
    let movable = (0..space.len()).filter(|knob| space.knobs()[*knob].levels.len() > 1);
    movable.map(|knob| (knob, highest.with_level(knob, 0))).collect()
}

/// Settings from the highest downwards, lowering knob by knob in the order of error per watt saved.
/// Knobs that saved nothing in the screening stay at their highest.
pub(crate) fn descent(
    space: &KnobSpace,
    highest: CostPoint,
    effects: &[(usize, CostPoint)],
) -> Vec<KnobLevels> {
    let mut saving: Vec<(usize, f64)> = effects
        .iter()
        .filter(|(_, cost)| cost.is_finite() && cost.power < highest.power)
        .map(|(knob, cost)| {
            (*knob, (cost.error - highest.error).max(0.0) / (highest.power - cost.power).0)
        })
        .collect();
    saving.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
    let mut settings = space.highest();
    let mut steps = Vec::new();
    for (knob, _) in saving {
        settings = settings.with_level(knob, 0);
        steps.push(space.canonical(settings));
    }
    steps
}

#[cfg(test)]
mod tests {
    use bevy_frugal_gi::knobs::Knob;

    use super::*;

    fn space() -> KnobSpace {
        KnobSpace::new(vec![
            Knob::new("a", [0.0, 1.0]),
            Knob::new("b", [0.0, 1.0, 2.0]),
            Knob::new("c", [0.0]),
            Knob::new("d", [0.0, 1.0]),
        ])
        .expect("a valid space")
    }

    #[test]
    fn the_cheapest_error_per_watt_goes_first() {
        let space = space();
        let one_at_a_time = one_at_a_time(&space);
        assert_eq!(one_at_a_time.iter().map(|(knob, _)| *knob).collect::<Vec<_>>(), [0, 1, 3]);
        // 0.1 per watt, 0.05 per watt, and a knob whose lowering costs power.
        let effects = [
            (0, CostPoint::new(9.0, 0.1)),
            (1, CostPoint::new(8.0, 0.1)),
            (3, CostPoint::new(10.5, 0.0)),
        ];
        let steps = descent(&space, CostPoint::new(10.0, 0.0), &effects);
        assert_eq!(
            steps,
            [space.highest().with_level(1, 0), space.highest().with_level(1, 0).with_level(0, 0)]
        );
    }

    #[test]
    fn a_long_inheritance_is_thinned_evenly_and_foreign_settings_are_dropped() {
        let space = space();
        let all: Vec<_> = space.iter().collect();
        assert_eq!(spread(&space, &all, 4), [all[0], all[3], all[6], all[9]]);
        assert_eq!(spread(&space, &[all[1], all[1], KnobLevels::from_bits(0xffff)], 4), [all[1]]);
    }
}
