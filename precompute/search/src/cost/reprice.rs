//! Recomputes a map's power for other prices, another size, or another frame rate, without a new
//! search.

use frugal_core::frontier::{CostPoint, Frontier, FrontierMap, FrontierPoint, WorkPrices};
use frugal_core::power::MeterInfo;
use frugal_core::units::Watts;
use serde::{Deserialize, Serialize};

use super::shared::energy;
use super::{FrameLayout, saved_joules, with_shared_knobs};

/// Prices of work on one device, as `frugal calibrate` writes them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DeviceModel {
    /// The adapter's name.
    pub adapter: String,
    /// The power meter.
    pub meter: MeterInfo,
    /// Mean of |predicted ÷ read − 1| at held-out readings.
    pub mean_absolute_error: f64,
    /// The prices.
    pub prices: WorkPrices,
}

/// New conditions; `None` keeps the map's own.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NewConditions {
    /// The device.
    pub device: Option<DeviceModel>,
    /// Width and height, pixels.
    pub size: Option<[u32; 2]>,
    /// Hertz.
    pub frames_per_second: Option<f64>,
}

/// `map` under other conditions. Errors are unchanged: they remain those at the map's original
/// size.
///
/// Energy of a point = energy of its work at the device's prices × (recorded energy ÷ energy at the
/// map's own prices).
///
/// # Errors
/// When the map has no prices, or the device none for some of its work.
pub fn reprice(map: &FrontierMap, to: &NewConditions) -> Result<FrontierMap, String> {
    let old = &map.work_prices;
    let new = to
        .device
        .as_ref()
        .map_or_else(|| Ok(old.clone()), |device| matched(old, &device.prices))?;
    let mut repriced = map.clone();
    repriced.capture.size = to.size.unwrap_or(map.capture.size);
    repriced.capture.frames_per_second =
        to.frames_per_second.unwrap_or(map.capture.frames_per_second);
    if let Some(device) = &to.device {
        repriced.meter = device.meter.clone();
    }
    let layout = |size| FrameLayout {
        size,
        maps: old.maps,
        point_lights: old.point_lights,
        has_sky: old.has_sky,
    };
    let (before, after) = (layout(map.capture.size), layout(repriced.capture.size));
    let (old_rate, new_rate) = (map.capture.frames_per_second, repriced.capture.frames_per_second);
    let space = &map.knobs;
    let frontier = |frontier: &Frontier| -> Result<Frontier, String> {
        let point = |point: &FrontierPoint| {
            let energy = |prices: &WorkPrices, layout: &FrameLayout| {
                energy(prices, space, point.settings, layout)
            };
            let own = energy(old, &before);
            let spent = (point.cost.power.0 - old.idle.0).max(0.0) / old_rate;
            if own <= 0.0 {
                let settings = point.settings.bits();
                return Err(format!(
                    "settings {settings:#x} cost nothing at the map's own prices: the file was changed"
                ));
            }
            let power = new.idle.0 + new_rate * energy(&new, &after) * (spent / own);
            Ok(FrontierPoint {
                settings: point.settings,
                cost: CostPoint::new(power, point.cost.error),
            })
        };
        Ok(Frontier::from_points(
            frontier.points().iter().map(point).collect::<Result<Vec<_>, _>>()?,
        )
        .rounded())
    };
    repriced.octree.frontiers =
        map.octree.frontiers.iter().map(frontier).collect::<Result<_, _>>()?;
    repriced.shared = frontier(&map.shared)?;
    // Exchange rates are watts of one setting more than another's, and scale with what the best
    // settings take beyond the idle device.
    let beyond = |frontier: &Frontier, idle: Watts| {
        frontier.points().last().map_or(0.0, |point| point.cost.power.0 - idle.0)
    };
    let scale = beyond(&repriced.shared, new.idle) / beyond(&map.shared, old.idle);
    let scale = if scale.is_finite() && scale > 0.0 { scale } else { 1.0 };
    repriced.error_rates.0.iter_mut().for_each(|rate| rate.watts_per_error *= scale);
    repriced.thresholds.power_w *= scale;
    if !map.knob_effects.joules.is_empty() {
        repriced.knob_effects.joules = saved_joules(&new, space, &after);
    }
    repriced.work_prices = with_shared_knobs(new, space, &after);
    Ok(repriced)
}

