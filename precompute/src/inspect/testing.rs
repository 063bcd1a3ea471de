//! A synthetic map, and variants of it with noise.

use frugal_core::frontier::{Bounds, CostPoint, Frontier, FrontierMap, FrontierPoint, Thresholds};
use frugal_core::knobs::{Knob, KnobLevels, KnobSpace};
use frugal_core::power::{MeterInfo, Provenance};
use frugal_core::testing;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use frugal_search::pipeline::Outcome;

/// Points of each frontier.
const POINTS: usize = 18;

/// A frontier of `count` points with `scale` times the power of the map's shared frontier: errors
/// fall from 0.1 by a fifth each, the last is 0.
pub(super) fn frontier(scale: f64, count: usize) -> Frontier {
    let point = |number: usize| {
        let error = 0.1 * 0.8_f64.powi(number as i32);
        let power = scale * 5.0 * (0.1 / error).powf(0.4);
        let settings =
            KnobLevels::default().with_level(0, number % 16).with_level(1, number / 16 % 2);
        let error = if number + 1 == count { 0.0 } else { error };
        FrontierPoint { settings, cost: CostPoint::new(power, error) }
    };
    Frontier::from_points((0..count).map(point))
}

/// A valid map: one cube, with a frontier of its own at each of its 48 addresses.
pub(crate) fn map() -> FrontierMap {
    let knobs = vec![
        Knob::new("samples", (0..16).map(f64::from)),
        Knob::labelled("scale", [(0.5, "50%"), (1.0, "100%")]),
    ];
    let frontiers =
        (0..48).map(|number| frontier(0.8 + 0.01 * f64::from(number), POINTS)).collect();
    FrontierMap {
        meter: MeterInfo {
            name: "work".into(),
            provenance: Provenance::Modelled,
            description: "synthetic".into(),
        },
        thresholds: Thresholds { power_w: 0.1, error: 0.001 },
        seed: 0,
        knobs: KnobSpace::new(knobs).expect("a valid space"),
        bounds: Bounds { min: [0.0; 3], max: [1.0; 3] },
        shared: frontier(1.0, POINTS),
        octree: testing::cube(frontiers),
        ..testing::map(0)
    }
}

/// The map of a search's `outcome`, under the synthetic map's conditions.
pub(crate) fn map_of(outcome: &Outcome, bounds: Bounds, knobs: KnobSpace) -> FrontierMap {
    FrontierMap {
        shared: outcome.fitted.shared.clone(),
        error_rates: outcome.error_rates.clone(),
        knobs,
        bounds,
        octree: outcome.fitted.octree.clone(),
        ..map()
    }
}

/// `map` with `change` applied to every cost.
pub(super) fn with_costs(
    map: &FrontierMap,
    mut change: impl FnMut(CostPoint) -> CostPoint,
) -> FrontierMap {
    let mut changed = map.clone();
    for frontier in changed.octree.frontiers.iter_mut().chain([&mut changed.shared]) {
        let points = frontier
            .points()
            .iter()
            .map(|point| FrontierPoint { cost: change(point.cost), ..*point });
        *frontier = Frontier::from_points(points);
    }
    changed
}

/// `map` with every power times `factor`.
pub(super) fn with_power(map: &FrontierMap, factor: f64) -> FrontierMap {
    with_costs(map, |cost| CostPoint::new(cost.power.0 * factor, cost.error))
}

/// `map` with a relative error of up to `amplitude` in every power and error.
pub(super) fn with_noise(map: &FrontierMap, amplitude: f64, seed: u64) -> FrontierMap {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut noise = || 1.0 + rng.random_range(-amplitude..=amplitude);
    with_costs(map, |cost| CostPoint::new(cost.power.0 * noise(), cost.error * noise()))
}
