//! Levels of the knobs that the renderer keeps once for all cameras.
//!
//! The highest level that a camera asks for holds for all, and all pay for it. One camera that asks
//! for fine shadows could so take the others' power. Unless all cameras get what they would choose
//! alone, lower levels are tried, too: all combinations for a few cameras, one step down at a time
//! for more.

use crate::frontier::SharedLevels;
use crate::knobs::KnobLevels;

/// Most combinations of levels that are all tried.
const MOST_TRIED: usize = 32;
/// Most cameras for which they are.
const MOST_CAMERAS: usize = 8;

/// The levels of shared knobs, none above `wanted`, at which the sum that `cost` gives is least. It is
/// `None` for levels at which a camera has no settings. `alone`: the sum of what the cameras choose alone,
/// below which none can be.
pub fn agree(
    shared: &SharedLevels<'_>,
    wanted: KnobLevels,
    cameras: usize,
    alone: f64,
    mut cost: impl FnMut(KnobLevels) -> Option<f64>,
) -> KnobLevels {
    let first = cost(wanted);
    if first.is_some_and(|sum| sum <= alone * (1.0 + 1e-9)) {
        return wanted;
    }
    let mut best = (first, wanted);
    let better = |new: Option<f64>, old: Option<f64>| match (new, old) {
        (Some(new), Some(old)) => new < old,
        (Some(_), None) => true,
        (None, _) => false,
    };
    let combinations: usize = shared.knobs().map(|knob| wanted.level(knob) + 1).product();
    if combinations <= MOST_TRIED && cameras <= MOST_CAMERAS {
        for number in 1..combinations {
            let mut rest = number;
            let levels = shared.knobs().fold(wanted, |levels, knob| {
                let count = wanted.level(knob) + 1;
                let lowered = wanted.level(knob) - rest % count;
                rest /= count;
                levels.with_level(knob, lowered)
            });
            let sum = cost(levels);
            if better(sum, best.0) {
                best = (sum, levels);
            }
        }
    } else {
        loop {
            let from = best.1;
            for knob in shared.knobs().filter(|knob| from.level(*knob) > 0) {
                let levels = from.with_level(knob, from.level(knob) - 1);
                let sum = cost(levels);
                if better(sum, best.0) {
                    best = (sum, levels);
                }
            }
            if best.1 == from {
                break;
            }
        }
    }
    best.1
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frontier::SharedKnobs;
    use crate::knobs::{Knob, KnobSpace};

    fn at(a: usize, b: usize) -> KnobLevels {
        KnobLevels::default().with_level(0, a).with_level(1, b)
    }

    #[test]
    fn the_best_levels_are_found() {
        let knobs = ["a", "b"].map(|name| Knob::new(name, [0.0, 1.0, 2.0, 3.0]));
        let space = KnobSpace::new(knobs.into()).expect("a space");
        let knobs = SharedKnobs { names: vec!["a".into(), "b".into()], joules: vec![0.0; 16] };
        let shared = SharedLevels::new(&knobs, &space, 1.0).expect("shared knobs");
        // Best at (1, 2); no settings at a = 0.
        let sum = |levels: KnobLevels| {
            let (a, b) = (levels.level(0), levels.level(1));
            (a > 0).then_some((a as f64 - 1.0).abs() + (b as f64 - 2.0).abs())
        };
        for cameras in [2, 64] {
            assert_eq!(agree(&shared, at(3, 3), cameras, -1.0, sum), at(1, 2), "{cameras}");
            let mut calls = 0;
            let kept = agree(&shared, at(2, 2), cameras, 1.0, |levels| {
                calls += 1;
                sum(levels)
            });
            assert_eq!((kept, calls), (at(2, 2), 1), "{cameras}: what all choose alone");
            assert_eq!(agree(&shared, at(0, 0), cameras, 0.0, sum), at(0, 0));
        }
    }
}