/// Joules per unit of a kind of work; `None` where `prices` lack it.
pub fn price(prices: &WorkPrices, kind: &str) -> Option<f64> {
    let at = prices.kinds.iter().position(|other| other == kind)?;
    prices.joules.get(at).copied()
}

/// `prices` in the order of the map's kinds of work.
fn matched(map: &WorkPrices, prices: &WorkPrices) -> Result<WorkPrices, String> {
    let price = |kind: &String| {
        price(prices, kind).ok_or_else(|| {
            format!("the device model has no price for `{kind}`: calibrate with the map's knobs")
        })
    };
    let joules = map.kinds.iter().map(price).collect::<Result<_, _>>()?;
    Ok(WorkPrices { joules, idle: prices.idle, ..map.clone() })
}

#[cfg(test)]
mod tests {
    use frugal_core::frontier::{
        Bounds, Capture, ErrorRate, ErrorRates, Octree, SceneIdentity, Thresholds,
    };
    use frugal_core::knobs::KnobSpace;
    use frugal_core::power::Provenance;

    use super::*;
    use crate::cost::{Work, work_names};

    const FPS: f64 = 30.0;
    const LAYOUT: FrameLayout =
        FrameLayout { size: [160, 90], maps: 1, point_lights: 2, has_sky: true };

    fn space() -> KnobSpace {
        crate::testing::knobs()
    }

    fn prices(frame: f64, ray: f64) -> WorkPrices {
        let kinds = work_names(&space());
        let joules = kinds
            .iter()
            .map(|kind| {
                if kind == "frame" {
                    frame
                } else if kind == "rays" {
                    ray
                } else {
                    1e-7
                }
            })
            .collect();
        let FrameLayout { maps, point_lights, has_sky, .. } = LAYOUT;
        let idle = Watts(2.0);
        WorkPrices { kinds, joules, idle, maps, point_lights, has_sky, ..WorkPrices::default() }
    }

    /// Recorded power is 1.2 times that by the prices.
    fn map(prices: &WorkPrices, layout: &FrameLayout, fps: f64) -> FrontierMap {
        let space = space();
        let point = |share: f64| {
            let settings = space.canonical(space.preset(share));
            let joules: f64 = Work::of(&space, settings, layout)
                .0
                .iter()
                .zip(&prices.joules)
                .map(|(work, price)| work * price)
                .sum();
            FrontierPoint {
                settings,
                cost: CostPoint::new(prices.idle.0 + fps * 1.2 * joules, 0.3 * (1.0 - share)),
            }
        };
        let shared = Frontier::from_points([0.0, 0.4, 0.7, 1.0].map(point));
        FrontierMap {
            version: FrontierMap::VERSION,
            scene: SceneIdentity { name: "court".into(), fingerprint: "1f".into() },
            capture: Capture {
                size: layout.size,
                frames_per_second: fps,
                vertical_fov: 60.0,
                exposure_ev100: 12.0,
            },
            meter: MeterInfo {
                name: "formula".into(),
                provenance: Provenance::Modelled,
                description: "a formula".into(),
            },
            thresholds: Thresholds { power_w: 0.1, error: 0.001 },
            seed: 0,
            bounds: Bounds { min: [0.0; 3], max: [1.0; 3] },
            error_rates: ErrorRates(vec![ErrorRate {
                budget: 0.01,
                watts_per_error: 100.0,
                predicted: None,
            }]),
            octree: Octree {
                levels: 0,
                nodes: vec![0],
                corners: vec![],
                frontiers: vec![shared.clone()],
            },
            shared,
            work_prices: prices.clone(),
            knob_effects: Default::default(),
            knobs: space,
        }
    }

