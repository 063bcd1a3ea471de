//! The report of `frugal inspect`: contents of a frontier map.

use frugal_core::frontier::{Frontier, FrontierMap};
use glam::Vec3;

use super::plan::Plan;
use super::{
    Axis, Color, Curve, Fact, Plot, Report, ReportError, Section, Survey, knob_table, provenance,
    staircase,
};

/// Number of frontiers shown in full: the largest, the middle one, and the smallest.
const SHOWN: usize = 3;
/// Greatest number of rows shown of a frontier.
const ROWS: usize = 30;
/// Colour of corners in the plan at which every view has a frontier.
const CORNER: Color = Color::BLUE;

/// A page on a map; `facts`: conditions of the map.
///
/// # Errors
/// When plotting fails.
pub(crate) fn map_report(map: &FrontierMap, facts: &[Fact]) -> Result<String, ReportError> {
    let mut report = Report::new(&format!("Frontier map of {}", map.scene.name));
    report.facts(facts).section(map_section(map)?);
    Ok(report.render())
}

/// The same as a section of a larger page.
///
/// # Errors
/// When plotting fails.
pub(crate) fn map_section(map: &FrontierMap) -> Result<Section, ReportError> {
    let (octree, survey) = (&map.octree, Survey::new(&map.octree));
    let mut section = Section::new(&format!("{}: the frontier map", map.scene.name));
    section.paragraph(&format!(
        "At every corner of the octree's leaves and for each of six views the map holds a Pareto frontier: the settings that are non-dominated in \
         power and error. {}",
        provenance(&map.meter)
    ));
    if survey.broken > 0 {
        section.warning(&format!(
            "{} indices of the octree point nowhere: the file is damaged",
            survey.broken
        ));
    }
    section.facts(&facts(map, &survey));
    let mut shown: Vec<(usize, &Frontier)> =
        octree.frontiers.iter().enumerate().filter(|(_, frontier)| !frontier.is_empty()).collect();
    shown.sort_by_key(|(index, frontier)| (std::cmp::Reverse(frontier.points().len()), *index));
    if shown.len() > SHOWN {
        shown = vec![shown[0], shown[shown.len() / 2], shown[shown.len() - 1]];
    }
    let curve = |index: usize, frontier: &Frontier| Curve {
        color: Color::SERIES[index],
        width: 2,
        points: staircase(frontier),
    };
    let lines: Vec<Curve> =
        shown.iter().enumerate().map(|(rank, (_, frontier))| curve(rank, frontier)).collect();
    let names: Vec<String> = shown
        .iter()
        .map(|(index, frontier)| format!("frontier {index}, {} points", frontier.points().len()))
        .collect();
    let frontiers = Plot { label: "Some frontiers", curves: &lines, ..Plot::default() };
    section.plots(&[
        (
            "Seen from above, X to the right and Z down: outlines of leaves; corners, fainter where fewer of their views have a frontier",
            plan(map, &survey),
        ),
        ("The largest, the middle and the smallest frontier", frontiers.svg([Axis::POWER, Axis::ERROR])?),
    ]);
    section
        .legend(names.iter().enumerate().map(|(rank, name)| (name.as_str(), Color::SERIES[rank])));
    for ((_, frontier), name) in shown.iter().zip(&names) {
        section.heading(name);
        let points = &frontier.points()[..frontier.points().len().min(ROWS)];
        let (headers, rows, shared) = knob_table(&map.knobs, points);
        section.table("Cheapest first", &headers, &rows);
        if frontier.points().len() > ROWS {
            section.paragraph(&format!("… and {} more.", frontier.points().len() - ROWS));
        }
        if !shared.is_empty() {
            section.paragraph(&format!("All of these have {shared}."));
        }
    }
    Ok(section)
}

fn facts(map: &FrontierMap, survey: &Survey) -> Vec<Fact> {
    let ([low, high], octree) = (corners(map), &map.octree);
    let [width, height] = map.capture.size;
    let settings: usize = octree.frontiers.iter().map(|frontier| frontier.points().len()).sum();
    vec![
        ("Image size", format!("{width} × {height} pixels")),
        ("Target frame rate", format!("{} per second", map.capture.frames_per_second)),
        (
            "Cameras between",
            format!("({}, {}, {}) and ({}, {}, {}) m", low.x, low.y, low.z, high.x, high.y, high.z),
        ),
        (
            "Subdivided above",
            format!(
                "{} W or an error of {}",
                rounded(map.thresholds.power_w),
                rounded(map.thresholds.error)
            ),
        ),
        ("Leaves", survey.leaves.iter().sum::<usize>().to_string()),
        ("Corners", octree.corners.len().to_string()),
        (
            "Views with a frontier",
            format!("{} of {}", survey.known_views, 6 * octree.corners.len()),
        ),
        ("Different frontiers", format!("{}, {settings} settings in all", octree.frontiers.len())),
        ("Knobs", format!("{}, {} combinations", map.knobs.len(), map.knobs.combinations())),
    ]
}

/// The octree from above: outlines of leaves, and corners.
fn plan(map: &FrontierMap, survey: &Survey) -> String {
    let [low, high] = corners(map);
    let step = (high - low) / (1u32 << map.octree.levels.min(15)) as f32;
    let at = |x: u32, z: u32| low + step * Vec3::new(x as f32, 0.0, z as f32);
    let mut plan = Plan::new("The octree from above", low, high);
    for &(x, z, edge) in &survey.squares {
        plan.outline(at(x, z), at(x + edge, z + edge));
    }
    for (&(x, z), &(known, of)) in &survey.columns {
        let opacity = 0.15 + 0.85 * known as f64 / of.max(1) as f64;
        plan.dot(at(x.into(), z.into()), CORNER, opacity);
    }
    plan.finish()
}

/// Lowest and highest corner of the space of cameras, metres.
fn corners(map: &FrontierMap) -> [Vec3; 2] {
    [map.bounds.min, map.bounds.max].map(Vec3::from_array)
}

/// Rounded to four decimals for display.
fn rounded(value: f64) -> f64 {
    (value * 1e4).round() / 1e4
}

#[cfg(test)]
mod tests {
    use frugal_core::frontier::{
        Bounds, Capture, Corner, CostPoint, FrontierPoint, Octree, SceneIdentity, Thresholds,
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
            .map(|i| Corner {
                at: [i >> 2, i >> 1 & 1, i & 1],
                frontiers: [0, 1, 0, Corner::UNKNOWN, 0, 0],
            })
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
            "40 of 48",
            "(-8, 0.5, -4) and (8, 6, 4) m",
            "0.5 W or an error of 0.005",
            "frontier 1, 1 points",
            "36 combinations",
        ] {
            assert!(html.contains(text), "{text}");
        }
        assert!(html.contains("viewBox=\"0 0 464.0 244.0\""), "the plan is true to scale");
        assert!(!html.contains("damaged"));
    }

    #[test]
    fn empty_and_damaged_maps_are_described_too() {
        let empty = FrontierMap { knobs: KnobSpace::default(), ..map(Octree::default()) };
        assert!(map_report(&empty, &[]).unwrap().contains("<svg "));
        let damaged = Octree { nodes: vec![7], ..octree() };
        let flat = FrontierMap {
            knobs: KnobSpace::default(),
            bounds: Bounds { min: [0.0; 3], max: [0.0; 3] },
            ..map(damaged)
        };
        let html = map_report(&flat, &[]).unwrap();
        assert!(html.contains("damaged") && !html.contains("NaN") && !html.contains("inf\""));
    }
}
