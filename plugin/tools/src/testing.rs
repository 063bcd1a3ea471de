//! A small frontier map for the tests of this crate.

use bevy_frugal_gi::frontier::{
    Bounds, Capture, Corner, CostPoint, ErrorRates, Frontier, FrontierMap, FrontierPoint,
    KnobEffects, Octree, SceneIdentity, Thresholds, WorkPrices,
};
use bevy_frugal_gi::knobs::{Knob, KnobLevels, KnobSpace};
use bevy_frugal_gi::power::{MeterInfo, Provenance};

/// `value` with a change. The plugin's structs that apps only read cannot be written out here.
pub(crate) fn changed<T>(mut value: T, change: impl FnOnce(&mut T)) -> T {
    change(&mut value);
    value
}

/// The knobs of [`frontier`]'s settings.
pub(crate) fn space() -> KnobSpace {
    let knobs = vec![
        Knob::new("samples", [0.0, 4.0, 8.0, 16.0, 32.0]),
        Knob::new("scale", [0.5, 0.75, 1.0]),
    ];
    KnobSpace::new(knobs).expect("a valid space")
}

/// A frontier of three points at `base`, `base` + 1 and `base` + 3 watts with errors of 0.2, 0.05
/// and 0.
pub(crate) fn frontier(base: f64) -> Frontier {
    let point = |samples, scale, power, error| FrontierPoint {
        settings: KnobLevels::default().with_level(0, samples).with_level(1, scale),
        cost: CostPoint::new(power, error),
    };
    Frontier::from_points([
        point(0, 0, base, 0.2),
        point(2, 0, base + 1.0, 0.05),
        point(4, 2, base + 3.0, 0.0),
    ])
}

/// A map with the frontier of 6 W everywhere: 8 by 4 by 8 metres around the origin.
pub(crate) fn map() -> FrontierMap {
    let mut corners: Vec<Corner> = (0..8)
        .map(|number: u16| Corner {
            at: [number & 1, number >> 1 & 1, number >> 2 & 1],
            frontiers: [0; 6],
        })
        .collect();
    corners.sort_by_key(|corner| corner.at);
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
        octree: Octree { levels: 0, nodes: vec![0], corners, frontiers: vec![frontier(6.0)] },
    }
}
