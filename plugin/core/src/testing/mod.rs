//! Small octrees and maps, and a simulated device with its meter, for tests and benchmarks.

mod simulated;

use std::collections::BTreeSet;

use glam::{Quat, Vec3};

use crate::frontier::{
    Bounds, CameraView, Capture, Corner, CostPoint, ErrorRates, Frontier, FrontierMap,
    FrontierPoint, KnobEffects, Leaf, Octree, SceneIdentity, Thresholds, WorkPrices,
};
use crate::knobs::{Knob, KnobLevels, KnobSpace};
use crate::power::{MeterInfo, Provenance};

pub use simulated::{SimulatedDevice, SimulatedMeter};

/// The eight corners of a leaf.
pub fn corners_of(leaf: Leaf) -> impl Iterator<Item = [u16; 3]> {
    (0..8).map(move |number| leaf.corner(number))
}

/// An octree whose last child of each level is subdivided, down to `levels`, so that leaves of
/// every size occur.
///
/// Every view of every corner has its own frontier, identified by its index; its cheapest power
/// identifies the view.
pub fn subdivided(levels: u8) -> Octree {
    let mut octree = Octree { levels, nodes: vec![0], ..Default::default() };
    let mut node = 0;
    for _ in 0..levels {
        let first = octree.nodes.len();
        octree.nodes[node] = first as u32;
        octree.nodes.extend([0; 8]);
        node = first + 7;
    }
    let mut corners = BTreeSet::new();
    let mut cube = Leaf { min: [0; 3], size: 1 << levels };
    while cube.size > 1 {
        let half = Leaf { size: cube.size / 2, ..cube };
        (0..8).for_each(|child| {
            corners.extend(corners_of(Leaf { min: half.corner(child), size: half.size }));
        });
        cube = Leaf { min: half.corner(7), size: half.size };
    }
    corners.extend(corners_of(cube));
    for (number, at) in corners.into_iter().enumerate() {
        let frontiers = std::array::from_fn(|view| (6 * number + view) as u32);
        octree.corners.push(Corner { at, frontiers });
        octree.frontiers.extend((0..6).map(|view| frontier(1.0 + view as f64)));
    }
    octree
}

/// One cube. With a frontier for each of its 48 addresses they are in the order of corners and views;
/// a single one is that of all.
pub fn cube(frontiers: Vec<Frontier>) -> Octree {
    let of = |corner: u16, view: usize| {
        if frontiers.len() == 1 { 0 } else { u32::from(corner) * 6 + view as u32 }
    };
    let corner = |number: u16| Corner {
        at: [number & 1, number >> 1 & 1, number >> 2 & 1],
        frontiers: std::array::from_fn(|view| of(number, view)),
    };
    let mut corners: Vec<Corner> = (0..8).map(corner).collect();
    corners.sort_by_key(|corner| corner.at);
    Octree { levels: 0, nodes: vec![0], corners, frontiers }
}

/// A view from the origin along −Z.
pub fn view() -> CameraView {
    CameraView { position: Vec3::ZERO, rotation: Quat::IDENTITY, vertical_fov: 1.0, aspect: 1.0 }
}

/// A frontier of three points at `base`, `base` + 1 and `base` + 3 watts with errors of 0.2, 0.05
/// and 0.
pub fn frontier(base: f64) -> Frontier {
    let settings =
        |samples, scale| KnobLevels::default().with_level(0, samples).with_level(1, scale);
    let point =
        |settings, power, error| FrontierPoint { settings, cost: CostPoint::new(power, error) };
    Frontier::from_points([
        point(settings(0, 0), base, 0.2),
        point(settings(2, 0), base + 1.0, 0.05),
        point(settings(4, 2), base + 3.0, 0.0),
    ])
}

/// The knobs of [`frontier`]'s settings.
pub fn space() -> KnobSpace {
    let knobs = vec![
        Knob::new("samples", [0.0, 4.0, 8.0, 16.0, 32.0]),
        Knob::new("scale", [0.5, 0.75, 1.0]),
    ];
    KnobSpace::new(knobs).expect("a valid space")
}

/// A valid map over [`subdivided`], 8 by 4 by 8 metres around the origin.
pub fn map(levels: u8) -> FrontierMap {
    FrontierMap {
        version: FrontierMap::VERSION,
        scene: SceneIdentity { name: "courtyard".into(), fingerprint: "00ff".into() },
        capture: Capture {
            size: [320, 180],
            frames_per_second: 30.0,
            vertical_fov: 60.0,
            exposure_ev100: 12.0,
        },
        meter: MeterInfo {
            name: "cpu-time".into(),
            provenance: Provenance::Modelled,
            description: "a model".into(),
        },
        shared: Frontier::default(),
        error_rates: ErrorRates::default(),
        work_prices: WorkPrices::default(),
        knob_effects: KnobEffects::default(),
        thresholds: Thresholds { power_w: 0.5, error: 0.005 },
        seed: 7,
        knobs: space(),
        bounds: Bounds { min: [-4.0, -2.0, -4.0], max: [4.0, 2.0, 4.0] },
        octree: subdivided(levels),
    }
}

/// One frontier everywhere: 20 settings from 4 W to 14 W.
pub fn steps() -> FrontierMap {
    let knobs =
        vec![Knob::new("a", (0..10).map(f64::from)), Knob::new("b", (0..11).map(f64::from))];
    let point = |step: usize| {
        let settings =
            KnobLevels::default().with_level(0, step / 2).with_level(1, step.div_ceil(2));
        let power = 4.0 + 10.0 * step as f64 / 19.0;
        FrontierPoint { settings, cost: CostPoint::new(power, 0.4 / power - 0.4 / 14.0) }
    };
    let frontier = Frontier::from_points((0..20).map(point));
    let mut map = map(1);
    map.knobs = KnobSpace::new(knobs).expect("a space");
    map.octree.frontiers.iter_mut().for_each(|known| *known = frontier.clone());
    map
}
