//! Uniform crossover (Syswerda 1989, "Uniform crossover in genetic algorithms"): two settings swap
//! the levels of some knobs.
//!
//! Wang et al. 2016, section 3.5.1.2, swap parameter values between two settings to make two
//! offspring. Uniform, and not at one or two points, because the order of knobs in a space is
//! arbitrary.

use bevy_frugal_gi::knobs::{KnobLevels, KnobSpace};
use rand::{Rng, RngExt};

/// Two offspring, each knob's two levels swapped between them with probability ½.
pub(crate) fn swap_levels(
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

#[cfg(test)]
mod tests {
    use bevy_frugal_gi::knobs::Knob;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;

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
