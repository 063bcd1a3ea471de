//! Distinct settings of a space: those that differ in image or cost.
//!
//! A knob that depends on another has no effect below a level of that other one. Without canonical
//! forms a search would render the same image for many settings.

use super::{Knob, KnobLevels, KnobSpace};

impl KnobSpace {
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

    /// Whether `knob` has an effect in `settings`: whether they meet what it needs.
    pub fn has_effect(&self, settings: KnobLevels, knob: &Knob) -> bool {
        self.dependencies(knob).all(|(other, at_least)| settings.level(other) >= at_least)
    }

    /// The lowest level of `knob` at which a knob that needs it has an effect; `None` if none does.
    pub(crate) fn needed_level(&self, knob: &Knob) -> Option<usize> {
        let needs = self.knobs.iter().filter_map(|other| other.needs.as_ref());
        needs.filter(|need| need.knob == knob.name).map(|need| need.at_least).min()
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
        // Enumeration would be exact too, but spaces reach millions of settings.
        fn count(space: &KnobSpace, index: usize, settings: KnobLevels) -> u64 {
            let Some(knob) = space.knobs.get(index) else { return 1 };
            let levels = if space.has_effect(settings, knob) { knob.levels.len() } else { 1 };
            if space.needed_level(knob).is_none() {
                return count(space, index + 1, settings).saturating_mul(levels as u64);
            }
            (0..levels).fold(0, |sum, level| {
                sum.saturating_add(count(space, index + 1, settings.with_level(index, level)))
            })
        }
        count(self, 0, self.highest())
    }

    /// All distinct settings in [canonical](Self::canonical) form, in counting order with the first
    /// knob fastest.
    pub fn iter(&self) -> impl Iterator<Item = KnobLevels> + '_ {
        std::iter::successors(Some(self.lowest()), |settings| self.successor(*settings))
            .filter(|settings| self.canonical(*settings) == *settings)
    }

    fn successor(&self, mut settings: KnobLevels) -> Option<KnobLevels> {
        for (index, knob) in self.knobs.iter().enumerate() {
            let level = settings.level(index) + 1;
            if level < knob.levels.len() {
                return Some(settings.with_level(index, level));
            }
            settings = settings.with_level(index, 0);
        }
        None
    }
}
