//! Time and allocations of the controller: look-up and selection in maps of 10 and 100,000 leaves,
//! and its systems in a frame with 1, 4 and 64 cameras.
//!
//! `make bench BENCH=controller`
//!
//! Times are of single calls and frames, so that the slowest hundredth is known, not only a mean.
//! Of frames, those of the same app without cameras are told apart.

#![expect(unsafe_code, reason = "an allocator that counts can be written in no other way")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::collections::{BTreeSet, VecDeque};
use std::hint::black_box;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use bevy::MinimalPlugins;
use bevy::app::{App, Update};
use bevy::asset::{AssetPlugin, Assets};
use bevy::ecs::query::With;
use bevy::ecs::system::{Local, Query};
use bevy::math::{Quat, Vec3};
use bevy::transform::components::{GlobalTransform, Transform};
use bevy_frugal_gi::control::{Budget, ControlPlugin, PowerController, Selection, select};
use bevy_frugal_gi::frontier::{
    CameraView, Corner, CostPoint, Frontier, FrontierMap, FrontierMapPlugin, FrontierPoint,
    FrontierStore, Leaf, Octree,
};
use bevy_frugal_gi::knobs::{Knob, KnobLevels, KnobSpace};
use bevy_frugal_gi::units::Watts;
use frugal_tests::map;
use frugal_tests::table::markdown;

/// The system's allocator, counted.
struct Counting;

static ALLOCATIONS: AtomicU64 = AtomicU64::new(0);

// SAFETY: every call goes to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: the caller's own promise.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller's own promise.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: the caller's own promise.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

/// Frontiers of a map, and points of each: as large as those that searches write.
const FRONTIERS: u32 = 56;
const POINTS: u32 = 24;
/// Depth of the octrees: 262,144 leaves at most.
const LEVELS: u8 = 6;
const CALLS: usize = 200_000;
const FRAMES: usize = 2_000;

fn knobs() -> KnobSpace {
    let knob = |number: u32| Knob::new(&format!("knob_{number}"), [0.0, 1.0, 2.0, 3.0]);
    KnobSpace::new((0..13).map(knob).collect()).expect("a space")
}

/// A map with at least `leaves` leaves.
fn map_of(leaves: usize) -> FrontierMap {
    let mut map = map::one_cube(knobs());
    let mut nodes = vec![0];
    let whole = Leaf { min: [0; 3], size: 1 << LEVELS };
    let mut open = VecDeque::from([(0_usize, whole)]);
    while open.len() < leaves {
        let Some((node, leaf)) = open.pop_front() else { break };
        nodes[node] = nodes.len() as u32;
        let half = Leaf { min: leaf.min, size: leaf.size / 2 };
        for child in 0..8 {
            open.push_back((nodes.len(), Leaf { min: half.corner(child), ..half }));
            nodes.push(0);
        }
    }
    let at: BTreeSet<[u16; 3]> =
        open.iter().flat_map(|(_, leaf)| (0..8).map(|number| leaf.corner(number))).collect();
    let corner = |(index, at): (u32, [u16; 3])| Corner {
        at,
        frontiers: std::array::from_fn(|side| (index * 7 + side as u32) % FRONTIERS),
    };
    let frontier = |number: u32| {
        Frontier::from_points((0..POINTS).map(|point| FrontierPoint {
            settings:
                KnobLevels::default().with_level((point / 3) as usize, (1 + point % 3) as usize),
            cost: CostPoint::new(
                1.0 + f64::from(point) + 0.01 * f64::from(number),
                0.4 / (1.0 + f64::from(point)),
            ),
        }))
    };
    map.octree = Octree {
        levels: LEVELS,
        nodes,
        corners: (0..).zip(at).map(corner).collect(),
        frontiers: (0..FRONTIERS).map(frontier).collect(),
    };
    map.validate().unwrap_or_else(|error| panic!("{error}"));
    map
}

/// Places all over the map, in an order without a pattern.
fn view(index: usize) -> CameraView {
    let share = |prime: usize| (index * prime % 1009) as f32 / 1009.0;
    CameraView {
        position: Vec3::new(share(17), share(101), share(307)) * 20.0 - 10.0,
        rotation: Quat::from_rotation_y(share(53) * 6.0) * Quat::from_rotation_x(share(89) - 0.5),
        vertical_fov: 1.0,
        aspect: 1.8,
    }
}

