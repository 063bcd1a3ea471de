//! Infill of the frontier: settings between two neighbours that are far apart.
//!
//! The last evaluations of a search gain most there: a budget between two distant neighbours is met
//! by settings that are cheaper than necessary.

use frugal_core::frontier::{Frontier, FrontierPoint};
use frugal_core::knobs::{KnobLevels, KnobSpace};
use rand::Rng;
use rand::seq::SliceRandom;

/// Settings within the widest interval that has some that are not `taken`: first its midpoint, then
/// one knob of an end moved towards the other end, then neighbours of an end.
pub(super) fn propose(
    space: &KnobSpace,
    frontier: &Frontier,
    random: &mut impl Rng,
    taken: impl Fn(KnobLevels) -> bool,
) -> Option<KnobLevels> {
    let free =
        |settings: KnobLevels| Some(space.canonical(settings)).filter(|settings| !taken(*settings));
    let mut any = |mut all: Vec<KnobLevels>| {
        all.shuffle(random);
        all.into_iter().find_map(free)
    };
    // By the area of the box between the ends: the greatest possible gain of hypervolume.
    let area = |ends: &[FrontierPoint]| {
        (ends[1].cost.power - ends[0].cost.power).0 * (ends[0].cost.error - ends[1].cost.error)
    };
    let mut intervals: Vec<&[FrontierPoint]> = frontier.points().windows(2).collect();
    intervals.sort_by(|a, b| area(b).total_cmp(&area(a)));
    intervals.into_iter().find_map(|ends| {
        let [low, high] = [ends[0].settings, ends[1].settings];
        let halfway = space.from_levels(|knob, _| (low.level(knob) + high.level(knob)) / 2);
        let differing = (0..space.len()).filter(|knob| low.level(*knob) != high.level(*knob));
        let towards = differing.flat_map(|knob| {
            [low.with_level(knob, high.level(knob)), high.with_level(knob, low.level(knob))]
        });
        let neighbours = [low, high].into_iter().flat_map(|end| neighbours(space, end));
        free(halfway).or_else(|| any(towards.collect())).or_else(|| any(neighbours.collect()))
    })
}

/// Every knob one level up and one down.
fn neighbours(space: &KnobSpace, settings: KnobLevels) -> Vec<KnobLevels> {
    let mut all = Vec::new();
    for (knob, levels) in space.knobs().iter().map(|knob| knob.levels.len()).enumerate() {
        let level = settings.level(knob);
        if level > 0 {
            all.push(settings.with_level(knob, level - 1));
        }
        if level + 1 < levels {
            all.push(settings.with_level(knob, level + 1));
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use frugal_core::frontier::CostPoint;
    use frugal_core::knobs::Knob;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;

    #[test]
    fn the_widest_interval_is_filled_from_its_middle_until_nothing_is_left() {
        let space =
            KnobSpace::new(vec![Knob::new("a", (0..9).map(f64::from)), Knob::new("b", [0.0, 1.0])])
                .expect("a valid space");
        let at = |a, b| space.lowest().with_level(0, a).with_level(1, b);
        let point =
            |settings, power, error| FrontierPoint { settings, cost: CostPoint::new(power, error) };
        let frontier = Frontier::from_points([
            point(at(0, 0), 1.0, 0.5),
            point(at(1, 0), 1.5, 0.45),
            point(at(8, 1), 3.0, 0.0),
        ]);
        let mut random = ChaCha8Rng::seed_from_u64(4);
        let mut taken: Vec<_> = frontier.points().iter().map(|point| point.settings).collect();
        let mut proposed = Vec::new();
        while let Some(settings) =
            propose(&space, &frontier, &mut random, |settings| taken.contains(&settings))
        {
            taken.push(settings);
            proposed.push(settings);
        }
        assert_eq!(proposed[0], at(4, 0), "the midpoint");
        assert!(
            [at(1, 1), at(8, 0)].contains(&proposed[1])
                && [at(1, 1), at(8, 0)].contains(&proposed[2]),
            "{proposed:?}"
        );
        let after: Vec<_> = proposed[3..].to_vec();
        assert!(after.contains(&at(2, 0)) && after.contains(&at(7, 1)), "{after:?}");
        assert_eq!(proposed.len(), taken.len() - 3, "nothing twice");
    }
}
