//! Knobs, their levels, and settings: one level per knob, packed into an integer.
//!
//! Independent of the renderer: a [`KnobDriver`](super::KnobDriver) applies a level to a camera.

use bevy::reflect::Reflect;
use serde::{Deserialize, Serialize};

/// Bits per knob in [`KnobLevels`].
const BITS: u32 = 4;

/// One level per knob of a [`KnobSpace`], four bits each, with the space's first knob in the lowest
/// bits. Higher levels give higher quality, usually at a higher cost.
///
/// Wang et al. 2016, section 3.7.2, use the same packing in 32 bits.
#[derive(
    Clone,
    Copy,
    Debug,
    Default,
    PartialEq,
    Eq,
    Hash,
    PartialOrd,
    Ord,
    Reflect,
    Serialize,
    Deserialize,
)]
#[serde(transparent)]
pub struct KnobLevels(u64);

impl KnobLevels {
    /// Maximum number of knobs of a space.
    pub const MAX_KNOBS: usize = (u64::BITS / BITS) as usize;
    /// Maximum number of levels of a knob.
    pub const MAX_LEVELS: usize = 1 << BITS;

    /// The settings of the packed form `bits`. Any value is accepted; [`KnobSpace::contains`]
    /// checks it.
    pub const fn from_bits(bits: u64) -> Self {
        Self(bits)
    }

    /// The packed form.
    pub const fn bits(self) -> u64 {
        self.0
    }

    /// Level of the space's `knob`-th knob, 0 to 15, for `knob` from 0 to 15.
    pub const fn level(self, knob: usize) -> usize {
        ((self.0 >> (knob as u32 * BITS)) & (Self::MAX_LEVELS as u64 - 1)) as usize
    }

    /// These settings with the `knob`-th knob, 0 to 15, at `level`. Panics if `level` is not below
    /// [`MAX_LEVELS`](Self::MAX_LEVELS).
    #[must_use]
    pub const fn with_level(self, knob: usize, level: usize) -> Self {
        assert!(level < Self::MAX_LEVELS, "a level takes four bits");
        let shift = knob as u32 * BITS;
        let mask = (Self::MAX_LEVELS as u64 - 1) << shift;
        Self((self.0 & !mask) | ((level as u64) << shift))
    }
}

/// One level of a knob.
#[derive(Clone, Debug, PartialEq, Reflect, Serialize, Deserialize)]
pub struct Level {
    /// The level's value, in the knob's own unit (samples, texels, a share of pixels…); finite,
    /// increasing with quality.
    pub value: f64,
    /// Label of the level on the command line, in files and in reports. Should be unique in its
    /// knob.
    pub label: String,
}

/// Condition under which a knob has an effect: another knob at a minimum level.
#[derive(Clone, Debug, PartialEq, Eq, Reflect, Serialize, Deserialize)]
pub struct DependsOn {
    /// Name of the other knob.
    pub knob: String,
    /// Minimum level of the other knob, as an index.
    pub at_least: usize,
}

/// A quality knob: a rendering parameter that trades quality for power.
#[derive(Clone, Debug, PartialEq, Reflect, Serialize, Deserialize)]
pub struct Knob {
    /// Identifier in snake case, unique in its space; used on the command line and in files.
    pub name: String,
    /// Levels in order of increasing quality, usually cheapest first; 1 to
    /// [`KnobLevels::MAX_LEVELS`].
    pub levels: Vec<Level>,
    /// Dependency on another knob. Unless it is met, all levels of this knob give the same image at
    /// the same cost.
    pub needs: Option<DependsOn>,
}

impl Knob {
    /// A knob with its values as labels. [`KnobSpace::new`] checks the levels.
    pub fn new(name: &str, levels: impl IntoIterator<Item = f64>) -> Self {
        Self::labelled(name, levels.into_iter().map(|value| (value, value.to_string())))
    }

    /// A knob with a label per level. [`KnobSpace::new`] checks the levels.
    pub fn labelled<L: Into<String>>(
        name: &str,
        levels: impl IntoIterator<Item = (f64, L)>,
    ) -> Self {
        let levels =
            levels.into_iter().map(|(value, label)| Level { value, label: label.into() }).collect();
        Self { name: name.to_owned(), levels, needs: None }
    }

