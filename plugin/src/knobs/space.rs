//! What can be set: knobs, their levels, and settings as one level per knob packed into an integer.
//!
//! Plain Rust: knows no renderer. How a level is applied to a camera is
//! [`KnobDriver`](super::KnobDriver)'s business.

use bevy::reflect::Reflect;
use serde::{Deserialize, Serialize};

/// Bits that each knob takes in [`RenderSettings`].
const BITS: u32 = 4;

/// One level per knob of a [`KnobSpace`], four bits each, the space's first knob in the lowest
/// bits.
///
/// Wang et al. 2016, section 3.7.2, pack theirs the same way into 32 bits.
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
pub struct RenderSettings(u64);

impl RenderSettings {
    /// Most knobs that a space can have.
    pub const MAX_KNOBS: usize = (u64::BITS / BITS) as usize;
    /// Most levels that a knob can have.
    pub const MAX_LEVELS: usize = 1 << BITS;

    /// The settings that `bits` pack.
    pub const fn from_bits(bits: u64) -> Self {
        Self(bits)
    }

    /// The packed form.
    pub const fn bits(self) -> u64 {
        self.0
    }

    /// The level of the space's `knob`-th knob.
    pub const fn level(self, knob: usize) -> usize {
        ((self.0 >> (knob as u32 * BITS)) & (Self::MAX_LEVELS as u64 - 1)) as usize
    }

    /// These settings with the `knob`-th knob at `level`, which must be below
    /// [`MAX_LEVELS`](Self::MAX_LEVELS).
    #[must_use]
    pub const fn with_level(self, knob: usize, level: usize) -> Self {
        assert!(level < Self::MAX_LEVELS, "a level takes four bits");
        let shift = knob as u32 * BITS;
        let mask = (Self::MAX_LEVELS as u64 - 1) << shift;
        Self((self.0 & !mask) | ((level as u64) << shift))
    }
}

/// One position of a knob.
#[derive(Clone, Debug, PartialEq, Reflect, Serialize, Deserialize)]
pub struct Level {
    /// The quantity that the level stands for, in the knob's own unit (samples, texels, a share of
    /// pixels…).
    pub value: f64,
    /// How people read it.
    pub label: String,
}

/// A condition under which a knob acts at all.
#[derive(Clone, Debug, PartialEq, Eq, Reflect, Serialize, Deserialize)]
pub struct Need {
    /// Name of the other knob.
    pub knob: String,
    /// The level that the other knob must have, at the least.
    pub at_least: usize,
}

/// One thing that trades quality for power.
#[derive(Clone, Debug, PartialEq, Reflect, Serialize, Deserialize)]
pub struct Knob {
    /// Identifier in snake case, unique in its space, the same on the command line and in files.
    pub name: String,
    /// Ordered, cheapest first; at least one.
    pub levels: Vec<Level>,
    /// Where it is not met, every level of this knob gives the same picture at the same cost.
    pub needs: Option<Need>,
}

impl Knob {
    /// A knob whose levels are labelled by their values.
    pub fn new(name: &str, levels: impl IntoIterator<Item = f64>) -> Self {
        Self::labelled(name, levels.into_iter().map(|value| (value, value.to_string())))
    }

    /// A knob with its own labels.
    pub fn labelled<L: Into<String>>(
        name: &str,
        levels: impl IntoIterator<Item = (f64, L)>,
    ) -> Self {
        let levels =
            levels.into_iter().map(|(value, label)| Level { value, label: label.into() }).collect();
        Self { name: name.to_owned(), levels, needs: None }
    }

    /// The same knob, acting only while `knob` is at level `at_least` or above.
    #[must_use]
    pub fn needing(mut self, knob: &str, at_least: usize) -> Self {
        self.needs = Some(Need { knob: knob.to_owned(), at_least });
        self
    }
}

/// Why a list of knobs is not a space, or a text not settings of it.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum KnobSpaceError {
    /// More knobs than [`RenderSettings`] packs.
    #[error("{0} knobs, where settings pack at most {max}: leave some out", max = RenderSettings::MAX_KNOBS)]
    TooManyKnobs(usize),
    /// No level, too many levels, or a value that is not finite.
    #[error("knob `{0}` must have 1 to {max} levels with finite values", max = RenderSettings::MAX_LEVELS)]
    BadLevels(String),
    /// Two knobs of one name.
    #[error("knob `{0}` appears twice")]
    Duplicate(String),
    /// A name that no knob of the space has.
    #[error("unknown knob `{name}`: the knobs here are {known}")]
    Unknown {
        /// The name as given.
        name: String,
        /// What there is.
        known: String,
    },
    /// A level that the knob lacks.
    #[error("knob `{knob}` has no level `{level}`: its levels are {known}")]
    UnknownLevel {
        /// The knob.
        knob: String,
        /// The level as given.
        level: String,
        /// What there is.
        known: String,
    },
    /// Something other than `knob=level`.
    #[error("`{0}` is not of the form knob=level, nor one of `max` and `min`")]
    NotAnAssignment(String),
}

