//! Subdivision of fields whose answer is known.
//!
//! The distance compares what the settings of two frontiers cost at the same camera. So it does not see a view that costs more watts as a whole, only
//! one in which other settings are best: each field here says which of five modes wastes nothing at a camera; the others waste half a watt. That makes
//! frontiers of different modes 0.5 W apart in each direction, 1 W together.

use std::cell::Cell;
use std::collections::BTreeSet;
use std::convert::Infallible;
use std::rc::Rc;

use bevy::math::Vec3;
use bevy_frugal_gi::frontier::{Corner, CostPoint, Octree, ViewDirection};
use bevy_frugal_gi::knobs::{Knob, KnobSpace, RenderSettings};
use bevy_frugal_gi::units::Watts;

use super::*;
use crate::search::{Evaluate, Monitor, SampleCamera, SearchConfig, Unwatched};

const SPACE: CameraSpace = CameraSpace { min: Vec3::ZERO, max: Vec3::ONE };

/// Costs by camera and settings, a clock that each evaluation moves, and what was asked.
struct Field<C, S> {
    cost: C,
    sees: S,
    clock: Rc<Cell<f64>>,
    asked: Vec<SampleCamera>,
}

impl<C: Fn(SampleCamera, RenderSettings) -> CostPoint, S: Fn(SampleCamera) -> bool> Evaluate for Field<C, S> {
    type Error = Infallible;

    fn sees(&mut self, camera: SampleCamera) -> Result<bool, Infallible> {
        Ok((self.sees)(camera))
    }

    fn evaluate(&mut self, camera: SampleCamera, settings: RenderSettings) -> Result<CostPoint, Infallible> {
        self.clock.set(self.clock.get() + 1.0);
        self.asked.push(camera);
        Ok((self.cost)(camera, settings))
    }
}

fn field<C: Fn(SampleCamera, RenderSettings) -> CostPoint>(cost: C) -> Field<C, fn(SampleCamera) -> bool> {
    Field { cost, sees: |_| true, clock: Rc::default(), asked: Vec::new() }
}

fn knobs() -> KnobSpace {
    KnobSpace::new(vec![Knob::new("quality", [0.0, 1.0, 2.0]), Knob::new("mode", [0.0, 1.0, 2.0, 3.0, 4.0])]).expect("a valid space")
}

/// Settings that [`knobs`] has: all are tried at every camera that is searched.
const SETTINGS: usize = 15;

fn config(levels: u8) -> SubdivideConfig {
    SubdivideConfig { levels, ..SubdivideConfig::default() }
}

fn run<E: Evaluate<Error = Infallible>>(evaluator: &mut E, config: &SubdivideConfig) -> Subdivision {
    let subdivision = subdivide(&knobs(), SPACE, config, evaluator, &mut Unwatched).expect("a map");
    assert_valid(&subdivision.octree);
    subdivision
}

/// 3 to 5 W by quality, and half a watt more in any mode but the best.
fn watts(best: usize, settings: RenderSettings) -> CostPoint {
    let quality = settings.level(0) as f64;
    CostPoint::new(3.0 + quality + if settings.level(1) == best { 0.0 } else { 0.5 }, (2.0 - quality) / 20.0)
}

/// A mode for each quarter along Z.
fn by_height(camera: SampleCamera) -> usize {
    (camera.position.z * 4.0) as usize
}

/// Leaves with depth and lower corner, in lattice steps.
fn leaves(octree: &Octree) -> Vec<(u8, [u16; 3])> {
    let mut leaves = Vec::new();
    let mut open = vec![(0_usize, 0_u8, [0_u16; 3])];
    while let Some((node, depth, at)) = open.pop() {
        let children = octree.nodes[node] as usize;
        if children == 0 {
            leaves.push((depth, at));
            continue;
        }
        let half = 1 << (octree.levels - depth - 1);
        for child in 0..8_usize {
            let at = std::array::from_fn(|axis| at[axis] + half * (child >> axis & 1) as u16);
            open.push((children + child, depth + 1, at));
        }
    }
    leaves.sort_unstable();
    leaves
}

/// Every node is reached once, every leaf's corners are there and no others, in order, and every index exists.
fn assert_valid(octree: &Octree) {
    let leaves = leaves(octree);
    assert_eq!(octree.nodes.len(), (8 * leaves.len() - 1) / 7, "each node in one place");
    let corners: BTreeSet<[u16; 3]> = leaves
        .iter()
        .flat_map(|(depth, at)| {
            let size = 1 << (octree.levels - depth);
            (0..8_usize).map(move |corner| std::array::from_fn(|axis| at[axis] + size * (corner >> axis & 1) as u16))
        })
        .collect();
    let stored: Vec<[u16; 3]> = octree.corners.iter().map(|corner| corner.at).collect();
    assert_eq!(stored, corners.into_iter().collect::<Vec<_>>());
    let indices = octree.corners.iter().flat_map(|corner| corner.frontiers);
    assert!(indices.into_iter().all(|index| index == Corner::UNKNOWN || !octree.frontiers[index as usize].is_empty()));
}

