//! Variation of settings: crossover and mutation.
//!
//! Crossover is uniform (Syswerda 1989, "Uniform crossover in genetic algorithms"), and not at one or
//! two points, because the order of knobs in a space is arbitrary. Mutation is mostly a creep to a
//! neighbouring level, sometimes a jump (Davis 1991, "Handbook of Genetic Algorithms", chapter 5):
//! neighbours cost almost the same, and jumps leave local optima.

use frugal_core::knobs::{KnobLevels, KnobSpace};
use rand::{Rng, RngExt};

/// Share of changes that are jumps to any other level.
const JUMP: f64 = 0.2;

/// Two offspring, each knob's two levels swapped between them with probability ½.
pub(super) fn swap_levels(
    space: &KnobSpace,
    parents: [KnobLevels; 2],
    random: &mut impl Rng,
) -> [KnobLevels; 2] {
    let [mut one, mut other] = parents;
    for knob in 0..space.len() {
        if random.random_bool(0.5) {
            one = one.with_level(knob, parents[1].level(knob));
            other = other.with_level(knob, parents[0].level(knob));
        }
    }
    [one, other]
}

/// `settings` with each knob changed with `probability`.
pub(super) fn mutate(
    space: &KnobSpace,
    settings: KnobLevels,
    probability: f64,
    random: &mut impl Rng,
) -> KnobLevels {
    (0..space.len()).fold(settings, |settings, knob| {
        if random.random_bool(probability.clamp(0.0, 1.0)) {
            change(space, settings, knob, random)
        } else {
            settings
        }
    })
}

/// `settings` with one knob changed; unchanged only if no knob has two levels.
pub(super) fn mutate_one(
    space: &KnobSpace,
    settings: KnobLevels,
    random: &mut impl Rng,
) -> KnobLevels {
    let is_movable = |knob: &usize| space.knobs()[*knob].levels.len() > 1;
    let movable: Vec<usize> = (0..space.len()).filter(is_movable).collect();
    if movable.is_empty() {
        return settings;
    }
    change(space, settings, movable[random.random_range(0..movable.len())], random)
}

/// Uniformly sampled levels.
pub(crate) fn random_settings(space: &KnobSpace, random: &mut impl Rng) -> KnobLevels {
    space.from_levels(|_, knob| random.random_range(0..knob.levels.len()))
}

fn change(
    space: &KnobSpace,
    settings: KnobLevels,
    knob: usize,
    random: &mut impl Rng,
) -> KnobLevels {
    let top = space.knobs()[knob].levels.len() - 1;
    let level = settings.level(knob);
    if top == 0 {
        return settings;
    }
    let changed = if random.random_bool(JUMP) {
        // One of the `top` other levels.
        let other = random.random_range(0..top);
        other + usize::from(other >= level)
    } else if level == 0 || (level < top && random.random_bool(0.5)) {
        level + 1
    } else {
        level - 1
    };
    settings.with_level(knob, changed)
}

#[cfg(test)]
mod tests {
    use frugal_core::knobs::Knob;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;

    fn space() -> KnobSpace {
        KnobSpace::new(vec![
            Knob::new("a", [0.0]),
            Knob::new("b", [0.0, 1.0]),
            Knob::new("c", (0..16).map(f64::from)),
        ])
        .expect("a valid space")
    }

    #[test]
    fn one_mutation_changes_one_knob_and_mostly_by_one_level() {
        let space = space();
        let mut random = ChaCha8Rng::seed_from_u64(2);
        let (mut settings, mut steps, mut jumps) = (space.preset(0.5), 0, 0);
        for _ in 0..2000 {
            let changed = mutate_one(&space, settings, &mut random);
            assert!(space.contains(changed));
            let moved: Vec<_> =
                (0..3).map(|knob| changed.level(knob).abs_diff(settings.level(knob))).collect();
            assert_eq!(moved.iter().filter(|levels| **levels > 0).count(), 1, "{moved:?}");
            if moved[2] == 1 {
                steps += 1;
            } else if moved[2] > 1 {
                jumps += 1;
            }
            settings = changed;
        }
        assert!(steps > 3 * jumps && jumps > 100, "{steps} steps, {jumps} jumps");
    }

    #[test]
    fn probability_zero_changes_nothing_and_one_everything_movable() {
        let space = space();
        let mut random = ChaCha8Rng::seed_from_u64(3);
        for _ in 0..100 {
            assert_eq!(mutate(&space, space.lowest(), 0.0, &mut random), space.lowest());
            let all = mutate(&space, space.lowest(), 1.0, &mut random);
            assert!(all.level(0) == 0 && all.level(1) == 1 && all.level(2) > 0);
            assert!(space.contains(random_settings(&space, &mut random)));
        }
        let fixed = KnobSpace::new(vec![Knob::new("a", [0.0])]).expect("a valid space");
        assert_eq!(mutate_one(&fixed, fixed.lowest(), &mut random), fixed.lowest());
    }

    #[test]
    fn every_level_comes_from_one_parent_and_none_is_lost() {
        let space = KnobSpace::new(
            (0..8).map(|i| Knob::new(&format!("k{i}"), [0.0, 1.0, 2.0, 3.0])).collect(),
        )
        .expect("a valid space");
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let parents = [space.lowest(), space.highest()];
        let mut swaps = [0; 8];
        for _ in 0..1000 {
            let [one, other] = swap_levels(&space, parents, &mut random);
            for (knob, swaps) in swaps.iter_mut().enumerate() {
                assert_eq!(one.level(knob) + other.level(knob), 3, "one parent's level each");
                assert!([0, 3].contains(&one.level(knob)));
                *swaps += usize::from(one.level(knob) == 3);
            }
        }
        // Five standard deviations of 1000 fair coins are 79.
        assert!(swaps.iter().all(|count| count.abs_diff(500) < 80), "{swaps:?}");
    }
}