    /// The same knob, with an effect only while `knob` is at level `at_least` or above.
    #[must_use]
    pub fn needing(mut self, knob: &str, at_least: usize) -> Self {
        self.needs = Some(DependsOn { knob: knob.to_owned(), at_least });
        self
    }
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
    #[error("unknown knob `{name}`: the knobs here are {known}")]
    Unknown {
        /// The name as given.
        name: String,
        /// The valid names, separated by commas.
        known: String,
    },
    /// A label that is not a level of the knob.
    #[error("knob `{knob}` has no level `{level}`: its levels are {known}")]
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

/// An ordered set of knobs, in the order in which [`KnobLevels`] packs their levels.
#[derive(Clone, Debug, Default, PartialEq, Reflect, Serialize, Deserialize)]
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

    /// Equivalent settings, with every knob that has no effect at level 0, so that settings of the
    /// same image and cost compare equal.
    ///
    /// Without it a search would render the same image for many settings.
    #[must_use]
    pub fn canonical(&self, settings: KnobLevels) -> KnobLevels {
        self.from_levels(
            |index, knob| if self.has_effect(settings, knob) { settings.level(index) } else { 0 },
        )
    }

    /// The distinct [canonical](Self::canonical) forms of `settings`, in the order of first
    /// appearance.
    pub fn canonical_once(
        &self,
        settings: impl IntoIterator<Item = KnobLevels>,
    ) -> Vec<KnobLevels> {
        let mut seen = std::collections::HashSet::new();
        settings
            .into_iter()
            .map(|settings| self.canonical(settings))
            .filter(|settings| seen.insert(*settings))
            .collect()
    }

    fn has_effect(&self, settings: KnobLevels, knob: &Knob) -> bool {
        self.dependencies(knob).all(|(other, at_least)| settings.level(other) >= at_least)
    }

