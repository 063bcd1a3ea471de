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
}

#[cfg(test)]
mod tests {
    use super::super::tests::space;
    use super::*;

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
    fn the_largest_space_is_counted_without_overflow() {
        let knobs = (0..32).map(|i| Knob::new(&format!("k{i}"), (0..16).map(f64::from))).collect();
        assert_eq!(
            KnobSpace::new(knobs).expect("as large as settings pack").combinations(),
            u64::MAX
        );
    }
}
