//! The subdivision itself.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use bevy_frugal_gi::frontier::{Corner, Frontier, Octree, ViewDirection};
use bevy_frugal_gi::knobs::{KnobSpace, RenderSettings};
use bevy_frugal_gi::units::Watts;

use super::config::{CameraSpace, Statistics, SubdivideConfig, SubdivideError, Threshold};
use super::distance::{Distance, half_distance};
use super::lattice::{self, At, NewCorner, Node};
use super::schedule::Pace;
use crate::search::{Cached, Evaluate, Monitor, SampleCamera, Search, SearchOutcome, SearchTask, Stage, SubdivisionProgress, settle};

/// A map and how it came about.
#[derive(Clone, Debug, PartialEq)]
pub struct Subdivision {
    /// The map: complete and valid even where the run was cut short.
    pub octree: Octree,
    /// How it came about.
    pub statistics: Statistics,
}

/// Finds the frontiers of `cameras` in `space`, divided where they differ.
///
/// The distance compares what the settings of both frontiers cost at the same camera. So it is large where other settings are best, and not where the same
/// settings merely cost more watts as a whole; the source means it so (section 3.5.2).
///
/// Rules that the source leaves open:
/// - A camera that shares a parent's frontier stands for that parent: comparing it compares the cameras that were searched. So only searched cameras
///   are ever rendered, and views whose corners all share one frontier can never ask for a division.
/// - A pair with a blind camera cannot be compared and asks for nothing: a wall is no reason to divide down to the limit along it. A new camera that
///   sees shares the frontier of the first parent that has one, and is searched where no parent has.
/// - What comparisons render at a searched camera improves its frontier in the end: all that was ever evaluated there takes part.
///
/// `monitor` can stop it at any evaluation. Cameras that were not searched by then share the frontier of the nearest one that was, of the same view
/// if there is any. With a time limit every camera of a level is allowed an equal part of the evaluations that there is time for.
///
/// # Errors
/// When `cameras` has no volume, the configuration makes no sense, or an evaluation fails.
pub fn subdivide<E: Evaluate>(
    space: &KnobSpace,
    cameras: CameraSpace,
    config: &SubdivideConfig,
    evaluator: &mut E,
    monitor: &mut dyn Monitor,
) -> Result<Subdivision, SubdivideError<E::Error>> {
    config.check(cameras)?;
    let mut builder = Builder {
        search: Search::new(space, config.search.clone()),
        cameras,
        config,
        cached: Cached::new(evaluator),
        monitor,
        corners: BTreeMap::new(),
        found: Vec::new(),
        distances: HashMap::new(),
        power_threshold: Watts(f64::INFINITY),
        pace: Pace::default(),
        statistics: Statistics { complete: true, ..Statistics::default() },
        level: 0,
    };
    builder.run().map_err(SubdivideError::Evaluate)
}

/// Cameras that are searched before the others, and longer.
const SCOUTS: usize = 3;
/// Share of a time limit that goes into them.
const SCOUTS_SHARE: f64 = 0.3;

/// What is known of one view at a corner.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum View {
    /// Sees nothing.
    Blind,
    /// Still to be searched.
    Open,
    /// Has this frontier.
    Known(u32),
}

/// A frontier, and the camera at which it was found.
struct Found {
    camera: SampleCamera,
    at: At,
    frontier: Frontier,
}

struct Builder<'b, 'e, E> {
    search: Search<'b>,
    cameras: CameraSpace,
    config: &'b SubdivideConfig,
    cached: Cached<'e, E>,
    monitor: &'b mut dyn Monitor,
    corners: BTreeMap<At, [View; 6]>,
    found: Vec<Found>,
    distances: HashMap<[u32; 2], Distance>,
    power_threshold: Watts,
    pace: Pace,
    statistics: Statistics,
    level: u8,
}

/// A view at a corner that is to be searched, and settings to start from.
struct Wanted {
    at: At,
    view: ViewDirection,
    inherit: Vec<RenderSettings>,
}

impl<E: Evaluate> Builder<'_, '_, E> {
    fn run(&mut self) -> Result<Subdivision, E::Error> {
        let root = Node { at: [0; 3], size: 1 << self.config.levels };
        self.search_root(root)?;
        self.power_threshold = self.resolved_threshold();
        let mut nodes = vec![(root, 0_u32)];
        let mut last = 0..1;
        while self.level < self.config.levels {
            let divided = self.nodes_that_differ(&nodes[last.clone()])?;
            if divided.is_empty() || !self.go_on() {
                break;
            }
            self.level += 1;
            let first = nodes.len();
            for index in &divided {
                let index = last.start + index;
                nodes[index].1 = u32::try_from(nodes.len()).unwrap_or(u32::MAX);
                let children = nodes[index].0.children();
                nodes.extend(children.map(|child| (child, 0)));
            }
            let parents: Vec<Node> = divided.iter().map(|index| nodes[last.start + index].0).collect();
            self.add_corners(&parents)?;
            last = first..nodes.len();
        }
        self.close_open_views();
        self.settle_all()?;
        Ok(self.finish(&nodes))
    }