    /// Chain of dependencies of `knob`: index and minimum level of the knob that it needs, of the
    /// knob that this one needs, and so on. A knob outside this space is held at its highest level,
    /// so it meets every condition. Ends even for circular dependencies.
    fn dependencies<'a>(&'a self, knob: &'a Knob) -> impl Iterator<Item = (usize, usize)> + 'a {
        let next = |knob: &'a Knob| {
            let need = knob.needs.as_ref()?;
            Some((self.index_of(&need.knob)?, need.at_least))
        };
        std::iter::successors(next(knob), move |(other, _)| next(&self.knobs[*other]))
            .take(self.len())
    }

    /// The cheapest settings at which `knob` has an effect: one per valid level of the knob that it
    /// needs, or [`lowest`](Self::lowest) alone if it needs none. Showing all levels of `knob` at
    /// each of them covers every pair of levels of the two knobs.
    pub fn cheapest_with(&self, knob: &Knob) -> Vec<KnobLevels> {
        let mut dependencies = self.dependencies(knob);
        let first = dependencies.next();
        let base = dependencies.fold(self.lowest(), |settings, (other, at_least)| {
            settings.with_level(other, at_least.min(self.knobs[other].levels.len() - 1))
        });
        let Some((other, at_least)) = first else { return vec![base] };
        (at_least..self.knobs[other].levels.len())
            .map(|level| base.with_level(other, level))
            .collect()
    }

    /// Number of distinct settings in [canonical](Self::canonical) form, saturating at `u64::MAX`.
    pub fn combinations(&self) -> u64 {
        // A knob usually follows the knob that it needs. Enumeration would be exact too, but spaces
        // reach millions of settings.
        fn count(space: &KnobSpace, index: usize, settings: KnobLevels) -> u64 {
            let Some(knob) = space.knobs.get(index) else { return 1 };
            let independent = |from: usize| {
                space.knobs[from..].iter().all(|k| k.needs.is_none())
                    && !space.knobs[from..].iter().any(|k| {
                        space
                            .knobs
                            .iter()
                            .any(|o| o.needs.as_ref().is_some_and(|n| n.knob == k.name))
                    })
            };
            if independent(index) {
                return space.knobs[index..]
                    .iter()
                    .fold(1, |product, k| product.saturating_mul(k.levels.len() as u64));
            }
            let levels = if space.has_effect(settings, knob) { knob.levels.len() } else { 1 };
            (0..levels).fold(0, |sum, level| {
                sum.saturating_add(count(space, index + 1, settings.with_level(index, level)))
            })
        }
        count(self, 0, self.highest())
    }

    /// All distinct settings in [canonical](Self::canonical) form, in counting order with the first
    /// knob fastest.
    pub fn iter(&self) -> impl Iterator<Item = KnobLevels> + '_ {
        let mut next = Some(self.lowest());
        std::iter::from_fn(move || {
            let current = next?;
            next = self.successor(current);
            Some(current)
        })
        .filter(|settings| self.canonical(*settings) == *settings)
    }

    fn successor(&self, settings: KnobLevels) -> Option<KnobLevels> {
        let mut settings = settings;
        for (index, knob) in self.knobs.iter().enumerate() {
            let level = settings.level(index) + 1;
            if level < knob.levels.len() {
                return Some(settings.with_level(index, level));
            }
            settings = settings.with_level(index, 0);
        }
        None
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

fn join<'a>(names: impl Iterator<Item = &'a str>) -> String {
    names.collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn space() -> KnobSpace {
        KnobSpace::new(vec![
            Knob::new("gi_vpl_count", [0.0, 32.0, 64.0]),
            Knob::new("rsm_resolution", [64.0, 128.0]).needing("gi_vpl_count", 1),
            Knob::labelled("antialiasing", [(0.0, "off"), (1.0, "FXAA")]),
        ])
        .expect("a valid space")
    }

    #[test]
    fn every_combination_appears_once_in_canonical_form() {
        let space = space();
        let all: Vec<_> = space.iter().collect();
        // Without VPLs the RSM's resolution has no effect: (1 + 2 * 2) * 2.
        assert_eq!(all.len(), 10);
        assert_eq!(space.combinations(), 10);
        assert!(all.iter().all(|s| space.contains(*s) && space.canonical(*s) == *s));
        assert_eq!(all.iter().collect::<std::collections::HashSet<_>>().len(), 10);
    }

    #[test]
    fn dependencies_chain() {
        let knobs = vec![
            Knob::new("count", [0.0, 1.0, 2.0]),
            Knob::new("rays", [0.0, 2.0, 8.0]).needing("count", 1),
            Knob::new("sky", [0.0, 8.0]).needing("rays", 1),
        ];
        let space = KnobSpace::new(knobs).expect("a valid space");
        let all: Vec<_> = space.iter().collect();
        // Without a count there are no rays, and without rays no sky: 1 + 2 * (1 + 2 * 2).
        assert_eq!((all.len(), space.combinations()), (11, 11));
        let dark = KnobLevels::default().with_level(1, 2).with_level(2, 1);
        assert_eq!(space.canonical(dark), space.lowest());
        let shown: Vec<_> = space
            .cheapest_with(&space.knobs()[2])
            .iter()
            .map(|s| [s.level(0), s.level(1), s.level(2)])
            .collect();
        assert_eq!(shown, [[1, 1, 0], [1, 2, 0]]);
        assert_eq!(space.cheapest_with(&space.knobs()[0]), [space.lowest()]);
        let circle = vec![
            Knob::new("a", [0.0, 1.0]).needing("b", 1),
            Knob::new("b", [0.0, 1.0]).needing("a", 1),
        ];
        let space = KnobSpace::new(circle).expect("a valid space");
        assert_eq!(space.canonical(space.highest()), space.highest());
    }

    #[test]
    fn text_and_settings_round_trip() {
        let space = space();
        for settings in space.iter() {
            assert_eq!(space.parse(&space.describe(settings)), Ok(settings));
        }
        assert_eq!(space.parse("min,antialiasing=FXAA").map(|s| s.level(2)), Ok(1));
        assert!(matches!(space.parse("sharpness=3"), Err(KnobSpaceError::Unknown { .. })));
        assert!(matches!(
            space.parse("antialiasing=MSAA"),
            Err(KnobSpaceError::UnknownLevel { .. })
        ));
        assert!(matches!(space.parse("best"), Err(KnobSpaceError::NotAnAssignment(_))));
    }

    #[test]
    fn the_largest_space_is_counted_without_overflow() {
        let knobs = (0..16).map(|i| Knob::new(&format!("k{i}"), (0..16).map(f64::from))).collect();
        assert_eq!(
            KnobSpace::new(knobs).expect("as large as settings pack").combinations(),
            u64::MAX
        );
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
        let many = (0..17).map(|i| Knob::new(&format!("k{i}"), [0.0])).collect();
        assert_eq!(KnobSpace::new(many), Err(KnobSpaceError::TooManyKnobs(17)));
    }
}
