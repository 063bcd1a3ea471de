//! Frontier maps: read from a file, or written by hand.

use std::path::Path;

use bevy_frugal_gi::frontier::{
    Bounds, Capture, Corner, CostPoint, ErrorRates, Frontier, FrontierMap, FrontierPoint, Octree,
    SceneIdentity, Thresholds, WorkPrices,
};
use bevy_frugal_gi::knobs::KnobSpace;
use bevy_frugal_gi::power::{MeterInfo, Provenance};

/// Reads the map in `file`.
pub fn read(file: &Path) -> FrontierMap {
    let text = std::fs::read_to_string(file).unwrap_or_else(|error| panic!("{file:?}: {error}"));
    FrontierMap::from_ron(&text).unwrap_or_else(|error| panic!("{file:?}: {error}"))
}

/// One cube of 20 m around the origin. The frontier of every view at every corner holds three
/// settings: the lowest at 1 W, the middle at 2 W and the highest at 4 W, with errors of 0.2, 0.05
/// and 0.
pub fn one_cube(knobs: KnobSpace) -> FrontierMap {
    let points =
        [(0.0, 1.0, 0.2), (0.5, 2.0, 0.05), (1.0, 4.0, 0.0)].map(|(share, power, error)| {
            FrontierPoint { settings: knobs.preset(share), cost: CostPoint::new(power, error) }
        });
    let corner = |number: u16| Corner {
        at: [number & 1, number >> 1 & 1, number >> 2 & 1],
        frontiers: [0; 6],
    };
    let mut corners: Vec<Corner> = (0..8).map(corner).collect();
    corners.sort_by_key(|corner| corner.at);
    FrontierMap {
        version: FrontierMap::VERSION,
        scene: SceneIdentity { name: "by hand".into(), fingerprint: "0123456789abcdef".into() },
        capture: Capture {
            size: [64, 36],
            frames_per_second: 30.0,
            vertical_fov: 60.0,
            exposure_ev100: 8.0,
        },
        meter: MeterInfo {
            name: "cpu-time".into(),
            provenance: Provenance::Modelled,
            description: "by hand".into(),
        },
        shared: Frontier::default(),
        error_rates: ErrorRates::default(),
        work_prices: WorkPrices::default(),
        knob_effects: Default::default(),
        thresholds: Thresholds { power_w: 0.5, error: 0.005 },
        seed: 0,
        knobs,
        bounds: Bounds { min: [-10.0; 3], max: [10.0; 3] },
        octree: Octree {
            levels: 0,
            nodes: vec![0],
            corners,
            frontiers: vec![Frontier::from_points(points)],
        },
    }
}