    fn go_on(&mut self) -> bool {
        let go_on = self.monitor.keep_going();
        self.statistics.complete &= go_on;
        go_on
    }

    fn camera(&self, at: At, view: ViewDirection) -> SampleCamera {
        SampleCamera { position: lattice::position(self.cameras, self.config.levels, at), view }
    }

    fn view(&self, at: At, view: ViewDirection) -> View {
        self.corners.get(&at).map_or(View::Blind, |views| views[view.index()])
    }

    fn set(&mut self, at: At, view: ViewDirection, state: View) {
        if let Some(views) = self.corners.get_mut(&at) {
            views[view.index()] = state;
        }
    }

    fn report(&mut self, stage: Stage, done: usize, total: usize) {
        let evaluations = self.cached.counts().evaluations;
        self.monitor.subdivided(&SubdivisionProgress { stage, level: self.level, done, total, evaluations });
    }

    /// Adds a corner whose views are open or blind.
    fn add_corner(&mut self, at: At) -> Result<(), E::Error> {
        let mut views = [View::Blind; 6];
        for view in ViewDirection::ALL {
            if self.cached.sees(self.camera(at, view))? {
                views[view.index()] = View::Open;
            }
        }
        self.corners.insert(at, views);
        Ok(())
    }

    fn search_root(&mut self, root: Node) -> Result<(), E::Error> {
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
    fn search_all(&mut self, wanted: Vec<Wanted>) -> Result<(), E::Error> {
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
    fn nearest(&self, at: At, view: ViewDirection) -> Option<u32> {
        let nearest = self
            .found
            .iter()
            .enumerate()
            .min_by_key(|(index, found)| (found.camera.view != view, lattice::squared_distance(found.at, at), *index));
        nearest.map(|(index, _)| index as u32)
    }

    fn resolved_threshold(&self) -> Watts {
        let share = match self.config.power_threshold {
            Threshold::Absolute(watts) => return watts,
            Threshold::Relative(share) => share,
        };
        let ranges = self.found.iter().filter_map(|found| {
            let points = found.frontier.points();
            Some((points.last()?.cost.power - points.first()?.cost.power).0)
        });
        let mean = ranges.sum::<f64>() / self.found.len() as f64;
        // Also where there is no frontier, and the mean is not a number.
        if mean > 0.0 { Watts(mean * share) } else { Watts(f64::INFINITY) }
    }

    /// Positions of those of `nodes` that have a pair of adjacent corners too far apart in some view.
    fn nodes_that_differ(&mut self, nodes: &[(Node, u32)]) -> Result<Vec<usize>, E::Error> {
        let started = self.monitor.seconds();
        let mut differing = Vec::new();
        for (index, (node, _)) in nodes.iter().enumerate() {
            self.report(Stage::Comparing, index, nodes.len());
            if self.node_differs(*node)? {
                differing.push(index);
            }
        }
        self.report(Stage::Comparing, nodes.len(), nodes.len());
        self.statistics.comparing_seconds += self.monitor.seconds() - started;
        Ok(differing)
    }

    fn node_differs(&mut self, node: Node) -> Result<bool, E::Error> {
        for [low, high] in node.edges() {
            for view in ViewDirection::ALL {
                // All pairs are compared only until one differs: what the others say is asked when their new corners are made.
                if self.differ(self.view(low, view), self.view(high, view))? {
                    return Ok(true);
                }
            }
        }
        Ok(false)
    }

    /// Whether two views' frontiers are further apart than a threshold. False where they cannot be compared.
    fn differ(&mut self, one: View, other: View) -> Result<bool, E::Error> {
        let (View::Known(one), View::Known(other)) = (one, other) else { return Ok(false) };
        if one == other {
            return Ok(false);
        }
        let pair = [one.min(other), one.max(other)];
        let distance = match self.distances.get(&pair) {
            Some(distance) => *distance,
            None => {
                let Some(distance) = self.measure_distance(pair)? else { return Ok(false) };
                self.distances.insert(pair, distance);
                self.statistics.comparisons += 1;
                distance
            }
        };
        Ok(distance.power > self.power_threshold || distance.error > self.config.error_threshold)
    }

    /// Both halves (equations 3.4 and 3.5). `None` when the monitor says stop, or nothing finite can be compared.
    fn measure_distance(&mut self, [one, other]: [u32; 2]) -> Result<Option<Distance>, E::Error> {
        let mut sum = Distance::default();
        for (from, to) in [(one, other), (other, one)] {
            let mut projected = Vec::new();
            for settings in settings(&self.found[from as usize].frontier) {
                let camera = self.found[to as usize].camera;
                if self.cached.known(camera, settings).is_none() && !self.go_on() {
                    return Ok(None);
                }
                projected.push(self.cached.evaluate(camera, settings)?);
            }
            let Some(half) = half_distance(&projected, &self.found[to as usize].frontier) else { return Ok(None) };
            sum = sum + half;
        }
        Ok(Some(sum))
    }

    /// Makes the corners that the division of `parents` needs, kind by kind, because each kind's parents are of the kind before.
    fn add_corners(&mut self, parents: &[Node]) -> Result<(), E::Error> {
        // Corners that neighbours share have the same parents in both.
        let new: BTreeMap<(usize, At), NewCorner> =
            parents.iter().flat_map(|node| node.new_corners()).map(|corner| ((corner.parents.len(), corner.at), corner)).collect();
        for kind in 1..=3 {
            let corners: Vec<&NewCorner> = new.range((kind, [0; 3])..(kind + 1, [0; 3])).map(|(_, corner)| corner).collect();
            let started = self.monitor.seconds();
            let mut wanted = Vec::new();
            for (done, corner) in corners.iter().enumerate() {
                self.report(Stage::Comparing, done, corners.len());
                self.add_corner(corner.at)?;
                for view in ViewDirection::ALL {
                    wanted.extend(self.inherit(corner, view)?);
                }
            }
            self.statistics.comparing_seconds += self.monitor.seconds() - started;
            self.search_all(wanted)?;
        }
        Ok(())
    }

    /// Gives a new view its parents' frontier where they agree; says what to search where they do not.
    fn inherit(&mut self, corner: &NewCorner, view: ViewDirection) -> Result<Option<Wanted>, E::Error> {
        if self.view(corner.at, view) != View::Open {
            return Ok(None);
        }
        let (mut differing, mut agreeing) = (Vec::new(), Vec::new());
        for [low, high] in &corner.parents {
            let pair = [self.view(*low, view), self.view(*high, view)];
            if self.differ(pair[0], pair[1])? {
                differing.extend(pair);
            } else {
                agreeing.extend(pair);
            }
        }
        let known = |view: &View| if let View::Known(index) = view { Some(*index) } else { None };
        if differing.is_empty() {
            if let Some(index) = agreeing.iter().find_map(known) {
                self.set(corner.at, view, View::Known(index));
                self.statistics.inherited += 1;
                return Ok(None);
            }
            // Parents that wait for a search in vain leave this one waiting, too.
            if agreeing.contains(&View::Open) {
                return Ok(None);
            }
        }
        let mut seen = BTreeSet::new();
        let parents = differing.iter().chain(&agreeing).filter_map(known).filter(|index| seen.insert(*index));
        let inherit = parents.flat_map(|index| settings(&self.found[index as usize].frontier)).collect();
        Ok(Some(Wanted { at: corner.at, view, inherit }))
    }

    /// Gives every view that was not searched in time the nearest searched one's frontier.
    fn close_open_views(&mut self) {
        let open: Vec<(At, ViewDirection)> = self
            .corners
            .iter()
            .flat_map(|(at, views)| ViewDirection::ALL.into_iter().filter(|view| views[view.index()] == View::Open).map(|view| (*at, view)))
            .collect();
        for (at, view) in open {
            self.statistics.unfinished += 1;
            self.statistics.complete = false;
            let state = self.nearest(at, view).map_or(View::Blind, View::Known);
            self.set(at, view, state);
        }
    }

    /// Takes what comparisons rendered into the frontiers.
    fn settle_all(&mut self) -> Result<(), E::Error> {
        let started = self.monitor.seconds();
        for index in 0..self.found.len() {
            self.report(Stage::Settling, index, self.found.len());
            let camera = self.found[index].camera;
            self.found[index].frontier = settle(&mut self.cached, camera, self.config.search.refine_margin, self.monitor)?;
        }
        self.report(Stage::Settling, self.found.len(), self.found.len());
        self.statistics.settling_seconds += self.monitor.seconds() - started;
        Ok(())
    }

    fn finish(&mut self, nodes: &[(Node, u32)]) -> Subdivision {
        // The level that was reached, not the one allowed: a map does not depend on a limit that it did not meet.
        let finer = self.config.levels - self.level;
        let index = |view: &View| if let View::Known(index) = view { *index } else { Corner::UNKNOWN };
        let corners: Vec<Corner> = self
            .corners
            .iter()
            .map(|(at, views)| Corner { at: at.map(|steps| steps >> finer), frontiers: views.each_ref().map(index) })
            .collect();
        let counts = self.cached.counts();
        let blind = corners.iter().flat_map(|corner| corner.frontiers).filter(|index| *index == Corner::UNKNOWN).count();
        self.statistics = Statistics {
            blind,
            evaluations: counts.evaluations,
            cache_hits: counts.hits,
            refinements: counts.refinements,
            nodes: nodes.len(),
            corners: corners.len(),
            levels: self.level,
            ..self.statistics
        };
        let frontiers = std::mem::take(&mut self.found).into_iter().map(|found| found.frontier).collect();
        let octree = Octree { levels: self.level, nodes: nodes.iter().map(|(_, children)| *children).collect(), corners, frontiers };
        Subdivision { octree, statistics: self.statistics }
    }
}

fn settings(frontier: &Frontier) -> Vec<RenderSettings> {
    frontier.points().iter().map(|point| point.settings).collect()
}
