//! What a long search asks of who waits for it: go on, how much time is left, and a place to report to.

use std::time::{Duration, Instant};

/// How far the search at one camera is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SearchProgress {
    /// Evaluations at this camera so far, without cached ones.
    pub evaluations: usize,
    /// Most that it will take.
    pub limit: usize,
}

/// What a subdivision is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Stage {
    /// Searching the cameras of a level.
    Searching,
    /// Comparing the frontiers of adjacent cameras.
    Comparing,
    /// Building the final frontiers from everything evaluated.
    Settling,
}

/// How far a subdivision is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SubdivisionProgress {
    /// What it does now.
    pub stage: Stage,
    /// Depth of the nodes whose corners are in work: 0 is the root.
    pub level: u8,
    /// How much of this stage at this level is done: cameras or nodes.
    pub done: usize,
    /// How much there is, as far as it is known.
    pub total: usize,
    /// Evaluations so far, of all cameras.
    pub evaluations: usize,
}

/// Watches over a long search.
pub trait Monitor {
    /// Asked before every evaluation; once false, it must stay so. The search then ends with the best so far.
    fn keep_going(&mut self) -> bool;

    /// Seconds since any fixed moment.
    fn seconds(&mut self) -> f64;

    /// Seconds until [`keep_going`](Self::keep_going) will turn false; `None` without a limit.
    fn remaining_seconds(&mut self) -> Option<f64> {
        None
    }

    /// Told after every evaluation of a search.
    fn searched(&mut self, progress: &SearchProgress) {
        let _ = progress;
    }

    /// Told whenever a subdivision is a step further.
    fn subdivided(&mut self, progress: &SubdivisionProgress) {
        let _ = progress;
    }
}

/// Lets a search run to its end, in silence and without a clock.
#[derive(Clone, Copy, Debug, Default)]
pub struct Unwatched;

impl Monitor for Unwatched {
    fn keep_going(&mut self) -> bool {
        true
    }

    fn seconds(&mut self) -> f64 {
        0.0
    }
}

/// The real clock, with a time limit and an interrupt.
#[derive(Debug)]
pub struct Watch<Interrupted, Report> {
    started: Instant,
    limit: Option<Duration>,
    interrupted: Interrupted,
    report: Report,
}

impl<Interrupted: FnMut() -> bool, Report: FnMut(&SubdivisionProgress)> Watch<Interrupted, Report> {
    /// Starts now; ends after `limit`, or as soon as `interrupted` says true; tells `report` about subdivision.
    pub fn start(limit: Option<Duration>, interrupted: Interrupted, report: Report) -> Self {
        Self { started: Instant::now(), limit, interrupted, report }
    }
}

impl<Interrupted: FnMut() -> bool, Report: FnMut(&SubdivisionProgress)> Monitor for Watch<Interrupted, Report> {
    fn keep_going(&mut self) -> bool {
        !(self.interrupted)() && self.limit.is_none_or(|limit| self.started.elapsed() < limit)
    }

    fn seconds(&mut self) -> f64 {
        self.started.elapsed().as_secs_f64()
    }

    fn remaining_seconds(&mut self) -> Option<f64> {
        self.limit.map(|limit| limit.saturating_sub(self.started.elapsed()).as_secs_f64())
    }

    fn subdivided(&mut self, progress: &SubdivisionProgress) {
        (self.report)(progress);
    }
}
