//! Look-ups in a table, with a count of renderings.

use std::convert::Infallible;

use bevy_frugal_gi::frontier::CostPoint;
use bevy_frugal_gi::knobs::KnobLevels;

use super::Recorded;
use super::run::Goal;
use crate::pool::SearchedCamera;
use crate::search::Evaluate;
use crate::table::CostTable;

/// Cost of settings that the table lacks: never selected.
const MISSING: CostPoint = CostPoint::new(f64::INFINITY, f64::INFINITY);

/// A camera of which only requested settings are known.
#[derive(Debug)]
pub(super) struct Lookup<'a> {
    recorded: &'a Recorded,
    goals: &'a [Goal],
    /// One row: the requested settings, in order. Settings that the table lacks are in it, without
    /// a finite cost.
    pub known: CostTable,
    /// Renderings until each goal was reached.
    pub reached: Vec<Option<usize>>,
    renderings: usize,
}

impl<'a> Lookup<'a> {
    pub(super) fn new(recorded: &'a Recorded, goals: &'a [Goal]) -> Self {
        Self {
            recorded,
            goals,
            known: CostTable::new(1),
            reached: vec![None; goals.len()],
            renderings: 0,
        }
    }

    /// The cost of `settings`. The first request counts as a rendering, unless the table lacks
    /// them.
    pub(super) fn ask(&mut self, settings: KnobLevels) -> CostPoint {
        let settings = self.recorded.space.canonical(settings);
        if self.is_known(settings) {
            return self.known.get(0, settings).unwrap_or(MISSING);
        }
        let cost = self.recorded.costs.get(&settings).copied();
        self.known.set(0, settings, cost.unwrap_or(MISSING));
        let Some(cost) = cost else { return MISSING };
        self.renderings += 1;
        for (goal, reached) in self.goals.iter().zip(&mut self.reached) {
            if cost.error <= goal.error && cost.power.0 <= goal.enough_w {
                reached.get_or_insert(self.renderings);
            }
        }
        cost
    }

    /// Whether `settings` were requested.
    pub(super) fn is_known(&self, settings: KnobLevels) -> bool {
        self.known.column(settings).is_some()
    }

    /// Number of requested combinations that the table lacks.
    pub(super) fn missing(&self) -> usize {
        self.known.settings().len() - self.renderings
    }
}

impl SearchedCamera for Lookup<'_> {
    type Error = Infallible;

    fn ask_all(&mut self, settings: Vec<KnobLevels>) -> Result<(), Infallible> {
        for settings in settings {
            if self.is_done() {
                break;
            }
            self.ask(settings);
        }
        Ok(())
    }

    fn known(&self) -> &CostTable {
        &self.known
    }

    /// Whether all goals are reached.
    fn is_done(&self) -> bool {
        self.reached.iter().all(Option::is_some)
    }
}

/// All goals are reached: ends a search.
#[derive(Clone, Copy, Debug)]
pub(super) struct Done;

impl Evaluate for Lookup<'_> {
    type Error = Done;

    fn evaluate(&mut self, settings: KnobLevels) -> Result<CostPoint, Done> {
        let cost = self.ask(settings);
        if self.is_done() { Err(Done) } else { Ok(cost) }
    }
}