fn corner(octree: &Octree, at: [u16; 3]) -> &Corner {
    octree.corners.iter().find(|corner| corner.at == at).expect("a corner there")
}

#[test]
fn a_uniform_field_is_not_divided() {
    let mut field = field(|_, settings| watts(0, settings));
    let Subdivision { octree, statistics } = run(&mut field, &config(4));
    assert_eq!((octree.levels, octree.nodes.as_slice()), (0, [0].as_slice()));
    assert_eq!((statistics.searched, statistics.inherited, statistics.blind, statistics.unfinished), (48, 0, 0, 0));
    // Comparisons find everything known. Each of 12 edges is compared in 6 views.
    assert_eq!((statistics.evaluations, statistics.comparisons, field.asked.len()), (48 * SETTINGS, 72, 48 * SETTINGS));
    assert!(statistics.complete);
}

#[test]
fn a_step_in_one_view_divides_exactly_what_straddles_it() {
    // Just above 0.5, so that the corners at 0.5 are on the lower side.
    let step =
        |camera: SampleCamera, settings| watts(usize::from(camera.view == ViewDirection::NegativeY && camera.position.x > 0.51), settings);
    let mut field = field(step);
    let Subdivision { octree, statistics } = run(&mut field, &config(3));
    assert_eq!(octree.levels, 3);
    // Root, then x from 0.5 to 1 (four children), then 0.5 to 0.75 (four of each): at the limit 64 leaves from 0.5 to 0.75.
    let expected = |depth: u8, low: u16, high: u16, size: u16| {
        let steps = move |from: u16, to: u16| (from..to).step_by(usize::from(size));
        steps(low, high).flat_map(move |x| steps(0, 8).flat_map(move |y| steps(0, 8).map(move |z| (depth, [x, y, z])))).collect::<Vec<_>>()
    };
    let mut all = [expected(1, 0, 4, 4), expected(2, 6, 8, 2), expected(3, 4, 6, 1)].concat();
    all.sort_unstable();
    assert_eq!(leaves(&octree), all);
    // Only the stepping view was ever searched beyond the root, and never at two corners that its parents agree on.
    let beyond = field.asked.iter().filter(|camera| camera.position.to_array().iter().any(|x| *x != 0.0 && *x != 1.0));
    assert!(beyond.clone().count() > 0 && beyond.clone().all(|camera| camera.view == ViewDirection::NegativeY));
    let planes: BTreeSet<u32> = beyond.map(|camera| (camera.position.x * 8.0) as u32).collect();
    assert_eq!(planes.into_iter().collect::<Vec<_>>(), [4, 5, 6], "no search where parents agree");
    // Other views share a root corner's frontier: eight for each.
    for view in ViewDirection::ALL.into_iter().filter(|view| *view != ViewDirection::NegativeY) {
        let used: BTreeSet<u32> = octree.corners.iter().map(|corner| corner.frontiers[view.index()]).collect();
        assert!(used.len() <= 8);
    }
    let mode = |at| {
        let index = corner(&octree, at).frontiers[ViewDirection::NegativeY.index()];
        octree.frontiers[index as usize].points()[0].settings.level(1)
    };
    assert_eq!([[0, 0, 0], [4, 4, 4], [5, 3, 7], [8, 8, 8]].map(mode), [0, 0, 1, 1]);
    assert_eq!(statistics.searched + statistics.inherited, octree.corners.len() * 6);
}

#[test]
fn inherited_views_share_a_parent_s_index() {
    // Only along X, and only at y = z = 0: the edge there differs, its opposite ones do not.
    let bump = |camera: SampleCamera, settings| {
        watts(usize::from(camera.view == ViewDirection::PositiveZ && camera.position == Vec3::X), settings)
    };
    let mut field = field(bump);
    let octree = run(&mut field, &config(1)).octree;
    let index = |at: [u16; 3]| corner(&octree, at).frontiers[ViewDirection::PositiveZ.index()];
    assert_eq!(index([1, 2, 0]), index([0, 2, 0]), "the middle of an edge takes the frontier of its lower end");
    assert_eq!(index([1, 0, 2]), index([0, 0, 2]));
    let searched: BTreeSet<u32> = [[1, 0, 0], [2, 1, 0], [2, 0, 1]].map(index).into_iter().collect();
    let root: BTreeSet<u32> = (0..8_u16).map(|i| index([i & 1, i >> 1 & 1, i >> 2].map(|x| 2 * x))).collect();
    assert!(searched.len() == 3 && searched.is_disjoint(&root), "edges that end in the bump are searched");
    assert_eq!(octree.frontiers.len(), 48 + 3, "faces and the centre pair neighbours that agree");
}

