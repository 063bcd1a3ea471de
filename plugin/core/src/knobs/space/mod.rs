//! A space: the knobs of a map or an app, in the order in which settings pack their levels.
//!
//! Independent of the renderer: a driver of the plugin applies a level to a camera.

mod enumerate;

use serde::{Deserialize, Serialize};

use super::{Knob, KnobLevels};

/// An ordered set of knobs, in the order in which [`KnobLevels`] packs their levels.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "bevy", derive(bevy_reflect::Reflect))]
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
        let names: Vec<&str> = names.into_iter().collect();
        if let Some(unknown) = names.iter().find(|name| self.index_of(name).is_none()) {
            return Err(self.unknown(unknown));
        }
        let is_named = |knob: &&Knob| names.contains(&knob.name.as_str());
        let knobs = self.knobs.iter().filter(is_named).cloned().collect();
        Ok(Self { knobs })
    }

    /// Parses `max`, `min` and `knob=level` pairs, separated by commas and applied in order,
    /// starting from the best settings. A level is given by its label.
    ///
    /// # Errors
    /// [`KnobSpaceError`] when the text is of another form, or names an unknown knob or level.
    pub fn parse(&self, text: &str) -> Result<KnobLevels, KnobSpaceError> {
        let mut settings = self.highest();
        for part in text.split(',').map(str::trim).filter(|part| !part.is_empty()) {
            match part {
                "max" => settings = self.highest(),
                "min" => settings = self.lowest(),
                _ => {
                    let (name, label) = part
                        .split_once('=')
                        .ok_or_else(|| KnobSpaceError::NotAnAssignment(part.to_owned()))?;
                    let (name, label) = (name.trim(), label.trim());
                    let index = self.index_of(name).ok_or_else(|| self.unknown(name))?;
                    let levels = &self.knobs[index].levels;
                    let level =
                        levels.iter().position(|level| level.label == label).ok_or_else(|| {
                            KnobSpaceError::UnknownLevel {
                                knob: name.to_owned(),
                                level: label.to_owned(),
                                known: join(levels.iter().map(|level| level.label.as_str())),
                            }
                        })?;
                    settings = settings.with_level(index, level);
                }
            }
        }
        Ok(settings)
    }

    /// The settings as `knob=level` pairs separated by commas, as [`parse`](Self::parse) reads
    /// them; `?` for a level that the knob lacks.
    pub fn describe(&self, settings: KnobLevels) -> String {
        let pair = |(index, knob): (usize, &Knob)| {
            let label =
                knob.levels.get(settings.level(index)).map_or("?", |level| level.label.as_str());
            format!("{}={label}", knob.name)
        };
        self.knobs.iter().enumerate().map(pair).collect::<Vec<_>>().join(",")
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

/// Why a list of knobs is not a valid space, or a text not valid settings.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum KnobSpaceError {
    /// More knobs than [`KnobLevels`] can pack.
    #[error("{0} knobs, but settings pack at most {max}: leave some out", max = KnobLevels::MAX_KNOBS)]
    TooManyKnobs(usize),
    /// No level, too many levels, or a value that is not finite.
    #[error("knob `{0}` must have 1 to {max} levels with finite values", max = KnobLevels::MAX_LEVELS)]
    BadLevels(String),
    /// Two knobs with the same name.
    #[error("knob `{0}` appears twice")]
    Duplicate(String),
    /// A name that is not a knob of the space.
    #[error("unknown knob `{name}`: {}the knobs here are {known}", did_you_mean(name, known.split(SEPARATOR)))]
    Unknown {
        /// The name as given.
        name: String,
        /// The valid names, separated by commas.
        known: String,
    },
    /// A label that is not a level of the knob.
    #[error("knob `{knob}` has no level `{level}`: {}its levels are {known}", did_you_mean(level, known.split(SEPARATOR)))]
    UnknownLevel {
        /// The knob.
        knob: String,
        /// The level as given.
        level: String,
        /// The valid names, separated by commas.
        known: String,
    },
    /// Text other than `knob=level`, `max` or `min`.
    #[error("`{0}` is not of the form knob=level, nor one of `max` and `min`")]
    NotAnAssignment(String),
}

/// "did you mean `X`? " with the name of `known` that is nearest to `name`; empty where none is near.
///
/// Near is an edit distance (Damerau and Levenshtein, restricted) of at most a third of the letters,
/// regardless of case. A fixed distance would suggest any short name for any other.
pub fn did_you_mean<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> String {
    let lower = name.to_lowercase();
    let near = known.into_iter().filter_map(|known| {
        let longer = name.chars().count().max(known.chars().count());
        let distance = strsim::osa_distance(&lower, &known.to_lowercase());
        (distance <= longer / 3).then_some((distance, known))
    });
    // The first of equally near ones.
    let nearest = near.min_by_key(|(distance, _)| *distance);
    nearest.map(|(_, known)| format!("did you mean `{known}`? ")).unwrap_or_default()
}

#[cfg(test)]
mod tests;
