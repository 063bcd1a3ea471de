//! Frontier maps: read from a file, or written by hand.

use std::path::Path;

use bevy_frugal_gi::frontier::{
    Bounds, Capture, CostPoint, Frontier, FrontierMap, FrontierPoint, SceneIdentity,
};
use bevy_frugal_gi::knobs::{KnobLevels, KnobSpace};
use bevy_frugal_gi::power::{MeterInfo, Provenance};
use frugal_core::testing;

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
    FrontierMap {
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
        seed: 0,
        knobs,
        bounds: Bounds { min: [-10.0; 3], max: [10.0; 3] },
        octree: testing::cube(vec![Frontier::from_points(points)]),
        ..testing::map(0)
    }
}

/// A circuit through `0..count` in which every ordered pair of different numbers follow each other
/// once; it ends where it began (Hierholzer 1873).
pub fn circuit(count: usize) -> Vec<usize> {
    let mut left: Vec<Vec<usize>> =
        (0..count).map(|from| (0..count).filter(|to| *to != from).collect()).collect();
    let (mut path, mut found) = (vec![0], Vec::new());
    while let Some(&at) = path.last() {
        match left.get_mut(at).and_then(Vec::pop) {
            Some(next) => path.push(next),
            None => found.extend(path.pop()),
        }
    }
    found.reverse();
    found
}

/// The knobs that differ, with their levels.
pub fn change(map: &FrontierMap, from: KnobLevels, to: KnobLevels) -> String {
    let knobs = map.knobs.knobs().iter().enumerate();
    let changed = knobs.filter(|(index, _)| from.level(*index) != to.level(*index));
    let text = changed.map(|(index, knob)| {
        let label = |settings: KnobLevels| knob.levels[settings.level(index)].label.as_str();
        format!("{} {} to {}", knob.name, label(from), label(to))
    });
    text.collect::<Vec<_>>().join(", ")
}
