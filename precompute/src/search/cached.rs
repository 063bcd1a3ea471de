//! Caches evaluations, so that none is made twice.

use std::collections::BTreeMap;

use bevy_frugal_gi::frontier::{CostPoint, FrontierPoint};
use bevy_frugal_gi::knobs::KnobLevels;

use super::Evaluate;

/// A caching evaluator. Settings must be [canonical](bevy_frugal_gi::knobs::KnobSpace::canonical),
/// or one image has several names.
#[derive(Debug)]
pub(super) struct Cached<'e, E> {
    inner: &'e mut E,
    // Sorted, so that iteration is deterministic.
    known: BTreeMap<KnobLevels, CostPoint>,
}

impl<'e, E: Evaluate> Cached<'e, E> {
    pub(super) fn new(inner: &'e mut E) -> Self {
        Self { inner, known: BTreeMap::new() }
    }

    /// Whether `settings` were evaluated.
    pub(super) fn knows(&self, settings: KnobLevels) -> bool {
        self.known.contains_key(&settings)
    }

    /// Number of settings evaluated.
    pub(super) fn len(&self) -> usize {
        self.known.len()
    }

    /// Every point with a finite cost, by settings.
    pub(super) fn points(&self) -> impl Iterator<Item = FrontierPoint> + '_ {
        let finite = self.known.iter().filter(|(_, cost)| cost.is_finite());
        finite.map(|(settings, cost)| FrontierPoint { settings: *settings, cost: *cost })
    }

    /// The cost of `settings`, evaluated unless known.
    pub(super) fn evaluate(&mut self, settings: KnobLevels) -> Result<CostPoint, E::Error> {
        if let Some(cost) = self.known.get(&settings) {
            return Ok(*cost);
        }
        let cost = self.inner.evaluate(settings)?;
        self.known.insert(settings, cost);
        Ok(cost)
    }
}
