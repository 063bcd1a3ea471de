//! Knobs that the renderer keeps once for the whole app, and what their levels cost each camera.

use serde::{Deserialize, Serialize};

use crate::knobs::{KnobLevels, KnobSpace};
use crate::units::Watts;

/// Knobs of app scope, such as the resolution of shadow maps, with the energy that a camera's frame
/// spends on each combination of their levels.
///
/// With several cameras the highest level that any of them asks for holds, and every camera pays
/// for it. The controller counts this energy when it divides power. Where this is empty, other
/// cameras' levels cost nothing.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SharedKnobs {
    /// Names of the knobs; at most [`MOST`](Self::MOST).
    pub names: Vec<String>,
    /// Energy of a frame by the knobs' levels beyond that at their lowest, in joules; finite, at
    /// least 0. The last knob's level changes fastest.
    pub joules: Vec<f64>,
}

impl SharedKnobs {
    /// Greatest number of shared knobs.
    pub const MOST: usize = 4;

    /// Whether every knob is one of `space`, with one finite energy of at least 0 for each
    /// combination of levels.
    pub fn is_sound(&self, space: &KnobSpace) -> bool {
        let is_empty = self.names.is_empty() && self.joules.is_empty();
        (is_empty || SharedLevels::new(self, space, 0.0).is_some())
            && self.joules.iter().all(|joules| joules.is_finite() && *joules >= 0.0)
    }
}

/// Most combinations of levels that are all tried.
const MOST_TRIED: usize = 32;
/// Most cameras for which they are.
const MOST_CAMERAS: usize = 8;

/// [`SharedKnobs`] in a knob space, at a frame rate.
#[derive(Clone, Copy, Debug)]
pub struct SharedLevels<'a> {
    /// Index in the space and number of levels of each shared knob.
    knobs: [(usize, usize); SharedKnobs::MOST],
    count: usize,
    joules: &'a [f64],
    frames_per_second: f64,
}

impl<'a> SharedLevels<'a> {
    /// The shared knobs of `space`; `None` where there are none or too many, one is not of the space, or
    /// there is not one energy for each combination of levels.
    pub fn new(shared: &'a SharedKnobs, space: &KnobSpace, frames_per_second: f64) -> Option<Self> {
        let (count, mut knobs) = (shared.names.len(), [(0, 1); SharedKnobs::MOST]);
        if !(1..=SharedKnobs::MOST).contains(&count) {
            return None;
        }
        for (entry, name) in knobs.iter_mut().zip(&shared.names) {
            let index = space.index_of(name)?;
            *entry = (index, space.knobs()[index].levels.len());
        }
        let combinations: usize = knobs[..count].iter().map(|(_, levels)| levels).product();
        (combinations == shared.joules.len()).then_some(Self {
            knobs,
            count,
            joules: &shared.joules,
            frames_per_second,
        })
    }

    /// Indices of the shared knobs in their space.
    pub fn knobs(&self) -> impl Iterator<Item = usize> + '_ {
        self.knobs[..self.count].iter().map(|(index, _)| *index)
    }

    fn power(&self, level: impl Fn(usize) -> usize) -> f64 {
        let at = self.knobs[..self.count].iter().fold(0, |at, (index, levels)| {
            at * levels + level(*index).min(levels.saturating_sub(1))
        });
        self.joules.get(at).map_or(0.0, |joules| joules * self.frames_per_second)
    }

    /// Power that a camera with `settings` pays beyond its own while the app keeps the shared knobs
    /// at the levels of `at`, where those are higher; at least 0 W.
    pub fn charge(&self, settings: KnobLevels, at: KnobLevels) -> Watts {
        let own = self.power(|knob| settings.level(knob));
        let raised = self.power(|knob| settings.level(knob).max(at.level(knob)));
        Watts((raised - own).max(0.0))
    }

    /// The higher level of each shared knob; all others are 0.
    pub fn highest(&self, a: KnobLevels, b: KnobLevels) -> KnobLevels {
        self.knobs().fold(KnobLevels::default(), |levels, knob| {
            levels.with_level(knob, a.level(knob).max(b.level(knob)))
        })
    }

    /// Whether `settings` ask for a higher level of a shared knob than `at`.
    pub fn exceeds(&self, settings: KnobLevels, at: KnobLevels) -> bool {
        self.knobs().any(|knob| settings.level(knob) > at.level(knob))
    }

    /// The levels of shared knobs, none above `wanted`, at which the sum that `cost` gives is least. It is
    /// `None` for levels at which a camera has no settings. `alone`: the sum of what the cameras choose alone,
    /// below which none can be.
    ///
    /// The highest level that a camera asks for holds for all, and all pay for it. One camera that asks
    /// for fine shadows could so take the others' power. Unless all cameras get what they would choose
    /// alone, lower levels are tried, too: all combinations for a few cameras, one step down at a time
    /// for more.
    pub fn agree(
        &self,
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
        let combinations: usize = self.knobs().map(|knob| wanted.level(knob) + 1).product();
        if combinations <= MOST_TRIED && cameras <= MOST_CAMERAS {
            for number in 1..combinations {
                let mut rest = number;
                let levels = self.knobs().fold(wanted, |levels, knob| {
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
                for knob in self.knobs().filter(|knob| from.level(*knob) > 0) {
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
}

#[cfg(test)]
#[path = "shared_knobs_tests.rs"]
mod tests;
