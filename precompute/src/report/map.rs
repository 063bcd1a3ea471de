//! The report of `frugal inspect`: contents of a frontier map.

use std::collections::{BTreeMap, BTreeSet};

use frugal_core::frontier::{Corner, Frontier, FrontierMap, Octree};
use glam::Vec3;

use super::plan::Plan;
use super::{
    Axis, Color, Curve, Fact, Plot, Report, ReportError, Section, knob_table, provenance, staircase,
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
    let octree = &map.octree;
    let mut section = Section::new(&format!("{}: the frontier map", map.scene.name));
    section.paragraph(&format!(
        "At every corner of the octree's leaves and for each of six views the map holds a Pareto frontier: the settings that are non-dominated in \
         power and error. {}",
        provenance(&map.meter)
    ));
    section.facts(&map_facts(map));
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
            plan(map),
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

/// What a map holds, by name.
pub(crate) fn map_facts(map: &FrontierMap) -> Vec<Fact> {
    let ([low, high], octree, meter) = (corners(map), &map.octree, &map.meter);
    let [width, height] = map.capture.size;
    let points: usize = octree.frontiers.iter().map(|frontier| frontier.points().len()).sum();
    let (known, views) = columns(octree)
        .into_values()
        .fold((0, 0), |sum, column| (sum.0 + column.0, sum.1 + column.1));
    let power = match map.shared.points() {
        [first, .., last] => format!(
            "{:.2} to {:.2} W with errors of {:.4} to {:.4}, mean over the training cameras",
            first.cost.power.0, last.cost.power.0, first.cost.error, last.cost.error
        ),
        _ => "there is no shared frontier".to_owned(),
    };
    let budgets = match map.error_rates.0.as_slice() {
        [first, .., last] => {
            format!("errors of {} to {} are calibrated", first.budget, last.budget)
        }
        _ => "no error budget is calibrated".to_owned(),
    };
    vec![
        ("scene", format!("{} ({})", map.scene.name, map.scene.fingerprint)),
        (
            "capture",
            format!("{width} × {height} at {} frames per second", map.capture.frames_per_second),
        ),
        (
            "cameras",
            format!("({}, {}, {}) to ({}, {}, {}) m", low.x, low.y, low.z, high.x, high.y, high.z),
        ),
        ("meter", format!("{}, {}: {}", meter.provenance, meter.name, meter.description)),
        ("knobs", format!("{}, {} combinations", map.knobs.len(), map.knobs.combinations())),
        (
            "octree",
            format!(
                "{} leaves, {} corners, {} levels",
                leaves(octree).len(),
                octree.corners.len(),
                octree.levels
            ),
        ),
        (
            "frontiers",
            format!(
                "{}, {points} points; {known} of {views} views have one",
                octree.frontiers.len()
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

/// Leaves seen from above, in lattice steps: lowest x, lowest z, edge.
fn leaves(octree: &Octree) -> Vec<(u32, u32, u32)> {
    let mut leaves = Vec::new();
    let mut open = vec![(0, 0, 0, u32::from(octree.lattice()))];
    while let Some((node, x, z, edge)) = open.pop() {
        match octree.nodes.get(node) {
            None => {}
            Some(0) => leaves.push((x, z, edge)),
            Some(first) => {
                let half = edge / 2;
                // Children lie in the order x + 2y + 4z.
                open.extend((0..8).map(|child: u32| {
                    let node = *first as usize + child as usize;
                    (node, x + half * (child & 1), z + half * (child >> 2), half)
                }));
            }
        }
    }
    leaves
}

/// Corners seen from above, by x and z in lattice steps: views with a frontier, and all views.
fn columns(octree: &Octree) -> BTreeMap<(u16, u16), (usize, usize)> {
    let mut columns = BTreeMap::new();
    for Corner { at: [x, _, z], frontiers } in &octree.corners {
        let column: &mut (usize, usize) = columns.entry((*x, *z)).or_default();
        column.0 += frontiers.iter().filter(|index| **index != Corner::UNKNOWN).count();
        column.1 += frontiers.len();
    }
    columns
}

/// The octree from above: outlines of leaves, and corners.
fn plan(map: &FrontierMap) -> String {
    let [low, high] = corners(map);
    let step = (high - low) / f32::from(map.octree.lattice());
    let at = |x: u32, z: u32| low + step * Vec3::new(x as f32, 0.0, z as f32);
    let mut plan = Plan::new("The octree from above", low, high);
    for (x, z, edge) in leaves(&map.octree).into_iter().collect::<BTreeSet<_>>() {
        plan.outline(at(x, z), at(x + edge, z + edge));
    }
    for ((x, z), (known, of)) in columns(&map.octree) {
        let opacity = 0.15 + 0.85 * known as f64 / of as f64;
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
        Bounds, Capture, CostPoint, FrontierPoint, SceneIdentity, Thresholds,
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
    }

    #[test]
    fn every_level_is_counted() {
        // A root whose last child (upper x, y and z) is subdivided again.
        let mut nodes = vec![1, 0, 0, 0, 0, 0, 0, 0, 9];
        nodes.extend([0; 8]);
        let corner = |at, frontiers| Corner { at, frontiers };
        let unknown = Corner::UNKNOWN;
        let corners = vec![
            corner([0, 0, 0], [0; 6]),
            corner([0, 4, 0], [unknown; 6]),
            corner([4, 4, 4], [0, 0, 0, unknown, 0, 0]),
        ];
        let octree = Octree { levels: 2, nodes, corners, frontiers: vec![Default::default()] };
        let leaves = leaves(&octree);
        assert_eq!(leaves.len(), 7 + 8);
        // From above: four large squares (there is a leaf below the subdivided child too), four
        // small ones.
        assert_eq!(leaves.iter().collect::<BTreeSet<_>>().len(), 8);
        assert!(leaves.contains(&(2, 3, 1)) && leaves.contains(&(2, 0, 2)));
        assert_eq!(columns(&octree), [((0, 0), (6, 12)), ((4, 4), (5, 6))].into());
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
