//! The subdivision: its state, and the order of its steps. `searching` and `dividing` are the steps.

use std::collections::{BTreeMap, HashMap};

use bevy_frugal_gi::frontier::{Corner, Frontier, Octree, ViewDirection};
use bevy_frugal_gi::knobs::{KnobSpace, RenderSettings};
use bevy_frugal_gi::units::Watts;

use super::config::{CameraSpace, Statistics, SubdivideConfig, SubdivideError, Threshold};
use super::distance::Distance;
use super::lattice::{self, At, Node};
use super::schedule::Pace;
use crate::search::{Cached, Evaluate, Monitor, SampleCamera, Search, Stage, SubdivisionProgress, settle};

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

/// What is known of one view at a corner.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum View {
    /// Sees nothing.
    Blind,
    /// Still to be searched.
    Open,
    /// Has this frontier.
    Known(u32),
}

/// A frontier, and the camera at which it was found.
pub(super) struct Found {
    pub(super) camera: SampleCamera,
    pub(super) at: At,
    pub(super) frontier: Frontier,
}

pub(super) struct Builder<'b, 'e, E> {
    pub(super) search: Search<'b>,
    pub(super) cameras: CameraSpace,
    pub(super) config: &'b SubdivideConfig,
    pub(super) cached: Cached<'e, E>,
    pub(super) monitor: &'b mut dyn Monitor,
    pub(super) corners: BTreeMap<At, [View; 6]>,
    pub(super) found: Vec<Found>,
    pub(super) distances: HashMap<[u32; 2], Distance>,
    pub(super) power_threshold: Watts,
    pub(super) pace: Pace,
    pub(super) statistics: Statistics,
    pub(super) level: u8,
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

    pub(super) fn go_on(&mut self) -> bool {
        let go_on = self.monitor.keep_going();
        self.statistics.complete &= go_on;
        go_on
    }

    pub(super) fn camera(&self, at: At, view: ViewDirection) -> SampleCamera {
        SampleCamera { position: lattice::position(self.cameras, self.config.levels, at), view }
    }

    pub(super) fn view(&self, at: At, view: ViewDirection) -> View {
        self.corners.get(&at).map_or(View::Blind, |views| views[view.index()])
    }

    pub(super) fn set(&mut self, at: At, view: ViewDirection, state: View) {
        if let Some(views) = self.corners.get_mut(&at) {
            views[view.index()] = state;
        }
    }

    pub(super) fn report(&mut self, stage: Stage, done: usize, total: usize) {
        let evaluations = self.cached.counts().evaluations;
        self.monitor.subdivided(&SubdivisionProgress { stage, level: self.level, done, total, evaluations });
    }

    /// Adds a corner whose views are open or blind.
    pub(super) fn add_corner(&mut self, at: At) -> Result<(), E::Error> {
        let mut views = [View::Blind; 6];
        for view in ViewDirection::ALL {
            if self.cached.sees(self.camera(at, view))? {
                views[view.index()] = View::Open;
            }
        }
        self.corners.insert(at, views);
        Ok(())
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

pub(super) fn settings(frontier: &Frontier) -> Vec<RenderSettings> {
    frontier.points().iter().map(|point| point.settings).collect()
}
