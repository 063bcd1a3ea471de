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
        let levels = |name: &String| Some(space.knobs()[space.index_of(name)?].levels.len());
        let combinations = self.names.iter().map(levels).product::<Option<usize>>();
        let is_empty = self.names.is_empty() && self.joules.is_empty();
        self.names.len() <= Self::MOST
            && (is_empty || combinations == Some(self.joules.len()))
            && self.joules.iter().all(|joules| joules.is_finite() && *joules >= 0.0)
    }
}

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
    /// The shared knobs of `space`; `None` where there are none, or they are not
    /// [sound](SharedKnobs::is_sound).
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
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::knobs::Knob;

    fn space() -> KnobSpace {
        let knobs = ["rays", "shadows", "cascades"].map(|name| Knob::new(name, [0.0, 1.0, 2.0]));
        KnobSpace::new(knobs.into()).expect("a space")
    }

    /// Shadows of 0, 1 and 4 J times one to three cascades, less the lowest.
    fn shared() -> SharedKnobs {
        let joules = [0.0, 1.0, 4.0].map(|area| [1.0, 2.0, 3.0].map(|count| area * count));
        SharedKnobs {
            names: vec!["shadows".into(), "cascades".into()],
            joules: joules.into_iter().flatten().collect(),
        }
    }

    fn at(rays: usize, shadows: usize, cascades: usize) -> KnobLevels {
        KnobLevels::default().with_level(0, rays).with_level(1, shadows).with_level(2, cascades)
    }

    #[test]
    fn a_camera_pays_for_what_others_ask_for_and_it_does_not() {
        let (space, shared) = (space(), shared());
        assert!(shared.is_sound(&space));
        let levels = SharedLevels::new(&shared, &space, 10.0).expect("shared knobs");
        assert_eq!(levels.charge(at(2, 0, 0), at(0, 2, 1)), Watts(80.0));
        assert_eq!(levels.charge(at(2, 2, 0), at(0, 2, 1)), Watts(40.0));
        assert_eq!(levels.charge(at(0, 2, 2), at(2, 1, 1)), Watts(0.0), "its own are higher");
        assert_eq!(levels.highest(at(2, 1, 0), at(1, 0, 2)), at(0, 1, 2));
        assert!(
            levels.exceeds(at(0, 1, 0), at(2, 0, 2)) && !levels.exceeds(at(2, 0, 0), at(0, 0, 0))
        );
        // Levels that the space lacks are no danger.
        assert!(levels.charge(KnobLevels::default(), KnobLevels::from_bits(u128::MAX)).0 > 0.0);
    }

    #[test]
    fn faulty_shared_knobs_are_none() {
        let space = space();
        let faults: [fn(&mut SharedKnobs); 5] = [
            |it| it.names[0] = "unknown".into(),
            |it| it.names = vec!["shadows".into(); 5],
            |it| it.joules.truncate(8),
            |it| it.joules[3] = f64::NAN,
            |it| it.joules[3] = -1.0,
        ];
        for (number, fault) in faults.into_iter().enumerate() {
            let mut faulty = shared();
            fault(&mut faulty);
            assert!(!faulty.is_sound(&space), "fault {number}");
            if number < 3 {
                assert!(SharedLevels::new(&faulty, &space, 10.0).is_none(), "fault {number}");
            }
        }
        assert!(SharedKnobs::default().is_sound(&space));
        assert!(SharedLevels::new(&SharedKnobs::default(), &space, 10.0).is_none());
    }
}
