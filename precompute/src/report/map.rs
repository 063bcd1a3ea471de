//! The report of `frugal inspect`: contents of a frontier map.

use frugal_core::frontier::{Frontier, FrontierMap};

use super::{
    Axis, BLUE, Curve, Fact, GREY, Plot, RGBColor, Report, provenance, settings_table, staircase,
};

/// A page on a map; `facts`: conditions of the map.
///
/// # Errors
/// When plotting fails.
pub(crate) fn map_report(map: &FrontierMap, facts: &[Fact]) -> Result<String, String> {
    let mut report = Report::new(&format!("Frontier map of {}", map.scene.name));
    report.facts(facts);
    map_section(&mut report, map)?;
    Ok(report.render())
}

/// The same as a section of a larger page.
///
/// # Errors
/// When plotting fails.
pub(crate) fn map_section(report: &mut Report, map: &FrontierMap) -> Result<(), String> {
    let octree = &map.octree;
    report.section(&format!("{}: the frontier map", map.scene.name));
    report.paragraph(&format!(
        "At every corner of the octree's leaves and for each of six views the map holds a Pareto frontier: the settings that are non-dominated in \
         power and error. {}",
        provenance(&map.meter)
    ));
    report.facts(&map_facts(map));
    let curve = |frontier: &Frontier, color: RGBColor, width: u32| {
        let points = staircase(frontier);
        Curve { color, width, points }
    };
    let mut curves = vec![curve(&map.shared, BLUE, 2)];
    curves.extend(octree.frontiers.iter().map(|frontier| curve(frontier, GREY, 1)));
    let frontiers = Plot { label: "The frontiers", curves: &curves, ..Plot::default() };
    report.plots(&[(
        "The frontier over all views (blue), and those of the addresses (grey)",
        frontiers.svg([Axis::POWER, Axis::ERROR])?,
    )]);
    settings_table(report, "The frontier over all views", &map.knobs, map.shared.points());
    Ok(())
}

/// What a map holds, by name.
pub(crate) fn map_facts(map: &FrontierMap) -> Vec<Fact> {
    let (octree, meter) = (&map.octree, &map.meter);
    let ([west, down, north], [east, up, south]) = (map.bounds.min, map.bounds.max);
    let [width, height] = map.capture.size;
    let points: usize = octree.frontiers.iter().map(|frontier| frontier.points().len()).sum();
    let points_of_all = map.shared.points();
    let power = match points_of_all.first().zip(points_of_all.last()) {
        Some((first, last)) => format!(
            "{:.2} to {:.2} W with errors of {:.4} to {:.4}, mean over the training cameras",
            first.cost.power.0, last.cost.power.0, first.cost.error, last.cost.error
        ),
        None => "there is no shared frontier".to_owned(),
    };
    let rates = &map.error_rates.0;
    let budgets = match rates.first().zip(rates.last()) {
        Some((first, last)) => {
            format!("errors of {} to {} are calibrated", first.budget, last.budget)
        }
        None => "no error budget is calibrated".to_owned(),
    };
    vec![
        ("scene", format!("{} ({})", map.scene.name, map.scene.fingerprint)),
        (
            "capture",
            format!("{width} × {height} at {} frames per second", map.capture.frames_per_second),
        ),
        ("cameras", format!("between ({west}, {down}, {north}) and ({east}, {up}, {south}) m")),
        ("meter", format!("{}, {}: {}", meter.provenance, meter.name, meter.description)),
        ("knobs", format!("{}, {} combinations", map.knobs.len(), map.knobs.combinations())),
        (
            "octree",
            format!(
                "{} nodes, {} corners, {} levels",
                octree.nodes.len(),
                octree.corners.len(),
                octree.levels
            ),
        ),
        (
            "frontiers",
            format!(
                "{} with {points} points, for {} views",
                octree.frontiers.len(),
                6 * octree.corners.len()
            ),
        ),
        ("power", power),
        ("budgets", budgets),
        (
            "thresholds",
            format!(
                "{} W or an error of {}",
                rounded(map.thresholds.power_w),
                rounded(map.thresholds.error)
            ),
        ),
    ]
}

/// Rounded to four decimals for display.
fn rounded(value: f64) -> f64 {
    (value * 1e4).round() / 1e4
}

#[cfg(test)]
mod tests {
    use frugal_core::frontier::{
        Bounds, Capture, Corner, CostPoint, ErrorRate, ErrorRates, FrontierPoint, Octree,
        SceneIdentity, Thresholds,
    };
    use frugal_core::knobs::KnobSpace;

    use frugal_search::testing::formula::{self, error, power, space};

    use super::*;

    fn octree() -> Octree {
        let space = space();
        let point = |settings| FrontierPoint {
            settings,
            cost: CostPoint::new(power(settings), error(settings)),
        };
        let whole = Frontier::from_points(space.iter().map(point));
        let single = Frontier::from_points([point(space.lowest())]);
        let corners = (0..8u16)
            .map(|i| Corner { at: [i >> 2, i >> 1 & 1, i & 1], frontiers: [0, 1, 0, 2, 0, 0] })
            .collect();
        Octree {
            levels: 0,
            nodes: vec![0],
            corners,
            frontiers: vec![whole, single, Frontier::default()],
        }
    }

    fn map(octree: Octree) -> FrontierMap {
        let whole = formula::map(space());
        FrontierMap {
            scene: SceneIdentity { name: "court".into(), ..whole.scene },
            capture: Capture { size: [320, 180], frames_per_second: 30.0, ..whole.capture },
            thresholds: Thresholds { power_w: 0.5, error: 0.005 },
            bounds: Bounds { min: [-8.0, 0.5, -4.0], max: [8.0, 6.0, 4.0] },
            octree,
            ..whole
        }
    }

    #[test]
    fn a_map_is_described() {
        let html = map_report(&map(octree()), &[]).unwrap();
        for text in [
            "for 48 views",
            "(-8, 0.5, -4) and (8, 6, 4) m",
            "0.5 W or an error of 0.005",
            "those of the addresses",
            "36 combinations",
        ] {
            assert!(html.contains(text), "{text}");
        }
    }

    #[test]
    fn a_map_of_one_setting_and_one_budget_says_so() {
        let mut map = map(octree());
        map.shared = Frontier::from_points(map.shared.points().iter().take(1).copied());
        let rate = ErrorRate { budget: 0.1, watts_per_error: 1.0, predicted: None };
        map.error_rates = ErrorRates(vec![rate]);
        let facts: Vec<String> = map_facts(&map).into_iter().map(|(_, value)| value).collect();
        for text in ["mean over the training cameras", "errors of 0.1 to 0.1 are calibrated"] {
            assert!(facts.iter().any(|fact| fact.contains(text)), "{text}: {facts:?}");
        }
    }

    #[test]
    fn empty_and_flat_maps_are_described_too() {
        let empty = FrontierMap { knobs: KnobSpace::default(), ..map(Octree::default()) };
        assert!(map_report(&empty, &[]).unwrap().contains("<svg "));
        let flat = FrontierMap {
            knobs: KnobSpace::default(),
            bounds: Bounds { min: [0.0; 3], max: [0.0; 3] },
            ..map(octree())
        };
        let html = map_report(&flat, &[]).unwrap();
        assert!(!html.contains("NaN") && !html.contains("inf\""));
    }
}