    fn agree(a: &FrontierMap, b: &FrontierMap) {
        assert_eq!(a.shared.points().len(), b.shared.points().len());
        for (a, b) in a.shared.points().iter().zip(b.shared.points()) {
            let (a_power, b_power) = (a.cost.power.0, b.cost.power.0);
            assert!(
                a.settings == b.settings && (a_power / b_power - 1.0).abs() < 2e-3,
                "{a_power} and {b_power}"
            );
        }
    }

    #[test]
    fn a_repriced_map_is_the_map_that_would_have_been_made_there() {
        let (here, there) = (prices(0.01, 2e-6), prices(0.05, 5e-7));
        let original = map(&here, &LAYOUT, FPS);
        let device = DeviceModel {
            adapter: "another".into(),
            meter: MeterInfo {
                name: "nvml".into(),
                provenance: Provenance::Measured,
                description: "a counter".into(),
            },
            mean_absolute_error: 0.03,
            prices: there.clone(),
        };
        let large = FrameLayout { size: [640, 360], ..LAYOUT };
        let conditions = NewConditions {
            device: Some(device),
            size: Some(large.size),
            frames_per_second: Some(60.0),
        };
        let repriced = reprice(&original, &conditions).expect("a map");
        agree(&repriced, &map(&there, &large, 60.0));
        assert_eq!((repriced.meter.name.as_str(), repriced.capture.size), ("nvml", [640, 360]));
        assert!(
            repriced.error_rates.is_sound() && repriced.error_rates.0[0].watts_per_error > 100.0
        );
        // Unchanged conditions give the same map.
        agree(&reprice(&original, &NewConditions::default()).expect("a map"), &original);
    }

    #[test]
    fn idle_power_is_no_part_of_exchange_rates() {
        let here = WorkPrices { idle: Watts(0.0), ..prices(0.01, 2e-6) };
        let original = map(&here, &LAYOUT, FPS);
        // A board that idles at 73 W and takes 12.7 times as much for the same work.
        let there = WorkPrices {
            idle: Watts(73.0),
            joules: here.joules.iter().map(|joules| 12.7 * joules).collect(),
            ..here.clone()
        };
        let device = DeviceModel {
            adapter: "a board".into(),
            meter: original.meter.clone(),
            mean_absolute_error: 0.0,
            prices: there,
        };
        let to = NewConditions { device: Some(device), ..NewConditions::default() };
        let repriced = reprice(&original, &to).expect("a map");
        let rate = repriced.error_rates.0[0].watts_per_error / 100.0;
        let threshold = repriced.thresholds.power_w / original.thresholds.power_w;
        for scale in [rate, threshold] {
            assert!((scale / 12.7 - 1.0).abs() < 1e-3, "{scale}");
        }
    }

    #[test]
    fn unpriceable_maps_are_refused_with_a_reason() {
        let original = map(&prices(0.01, 2e-6), &LAYOUT, FPS);
        let mut few = prices(0.01, 2e-6);
        few.kinds[5] = "something else".into();
        let device = DeviceModel {
            adapter: String::new(),
            meter: original.meter.clone(),
            mean_absolute_error: 0.0,
            prices: few,
        };
        let error =
            reprice(&original, &NewConditions { device: Some(device), ..NewConditions::default() });
        assert!(error.is_err_and(|error| error.contains("no price for `pairs`")));
        let free = FrontierMap {
            work_prices: WorkPrices { joules: vec![0.0; few_len()], ..prices(0.0, 0.0) },
            ..original
        };
        let error = reprice(&free, &NewConditions::default());
        assert!(error.is_err_and(|error| error.contains("cost nothing at the map's own prices")));
    }

    fn few_len() -> usize {
        work_names(&space()).len()
    }
}