fn placed(view: &CameraView) -> GlobalTransform {
    Transform { translation: view.position, rotation: view.rotation, ..Transform::IDENTITY }.into()
}

/// The given share of the way through `sorted`.
fn quantile(sorted: &[u64], share: f64) -> u64 {
    sorted[((sorted.len() - 1) as f64 * share) as usize]
}

fn look_ups(leaves: usize) -> Vec<String> {
    let map = map_of(leaves);
    let views: Vec<CameraView> = (0..1009).map(view).collect();
    let budgets = [Budget::power(Watts(7.5)), Budget::error(0.03), Budget::both(Watts(9.0), 0.02)];
    let mut nanoseconds = Vec::with_capacity(CALLS);
    let mut allocations = 0;
    for call in 0..CALLS {
        let (view, budget) = (&views[call % views.len()], &budgets[call % budgets.len()]);
        let before = ALLOCATIONS.load(Ordering::Relaxed);
        let start = Instant::now();
        let found = map.look_up(black_box(view)).expect("a frontier");
        black_box(select(found.frontier, black_box(budget)));
        nanoseconds.push(start.elapsed().as_nanos() as u64);
        allocations += ALLOCATIONS.load(Ordering::Relaxed) - before;
    }
    nanoseconds.sort_unstable();
    let leaves = map.octree.nodes.iter().filter(|first| **first == 0).count();
    vec![
        leaves.to_string(),
        format!("{:.2} µs", quantile(&nanoseconds, 0.5) as f64 * 1e-3),
        format!("{:.2} µs", quantile(&nanoseconds, 0.99) as f64 * 1e-3),
        format!("{:.2} µs", quantile(&nanoseconds, 0.999) as f64 * 1e-3),
        allocations.to_string(),
    ]
}

/// Turns every controlled camera to another place in every frame.
fn travel(mut frame: Local<usize>, mut cameras: Query<&mut GlobalTransform, With<Selection>>) {
    *frame += 1;
    for (number, mut transform) in (0..).zip(&mut cameras) {
        *transform = placed(&view(*frame / 8 + 31 * number));
    }
}

/// Median, 99th percentile and allocations of a frame.
fn frames(cameras: usize, moves: bool) -> (f64, f64, f64) {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, AssetPlugin::default(), FrontierMapPlugin, ControlPlugin));
    if moves {
        app.add_systems(Update, travel);
    }
    app.finish();
    app.cleanup();
    let handle = app.world_mut().resource_mut::<Assets<FrontierMap>>().add(map_of(10));
    for number in 0..cameras {
        let parts = (PowerController(handle.clone()), Budget::power(Watts(7.5)));
        app.world_mut().spawn((placed(&view(number)), parts));
    }
    // Settings reach their targets.
    (0..200).for_each(|_| app.update());
    let mut nanoseconds = Vec::with_capacity(FRAMES);
    let before = ALLOCATIONS.load(Ordering::Relaxed);
    for _ in 0..FRAMES {
        let start = Instant::now();
        app.update();
        nanoseconds.push(start.elapsed().as_nanos() as u64);
    }
    let allocations = ALLOCATIONS.load(Ordering::Relaxed) - before;
    nanoseconds.sort_unstable();
    (
        quantile(&nanoseconds, 0.5) as f64 * 1e-3,
        quantile(&nanoseconds, 0.99) as f64 * 1e-3,
        allocations as f64 / FRAMES as f64,
    )
}

fn main() {
    println!("## Look-up and selection of one camera, {CALLS} calls\n");
    let rows = [10, 100_000].map(look_ups);
    println!(
        "{}\n",
        markdown(&["leaves", "median", "99 %", "99.9 %", "allocations of all calls"], &rows)
    );
    println!("## The whole app in a frame, {FRAMES} frames\n");
    let mut rows = Vec::new();
    for moves in [false, true] {
        for cameras in [0, 1, 4, 64] {
            let (median, slow, allocations) = frames(cameras, moves);
            rows.push(vec![
                format!("{cameras} cameras, {}", if moves { "moving" } else { "at rest" }),
                format!("{median:.1} µs"),
                format!("{slow:.1} µs"),
                format!("{allocations:.2}"),
            ]);
        }
    }
    println!("{}", markdown(&["app", "median", "99 %", "allocations of a frame"], &rows));
}
