//! A space: the knobs of a map or an app, in the order in which settings pack their levels.
//!
//! Independent of the renderer: a driver of the plugin applies a level to a camera.

#[cfg(feature = "bevy")]
use bevy_reflect::Reflect;
mod enumerate;
mod error;
mod text;

use serde::{Deserialize, Serialize};

use super::{Knob, KnobLevels};
pub use error::{KnobSpaceError, did_you_mean};

/// An ordered set of knobs, in the order in which [`KnobLevels`] packs their levels.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "bevy", derive(Reflect))]
#[serde(try_from = "Vec<Knob>", into = "Vec<Knob>")]
pub struct KnobSpace {
    knobs: Vec<Knob>,
}

impl TryFrom<Vec<Knob>> for KnobSpace {
    type Error = KnobSpaceError;

    fn try_from(knobs: Vec<Knob>) -> Result<Self, KnobSpaceError> {
        Self::new(knobs)
    }
}

impl From<KnobSpace> for Vec<Knob> {
    fn from(space: KnobSpace) -> Self {
        space.knobs
    }
}

impl KnobSpace {
    /// A space of `knobs`, in this order.
    ///
    /// # Errors
    /// [`KnobSpaceError`] for more than [`KnobLevels::MAX_KNOBS`] knobs, duplicate names, or a
    /// knob that has no level, more than [`KnobLevels::MAX_LEVELS`], or a value that is not
    /// finite.
    pub fn new(knobs: Vec<Knob>) -> Result<Self, KnobSpaceError> {
        if knobs.len() > KnobLevels::MAX_KNOBS {
            return Err(KnobSpaceError::TooManyKnobs(knobs.len()));
        }
        for (index, knob) in knobs.iter().enumerate() {
            let valid_count = (1..=KnobLevels::MAX_LEVELS).contains(&knob.levels.len());
            if !valid_count || knob.levels.iter().any(|level| !level.value.is_finite()) {
                return Err(KnobSpaceError::BadLevels(knob.name.clone()));
            }
            if knobs[..index].iter().any(|other| other.name == knob.name) {
                return Err(KnobSpaceError::Duplicate(knob.name.clone()));
            }
        }
        Ok(Self { knobs })
    }

    /// The knobs, in the order in which settings pack them.
    pub fn knobs(&self) -> &[Knob] {
        &self.knobs
    }

    /// Number of knobs.
    pub fn len(&self) -> usize {
        self.knobs.len()
    }

    /// Whether the space has no knobs.
    pub fn is_empty(&self) -> bool {
        self.knobs.is_empty()
    }

    /// Index of the knob called `name`; `None` if the space lacks it.
    pub fn index_of(&self, name: &str) -> Option<usize> {
        self.knobs.iter().position(|knob| knob.name == name)
    }

    /// Value of the knob called `name`, in the knob's unit; `None` if the space lacks the knob or
    /// the level.
    pub fn value(&self, settings: KnobLevels, name: &str) -> Option<f64> {
        let knob = self.index_of(name)?;
        Some(self.knobs[knob].levels.get(settings.level(knob))?.value)
    }

    /// Every knob at its highest level: the best settings, the reference of the error metric.
    pub fn highest(&self) -> KnobLevels {
        self.preset(1.0)
    }

    /// Every knob at its lowest level: the cheapest settings.
    pub fn lowest(&self) -> KnobLevels {
        self.preset(0.0)
    }

    /// Every knob at the same `share` of its levels, rounded, as in an engine's fixed presets.
    /// `share` is clamped to 0 to 1; NaN counts as 0.
    pub fn preset(&self, share: f64) -> KnobLevels {
        let share = if share.is_nan() { 0.0 } else { share.clamp(0.0, 1.0) };
        self.from_levels(|_, knob| (share * (knob.levels.len() - 1) as f64).round() as usize)
    }

    /// Settings with the level that `level` returns for each knob and its index. Levels beyond a
    /// knob's last are clamped to it.
    pub fn from_levels(&self, mut level: impl FnMut(usize, &Knob) -> usize) -> KnobLevels {
        self.knobs.iter().enumerate().fold(KnobLevels::default(), |settings, (index, knob)| {
            settings.with_level(index, level(index, knob).min(knob.levels.len() - 1))
        })
    }

    /// Whether every level exists and all bits beyond the space's knobs are 0.
    pub fn contains(&self, settings: KnobLevels) -> bool {
        settings == self.from_levels(|index, _| settings.level(index))
    }

    /// The subspace of the knobs called `names`, in this space's order. The other knobs are held at
    /// their highest levels.
    ///
    /// # Errors
    /// [`KnobSpaceError::Unknown`] when the space lacks a name.
    pub fn subset<'a>(
        &self,
        names: impl IntoIterator<Item = &'a str>,
    ) -> Result<Self, KnobSpaceError> {
        let mut chosen = vec![false; self.len()];
        for name in names {
            chosen[self.index_of(name).ok_or_else(|| self.unknown(name))?] = true;
        }
        let knobs = self
            .knobs
            .iter()
            .zip(chosen)
            .filter(|(_, chosen)| *chosen)
            .map(|(knob, _)| knob.clone())
            .collect();
        Ok(Self { knobs })
    }

    fn unknown(&self, name: &str) -> KnobSpaceError {
        KnobSpaceError::Unknown {
            name: name.to_owned(),
            known: join(self.knobs.iter().map(|knob| knob.name.as_str())),
        }
    }
}

/// Between the names that an error lists.
const SEPARATOR: &str = ", ";

fn join<'a>(names: impl Iterator<Item = &'a str>) -> String {
    names.collect::<Vec<_>>().join(SEPARATOR)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three knobs; the resolution of maps needs VPLs.
    pub(super) fn space() -> KnobSpace {
        KnobSpace::new(vec![
            Knob::new("gi_vpl_count", [0.0, 32.0, 64.0]),
            Knob::new("rsm_resolution", [64.0, 128.0]).needing("gi_vpl_count", 1),
            Knob::labelled("antialiasing", [(0.0, "off"), (1.0, "FXAA")]),
        ])
        .expect("a valid space")
    }

    #[test]
    fn presets_accept_any_share() {
        let space = space();
        for share in [f64::NAN, f64::NEG_INFINITY, -1.0, 0.0, 0.5, 1.0, 2.0, f64::INFINITY] {
            assert!(space.contains(space.preset(share)));
        }
        assert_eq!(space.preset(f64::NAN), space.lowest());
        assert_eq!(space.preset(f64::INFINITY), space.highest());
    }

    #[test]
    fn invalid_spaces_are_rejected() {
        let twice = vec![Knob::new("a", [1.0]), Knob::new("a", [1.0])];
        assert_eq!(KnobSpace::new(twice), Err(KnobSpaceError::Duplicate("a".into())));
        assert_eq!(
            KnobSpace::new(vec![Knob::new("a", [])]),
            Err(KnobSpaceError::BadLevels("a".into()))
        );
        assert_eq!(
            KnobSpace::new(vec![Knob::new("a", [f64::NAN])]),
            Err(KnobSpaceError::BadLevels("a".into()))
        );
        let many = (0..33).map(|i| Knob::new(&format!("k{i}"), [0.0])).collect();
        assert_eq!(KnobSpace::new(many), Err(KnobSpaceError::TooManyKnobs(33)));
    }
}
