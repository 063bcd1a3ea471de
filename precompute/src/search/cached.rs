//! Remembers every evaluation, so that none is made twice, by a search or by a comparison of frontiers.

use std::collections::{BTreeMap, HashMap};

use bevy_frugal_gi::frontier::{CostPoint, FrontierPoint};
use bevy_frugal_gi::knobs::RenderSettings;

use super::{CameraKey, Evaluate, SampleCamera};

/// How much was asked, and how much of it was news.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Evaluations that the inner evaluator made.
    pub evaluations: usize,
    /// Evaluations that were known already.
    pub hits: usize,
    /// Refinements that the inner evaluator was asked for.
    pub refinements: usize,
}

#[derive(Clone, Copy, Debug)]
struct Known {
    cost: CostPoint,
    refined: bool,
}

/// An evaluator with a memory. Settings must be [canonical](bevy_frugal_gi::knobs::KnobSpace::canonical), or one picture has several names.
#[derive(Debug)]
pub struct Cached<'e, E> {
    inner: &'e mut E,
    // Settings sorted, so that whatever walks over them is deterministic; cameras are never walked over.
    known: HashMap<CameraKey, BTreeMap<RenderSettings, Known>>,
    counts: Counts,
}

impl<'e, E: Evaluate> Cached<'e, E> {
    /// Remembers what `inner` answers.
    pub fn new(inner: &'e mut E) -> Self {
        Self { inner, known: HashMap::new(), counts: Counts::default() }
    }

    /// How much was asked so far.
    pub fn counts(&self) -> Counts {
        self.counts
    }

    /// What `settings` cost at `camera`, where it is known.
    pub fn known(&self, camera: SampleCamera, settings: RenderSettings) -> Option<CostPoint> {
        Some(self.known.get(&camera.key())?.get(&settings)?.cost)
    }

    /// How many settings are known at `camera`.
    pub fn known_count(&self, camera: SampleCamera) -> usize {
        self.known.get(&camera.key()).map_or(0, BTreeMap::len)
    }

    /// Everything known at `camera`, by settings.
    pub fn points(&self, camera: SampleCamera) -> impl Iterator<Item = FrontierPoint> + '_ {
        let all = self.known.get(&camera.key()).into_iter().flatten();
        all.map(|(settings, known)| FrontierPoint { settings: *settings, cost: known.cost })
    }
}

impl<E: Evaluate> Evaluate for Cached<'_, E> {
    type Error = E::Error;

    fn sees(&mut self, camera: SampleCamera) -> Result<bool, E::Error> {
        self.inner.sees(camera)
    }

    fn evaluate(&mut self, camera: SampleCamera, settings: RenderSettings) -> Result<CostPoint, E::Error> {
        if let Some(cost) = self.known(camera, settings) {
            self.counts.hits += 1;
            return Ok(cost);
        }
        let cost = self.inner.evaluate(camera, settings)?;
        self.counts.evaluations += 1;
        self.known.entry(camera.key()).or_default().insert(settings, Known { cost, refined: false });
        Ok(cost)
    }

    /// Asks the inner evaluator once; from then on its answer is what the settings cost.
    fn refine(&mut self, camera: SampleCamera, settings: RenderSettings, so_far: CostPoint) -> Result<CostPoint, E::Error> {
        let known = self.known.entry(camera.key()).or_default().entry(settings).or_insert(Known { cost: so_far, refined: false });
        if !known.refined {
            known.cost = self.inner.refine(camera, settings, known.cost)?;
            known.refined = true;
            self.counts.refinements += 1;
        }
        Ok(known.cost)
    }

    fn allowance(&mut self, camera: SampleCamera, proposed: usize) -> Result<usize, E::Error> {
        self.inner.allowance(camera, proposed)
    }
}
