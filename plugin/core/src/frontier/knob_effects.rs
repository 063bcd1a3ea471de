//! What each level of a knob saves and costs alone.

use serde::{Deserialize, Serialize};

use super::CostPoint;
use crate::knobs::KnobSpace;
use crate::units::Watts;

/// Effects of lowering one knob from the best settings, by knob and level, in the order of the map's
/// knobs. For people: the controller does not read them, since effects of several knobs do not add up.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct KnobEffects {
    /// Energy that the level saves in a frame, in joules; finite, at least 0.
    pub joules: Vec<Vec<f64>>,
    /// Mean error (1 − SSIM) of the level at the search's pilot cameras; from 0 to 2.
    pub errors: Vec<Vec<f64>>,
}

impl KnobEffects {
    /// Whether there is nothing, or one valid number for each level of each knob of `space`.
    pub fn is_sound(&self, space: &KnobSpace) -> bool {
        let fits = |values: &[Vec<f64>], most: f64| {
            values.len() == space.len()
                && values.iter().zip(space.knobs()).all(|(values, knob)| {
                    values.len() == knob.levels.len()
                        && values.iter().all(|value| (0.0..=most).contains(value))
                })
        };
        let is_empty = self.joules.is_empty() && self.errors.is_empty();
        is_empty || (fits(&self.joules, f64::MAX) && fits(&self.errors, 2.0))
    }

    /// Power that the `level`-th level of the `knob`-th knob saves at `frames_per_second`, and its
    /// error; `None` where it is not known.
    pub fn of(&self, knob: usize, level: usize, frames_per_second: f64) -> Option<CostPoint> {
        let joules = self.joules.get(knob)?.get(level)?;
        let error = *self.errors.get(knob)?.get(level)?;
        Some(CostPoint { power: Watts(joules * frames_per_second), error })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing;

    #[test]
    fn effects_belong_to_the_levels_of_a_space() {
        // Knobs of five and three levels.
        let space = testing::space();
        let levels =
            |of: fn(usize) -> f64| [5, 3].map(|count| (0..count).map(of).collect()).to_vec();
        let effects = KnobEffects {
            joules: levels(|level| 0.01 * (4.0 - level as f64)),
            errors: levels(|level| 0.1 / (1.0 + level as f64)),
        };
        assert!(effects.is_sound(&space) && KnobEffects::default().is_sound(&space));
        let found = effects.of(0, 1, 30.0).expect("an effect");
        assert!((found.power.0 - 0.9).abs() < 1e-12 && (found.error - 0.05).abs() < 1e-12);
        assert_eq!((effects.of(2, 0, 30.0), effects.of(1, 3, 30.0)), (None, None));
        let faults: [fn(&mut KnobEffects); 5] = [
            |it| it.joules[0][0] = -1.0,
            |it| it.joules[1][0] = f64::NAN,
            |it| it.errors[1][2] = 2.1,
            |it| it.errors.truncate(1),
            |it| it.joules[0].truncate(4),
        ];
        for (number, fault) in faults.into_iter().enumerate() {
            let mut faulty = effects.clone();
            fault(&mut faulty);
            assert!(!faulty.is_sound(&space), "fault {number}");
        }
    }
}
