//! Searches sample cameras: in which order, for how long, and from which settings.

use bevy_frugal_gi::frontier::{Frontier, ViewDirection};
use bevy_frugal_gi::knobs::RenderSettings;

use super::builder::{Builder, Found, View, settings};
use super::lattice::{self, At, Node};
use crate::search::{Evaluate, SearchOutcome, SearchTask, Stage};

/// Cameras that are searched before the others, and longer.
const SCOUTS: usize = 3;
/// Share of a time limit that goes into them.
const SCOUTS_SHARE: f64 = 0.3;

/// A view at a corner that is to be searched, and settings to start from.
pub(super) struct Wanted {
    pub(super) at: At,
    pub(super) view: ViewDirection,
    pub(super) inherit: Vec<RenderSettings>,
}

impl<E: Evaluate> Builder<'_, '_, E> {
    pub(super) fn search_root(&mut self, root: Node) -> Result<(), E::Error> {
        for at in root.corners() {
            self.add_corner(at)?;
        }
        let mut wanted = Vec::new();
        for at in root.corners() {
            for view in ViewDirection::ALL.into_iter().filter(|view| self.view(at, *view) == View::Open) {
                wanted.push(Wanted { at, view, inherit: Vec::new() });
            }
        }
        let wanted = self.scout(wanted)?;
        self.search_all(wanted)
    }

    /// Under a time limit, searches a few cameras longer than the others can be, and gives back those that are left: what the few find is what all
    /// the others start from. They lie far apart in the order of corners and views, for one may stand before a wall.
    fn scout(&mut self, mut wanted: Vec<Wanted>) -> Result<Vec<Wanted>, E::Error> {
        let Some(limit) = self.monitor.remaining_seconds() else { return Ok(wanted) };
        let total = wanted.len();
        if total < 4 * SCOUTS {
            return Ok(wanted);
        }
        // From the back, so that the places of the others stay.
        for place in (0..SCOUTS).rev().map(|scout| scout * total / SCOUTS) {
            if !self.go_on() {
                break;
            }
            let Wanted { at, view, inherit } = wanted.remove(place);
            let started = self.monitor.seconds();
            self.search_one(at, view, &inherit, total)?;
            let View::Known(index) = self.view(at, view) else { continue };
            // How many evaluations that was says how many more its share of the time holds.
            let left = SCOUTS_SHARE / SCOUTS as f64 * limit - (self.monitor.seconds() - started);
            let more = self.pace.within(left);
            if more < 2 {
                continue;
            }
            let more = self.cached.allowance(self.camera(at, view), more)?;
            let inherit = settings(&self.found[index as usize].frontier);
            let outcome = self.timed_search(at, view, &inherit, Some(more))?;
            self.found[index as usize].frontier = outcome.frontier;
        }
        Ok(wanted)
    }

    /// Searches the wanted cameras, until the monitor says stop.
    pub(super) fn search_all(&mut self, wanted: Vec<Wanted>) -> Result<(), E::Error> {
        let total = wanted.len();
        for (done, Wanted { at, view, mut inherit }) in wanted.into_iter().enumerate() {
            if !self.go_on() {
                return Ok(());
            }
            self.report(Stage::Searching, done, total);
            if inherit.is_empty() {
                inherit = self.neighbourly(at, view);
            }
            self.search_one(at, view, &inherit, total - done)?;
        }
        self.report(Stage::Searching, total, total);
        Ok(())
    }

    fn search_one(&mut self, at: At, view: ViewDirection, inherit: &[RenderSettings], cameras_left: usize) -> Result<(), E::Error> {
        let camera = self.camera(at, view);
        let max_evaluations = match self.monitor.remaining_seconds() {
            Some(remaining) => {
                let last = self.level == self.config.levels;
                let proposed = self.pace.allowance(remaining, cameras_left, self.config.least_evaluations, last);
                Some(self.cached.allowance(camera, proposed)?)
            }
            None => None,
        };
        let outcome = self.timed_search(at, view, inherit, max_evaluations)?;
        if !outcome.frontier.is_empty() {
            let index = self.found.len() as u32;
            self.found.push(Found { camera, at, frontier: outcome.frontier });
            self.set(at, view, View::Known(index));
            self.statistics.searched += 1;
        } else if outcome.complete {
            // Nothing finite at all: as good as blind.
            self.set(at, view, View::Blind);
        }
        Ok(())
    }

    /// A search at one camera, counted.
    fn timed_search(
        &mut self,
        at: At,
        view: ViewDirection,
        inherit: &[RenderSettings],
        max_evaluations: Option<usize>,
    ) -> Result<SearchOutcome, E::Error> {
        let started = self.monitor.seconds();
        let task = SearchTask { camera: self.camera(at, view), at: lattice::finest(self.config.levels, at), inherit, max_evaluations };
        let outcome = self.search.run(&mut self.cached, task, self.monitor)?;
        let seconds = self.monitor.seconds() - started;
        self.pace.add(outcome.evaluations, seconds);
        self.statistics.searching_seconds += seconds;
        self.statistics.complete &= outcome.complete;
        Ok(outcome)
    }

    /// Settings to start from where there is no parent, the cheapest first: those of the nearest frontier, and of the one with the most points. A
    /// frontier that was itself found with little passes on less than it was given; the richest keeps the chain from thinning out.
    fn neighbourly(&self, at: At, view: ViewDirection) -> Vec<RenderSettings> {
        let nearest = self.nearest(at, view).map(|index| &self.found[index as usize].frontier);
        // The first of the richest: it had the longest search.
        let richest = self.found.iter().map(|found| &found.frontier).rev().max_by_key(|frontier| frontier.points().len());
        let mut shares: Vec<(f64, RenderSettings)> = Vec::new();
        for points in [nearest, richest].into_iter().flatten().map(Frontier::points) {
            let most = points.last().map_or(1.0, |point| point.cost.power.0);
            shares.extend(points.iter().map(|point| (point.cost.power.0 / most, point.settings)));
        }
        shares.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        shares.into_iter().map(|(_, settings)| settings).collect()
    }

    /// The nearest searched camera of the same view, or else of another; of equally near ones that which was searched first.
    pub(super) fn nearest(&self, at: At, view: ViewDirection) -> Option<u32> {
        let nearest = self
            .found
            .iter()
            .enumerate()
            .min_by_key(|(index, found)| (found.camera.view != view, lattice::squared_distance(found.at, at), *index));
        nearest.map(|(index, _)| index as u32)
    }
}