#[test]
fn errors_divide_as_power_does_and_the_limit_holds() {
    // Every quarter along Z has its own best mode; the others spoil 0.01.
    let steep = |camera: SampleCamera, settings: RenderSettings| {
        let quality = settings.level(0) as f64;
        CostPoint::new(1.0 + quality, (2.0 - quality) / 20.0 + if settings.level(1) == by_height(camera) { 0.0 } else { 0.01 })
    };
    for levels in [0, 1, 2] {
        let mut field = field(steep);
        let octree = run(&mut field, &config(levels)).octree;
        assert_eq!(octree.levels, levels);
        assert_eq!(leaves(&octree).len(), 8_usize.pow(u32::from(levels)));
    }
    let mut field = field(steep);
    // 0.01 in each direction.
    let lenient = SubdivideConfig { error_threshold: 0.021, ..config(2) };
    assert_eq!(run(&mut field, &lenient).octree.levels, 0);
}

#[test]
fn thresholds_are_exclusive_absolute_or_relative() {
    let step = |camera: SampleCamera, settings| watts(usize::from(camera.position.x > 0.5), settings);
    let levels = |power_threshold| run(&mut field(step), &SubdivideConfig { power_threshold, ..config(1) }).octree.levels;
    let absolute = |watts| levels(Threshold::Absolute(Watts(watts)));
    assert_eq!([absolute(0.99), absolute(1.0), absolute(1.01)], [1, 0, 0]);
    // Every frontier ranges from 3 to 5 W.
    assert_eq!([0.49, 0.5, 0.51].map(|share| levels(Threshold::Relative(share))), [1, 0, 0]);
}

#[test]
fn blind_cameras_cost_nothing_and_force_nothing() {
    // A wall: below x = 0.4 nothing is seen, and another mode would be best.
    let sees: fn(SampleCamera) -> bool = |camera| camera.position.x > 0.4;
    let walled = |camera: SampleCamera, settings| watts(usize::from(camera.position.x > 0.4), settings);
    let mut field = Field { cost: walled, sees, clock: Rc::default(), asked: Vec::new() };
    let Subdivision { octree, statistics } = run(&mut field, &config(3));
    assert_eq!(octree.levels, 0);
    assert!(field.asked.iter().all(|camera| sees(*camera)));
    assert_eq!((statistics.blind, statistics.searched), (24, 24));
    let none = [Corner::UNKNOWN; 6];
    assert!(octree.corners.iter().all(|corner| (corner.at[0] == 0) == (corner.frontiers == none)));
    // All blind: a map all the same.
    let mut field = Field { cost: walled, sees: |_| false, clock: Rc::default(), asked: Vec::new() };
    let Subdivision { octree, statistics } = run(&mut field, &SubdivideConfig { power_threshold: Threshold::Relative(0.1), ..config(3) });
    assert_eq!((octree.frontiers.len(), statistics.blind, statistics.evaluations), (0, 48, 0));
}

#[test]
fn a_new_corner_between_a_wall_and_a_room_shares_the_room_s_frontier() {
    let sees: fn(SampleCamera) -> bool = |camera| camera.position.x > 0.4;
    let steep = |camera: SampleCamera, settings| watts(by_height(camera), settings);
    let mut field = Field { cost: steep, sees, clock: Rc::default(), asked: Vec::new() };
    let octree = run(&mut field, &config(1)).octree;
    assert_eq!(octree.levels, 1);
    assert_eq!(corner(&octree, [1, 0, 0]).frontiers, corner(&octree, [2, 0, 0]).frontiers);
    assert_eq!(corner(&octree, [0, 1, 1]).frontiers, [Corner::UNKNOWN; 6]);
}

/// Stops at a time on the field's clock.
struct Deadline {
    clock: Rc<Cell<f64>>,
    limit: f64,
    /// Whether it says how much is left, or stops unexpectedly.
    told: bool,
}

impl Monitor for Deadline {
    fn keep_going(&mut self) -> bool {
        self.clock.get() < self.limit
    }