/// The knobs of a scene.
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
    /// When they are too many, share a name, or one has no level, too many, or one with a value
    /// that is not finite.
    pub fn new(knobs: Vec<Knob>) -> Result<Self, KnobSpaceError> {
        if knobs.len() > RenderSettings::MAX_KNOBS {
            return Err(KnobSpaceError::TooManyKnobs(knobs.len()));
        }
        for (index, knob) in knobs.iter().enumerate() {
            let right = (1..=RenderSettings::MAX_LEVELS).contains(&knob.levels.len());
            if !right || knob.levels.iter().any(|level| !level.value.is_finite()) {
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

    /// How many knobs there are.
    pub fn len(&self) -> usize {
        self.knobs.len()
    }

    /// Whether nothing can be set.
    pub fn is_empty(&self) -> bool {
        self.knobs.is_empty()
    }

    /// Position of the knob called `name`.
    pub fn index_of(&self, name: &str) -> Option<usize> {
        self.knobs.iter().position(|knob| knob.name == name)
    }

    /// The value of the knob called `name`, where the space has it.
    pub fn value(&self, settings: RenderSettings, name: &str) -> Option<f64> {
        let knob = self.index_of(name)?;
        Some(self.knobs[knob].levels.get(settings.level(knob))?.value)
    }

    /// Every knob at its best: what the others' error is measured against.
    pub fn highest(&self) -> RenderSettings {
        self.preset(1.0)
    }

    /// Every knob at its cheapest.
    pub fn lowest(&self) -> RenderSettings {
        self.preset(0.0)
    }

    /// Every knob at the same `share` (0 to 1) of its levels, rounded: the fixed presets that
    /// engines ship.
    pub fn preset(&self, share: f64) -> RenderSettings {
        let share = if share.is_nan() { 0.0 } else { share.clamp(0.0, 1.0) };
        self.from_levels(|_, knob| (share * (knob.levels.len() - 1) as f64).round() as usize)
    }

    /// Settings whose level is `level` of each knob's position and the knob.
    pub fn from_levels(&self, mut level: impl FnMut(usize, &Knob) -> usize) -> RenderSettings {
        self.knobs.iter().enumerate().fold(RenderSettings::default(), |settings, (index, knob)| {
            settings.with_level(index, level(index, knob).min(knob.levels.len() - 1))
        })
    }

    /// Whether every level exists and nothing beyond the space's knobs is set.
    pub fn contains(&self, settings: RenderSettings) -> bool {
        settings == self.from_levels(|index, _| settings.level(index))
    }

    /// The same picture at the same cost, with every knob that has no effect at level 0, so that
    /// equal settings compare equal.
    ///
    /// Without it a search renders the same picture under many names.
    #[must_use]
    pub fn canonical(&self, settings: RenderSettings) -> RenderSettings {
        self.from_levels(
            |index, knob| if self.acts(settings, knob) { settings.level(index) } else { 0 },
        )
    }

    /// Each of `settings` once, in its [canonical](Self::canonical) form, in the order of first
    /// appearance.
    pub fn canonical_once(
        &self,
        settings: impl IntoIterator<Item = RenderSettings>,
    ) -> Vec<RenderSettings> {
        let mut seen = std::collections::HashSet::new();
        settings
            .into_iter()
            .map(|settings| self.canonical(settings))
            .filter(|settings| seen.insert(*settings))
            .collect()
    }

    fn acts(&self, settings: RenderSettings, knob: &Knob) -> bool {
        self.needed(knob).all(|(other, at_least)| settings.level(other) >= at_least)
    }

    /// Positions and least levels of the knob that `knob` needs, of the one which that needs, and
    /// so on. A knob that is not in this space is held at its best, so it meets every need. Ends
    /// even where knobs need each other in a circle.
    fn needed<'a>(&'a self, knob: &'a Knob) -> impl Iterator<Item = (usize, usize)> + 'a {
        let next = |knob: &'a Knob| {
            let need = knob.needs.as_ref()?;
            Some((self.index_of(&need.knob)?, need.at_least))
        };
        std::iter::successors(next(knob), move |(other, _)| next(&self.knobs[*other]))
            .take(self.len())
    }

    /// The cheapest settings at which `knob` does something: one for each level of the knob that it
    /// needs, or the cheapest alone where it needs none. Who shows a knob's levels at each of them
    /// has shown every pair of the two.
    pub fn cheapest_with(&self, knob: &Knob) -> Vec<RenderSettings> {
        let mut needed = self.needed(knob);
        let first = needed.next();
        let base = needed.fold(self.lowest(), |settings, (other, at_least)| {
            settings.with_level(other, at_least.min(self.knobs[other].levels.len() - 1))
        });
        let Some((other, at_least)) = first else { return vec![base] };
        (at_least..self.knobs[other].levels.len())
            .map(|level| base.with_level(other, level))
            .collect()
    }

    /// How many different settings there are, knobs without effect not counted; `u64::MAX` where
    /// there are more than that.
    pub fn combinations(&self) -> u64 {
        // What needs another knob comes after it in practice; counting by enumeration would be
        // exact too, but spaces reach millions.
        fn count(space: &KnobSpace, index: usize, settings: RenderSettings) -> u64 {
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
            let levels = if space.acts(settings, knob) { knob.levels.len() } else { 1 };
            (0..levels).fold(0, |sum, level| {
                sum.saturating_add(count(space, index + 1, settings.with_level(index, level)))
            })
        }
        count(self, 0, self.highest())
    }

    /// Every different settings once, in counting order.
    pub fn iter(&self) -> impl Iterator<Item = RenderSettings> + '_ {
        let mut next = Some(self.lowest());
        std::iter::from_fn(move || {
            let current = next?;
            next = self.successor(current);
            Some(current)
        })
        .filter(|settings| self.canonical(*settings) == *settings)
    }

    fn successor(&self, settings: RenderSettings) -> Option<RenderSettings> {
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

    /// The space of the knobs called `names`, in this space's order. The others are held at their
    /// best.
    ///
    /// # Errors
    /// When a name is unknown.
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

    /// Reads `max`, `min`, or `knob=level` pairs between commas, which change the best settings. A
    /// level is given by its label.
    ///
    /// # Errors
    /// When the text is of another form, or names a knob or a level that is not there.
    pub fn parse(&self, text: &str) -> Result<RenderSettings, KnobSpaceError> {
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

    /// `knob=level` pairs between commas: what [`parse`](Self::parse) reads.
    pub fn describe(&self, settings: RenderSettings) -> String {
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
    fn every_combination_appears_once_and_none_is_an_alias() {
        let space = space();
        let all: Vec<_> = space.iter().collect();
        // Without VPLs the RSM's resolution means nothing: (1 + 2 * 2) * 2.
        assert_eq!(all.len(), 10);
        assert_eq!(space.combinations(), 10);
        assert!(all.iter().all(|s| space.contains(*s) && space.canonical(*s) == *s));
        assert_eq!(all.iter().collect::<std::collections::HashSet<_>>().len(), 10);
    }

    #[test]
    fn needs_nest() {
        let knobs = vec![
            Knob::new("count", [0.0, 1.0, 2.0]),
            Knob::new("rays", [0.0, 2.0, 8.0]).needing("count", 1),
            Knob::new("sky", [0.0, 8.0]).needing("rays", 1),
        ];
        let space = KnobSpace::new(knobs).expect("a valid space");
        let all: Vec<_> = space.iter().collect();
        // Without a count nothing else matters, and without rays no sky: 1 + 2 * (1 + 2 * 2).
        assert_eq!((all.len(), space.combinations()), (11, 11));
        let dark = RenderSettings::default().with_level(1, 2).with_level(2, 1);
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
    fn presets_survive_any_share() {
        let space = space();
        for share in [f64::NAN, f64::NEG_INFINITY, -1.0, 0.0, 0.5, 1.0, 2.0, f64::INFINITY] {
            assert!(space.contains(space.preset(share)));
        }
        assert_eq!(space.preset(f64::NAN), space.lowest());
        assert_eq!(space.preset(f64::INFINITY), space.highest());
    }

    #[test]
    fn bad_spaces_are_refused() {
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