    fn seconds(&mut self) -> f64 {
        self.clock.get()
    }

    fn remaining_seconds(&mut self) -> Option<f64> {
        self.told.then(|| self.limit - self.clock.get())
    }
}

fn steep(camera: SampleCamera, settings: RenderSettings) -> CostPoint {
    watts(by_height(camera), settings)
}

#[test]
fn a_run_cut_short_at_any_time_gives_a_whole_map() {
    let mut complete = 0;
    for limit in (0..2600).step_by(29) {
        let mut field = field(steep);
        let mut deadline = Deadline { clock: field.clock.clone(), limit: f64::from(limit), told: limit % 2 == 0 };
        let Subdivision { octree, statistics } = subdivide(&knobs(), SPACE, &config(1), &mut field, &mut deadline).expect("a map");
        assert_valid(&octree);
        assert!(statistics.evaluations <= limit as usize);
        if statistics.searched > 0 {
            assert_eq!(statistics.blind, 0, "those not searched share a frontier");
        }
        if octree.levels > 0 && statistics.unfinished > 0 {
            assert!(!statistics.complete);
        }
        complete += usize::from(statistics.complete);
    }
    assert!(complete > 0, "long enough for all");
}

#[test]
fn time_is_shared_so_that_the_root_is_covered_first() {
    let many = KnobSpace::new((0..8).map(|knob| Knob::new(&format!("k{knob}"), [0.0, 1.0, 2.0, 3.0])).collect()).expect("a valid space");
    let mut field = field(steep);
    // Ten evaluations for each of 48 cameras: fewer than the least. Three scouts take a tenth each of all there are.
    let mut deadline = Deadline { clock: field.clock.clone(), limit: 480.0, told: true };
    let Subdivision { octree, statistics } = subdivide(&many, SPACE, &config(3), &mut field, &mut deadline).expect("a map");
    assert_valid(&octree);
    assert_eq!((statistics.searched, statistics.unfinished), (48, 0));
    let mut counts: Vec<usize> = {
        let mut cameras: Vec<_> = field.asked.iter().map(|camera| camera.key()).collect();
        cameras.sort_unstable();
        cameras.chunk_by(|a, b| a == b).map(<[_]>::len).collect()
    };
    assert_eq!(counts.len(), 48);
    counts.sort_unstable();
    let (others, scouts) = counts.split_at(45);
    assert!(others.iter().all(|count| (5..=24).contains(count)) && scouts.iter().all(|count| (40..=56).contains(count)), "{counts:?}");
}

#[test]
fn the_nearest_searched_camera_stands_in() {
    let mut field = field(steep);
    // Fifteen settings each: time for the six views of the first corner and one of the second.
    let mut deadline = Deadline { clock: field.clock.clone(), limit: 105.0, told: false };
    let octree = subdivide(&knobs(), SPACE, &config(2), &mut field, &mut deadline).expect("a map").octree;
    assert_eq!(octree.frontiers.len(), 7);
    assert_eq!(corner(&octree, [1, 1, 0]).frontiers, [6, 1, 2, 3, 4, 5]);
    assert_eq!(corner(&octree, [0, 1, 1]).frontiers, [0, 1, 2, 3, 4, 5]);
}

#[test]
fn the_same_seed_gives_the_same_map_and_comparisons_improve_it() {
    let map = || run(&mut field(steep), &SubdivideConfig { search: SearchConfig { seed: 5, ..SearchConfig::default() }, ..config(2) });
    assert_eq!(map(), map());
}

#[test]
fn nonsense_is_refused() {
    let refuse =
        |space, config: &SubdivideConfig| subdivide(&knobs(), space, config, &mut field(steep), &mut Unwatched).expect_err("nonsense");
    let flat = CameraSpace { min: Vec3::ZERO, max: Vec3::new(1.0, 0.0, 1.0) };
    assert!(matches!(refuse(flat, &config(1)), SubdivideError::Space(_)));
    assert!(matches!(refuse(CameraSpace { min: Vec3::NAN, ..SPACE }, &config(1)), SubdivideError::Space(_)));
    assert_eq!(refuse(SPACE, &config(16)), SubdivideError::Levels(16));
    let negative = SubdivideConfig { power_threshold: Threshold::Absolute(Watts(-1.0)), ..config(1) };
    assert!(matches!(refuse(SPACE, &negative), SubdivideError::Threshold { metric: "power", .. }));
    let unknown = SubdivideConfig { error_threshold: f64::NAN, ..config(1) };
    assert!(matches!(refuse(SPACE, &unknown), SubdivideError::Threshold { metric: "error", .. }));
}
