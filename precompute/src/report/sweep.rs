//! The report of `frugal sweep`.

use bevy_frugal_gi::frontier::{Frontier, FrontierPoint};
use bevy_frugal_gi::knobs::KnobSpace;
use bevy_frugal_gi::power::MeterInfo;
use glam::Vec3;

use super::{Color, Curve, Report, ReportError, Section, cloud, knob_table, provenance, staircase};

/// Results of one camera's sweep.
#[derive(Clone, Debug)]
pub(crate) struct SweepSummary<'a> {
    /// The scene's name.
    pub scene: &'a str,
    /// The knobs that settings refer to.
    pub space: &'a KnobSpace,
    /// Every combination with its cost.
    pub points: &'a [FrontierPoint],
    /// Description of the error metric.
    pub error: &'a str,
    /// The power meter.
    pub meter: &'a MeterInfo,
    /// Width and height, pixels.
    pub size: [u32; 2],
    /// Target frame rate.
    pub fps: f64,
    /// The camera, metres.
    pub position: Vec3,
    /// The point that it looks at, metres.
    pub look_at: Vec3,
}

/// A page on a sweep; `facts`: conditions of the figures.
///
/// # Errors
/// When plotting fails.
pub(crate) fn sweep_report(
    summary: &SweepSummary<'_>,
    facts: &[(String, String)],
) -> Result<String, ReportError> {
    let mut report = Report::new(&format!("Every combination at one camera in {}", summary.scene));
    report.facts(facts).section(sweep_section(summary)?);
    Ok(report.render())
}

/// The same as a section of a larger page.
///
/// # Errors
/// When plotting fails.
pub(crate) fn sweep_section(summary: &SweepSummary<'_>) -> Result<Section, ReportError> {
    let frontier = Frontier::from_points(summary.points.iter().copied());
    let points: Vec<(f64, f64)> =
        summary.points.iter().map(|point| (point.cost.power.0, point.cost.error)).collect();
    let mut section = Section::new(&format!(
        "{}: power and error of {} combinations",
        summary.scene,
        points.len()
    ));
    section.paragraph(&format!(
        "Each point is one combination of knob levels at the same camera. The line is the Pareto frontier: {} combinations that are \
         non-dominated in power and error. {} Error is {}.",
        frontier.points().len(),
        provenance(summary.meter),
        summary.error
    ));
    let broken =
        points.iter().filter(|(power, error)| !(power.is_finite() && error.is_finite())).count();
    if broken > 0 {
        section.warning(&format!("{broken} combinations have no finite cost and are not shown"));
    }
    let Vec3 { x, y, z } = summary.position;
    let to = summary.look_at;
    section.facts(&[
        ("Image size".to_owned(), format!("{} × {} pixels", summary.size[0], summary.size[1])),
        ("Target frame rate".to_owned(), format!("{} per second", summary.fps)),
        ("Camera at".to_owned(), format!("{x}, {y}, {z} m")),
        ("Looks at".to_owned(), format!("{}, {}, {} m", to.x, to.y, to.z)),
    ]);
    let line = Curve { color: Color::BLUE, width: 2, points: staircase(&frontier) };
    let svg =
        cloud("Power and error of every combination", ["power, W", "error"], &points, &[line])?;
    section.legend([("combinations", Color::GREY), ("frontier", Color::BLUE)]);
    section.plots(&[("Power and error of every combination, with the frontier", svg)]);
    let (headers, rows, shared) = knob_table(summary.space, frontier.points());
    section.table("The frontier, cheapest first", &headers, &rows);
    if !shared.is_empty() {
        section.paragraph(&format!("All of it has {shared}."));
    }
    Ok(section)
}

#[cfg(test)]
mod tests {
    use bevy_frugal_gi::frontier::CostPoint;

    use super::*;
    use crate::evaluate::fake::{error, meter, power, space};

    fn points() -> Vec<FrontierPoint> {
        space()
            .iter()
            .map(|settings| FrontierPoint {
                settings,
                cost: CostPoint::new(power(settings), error(settings)),
            })
            .collect()
    }

    #[test]
    fn a_sweep_is_drawn_with_its_frontier() {
        let (space, meter, mut points) = (space(), meter(), points());
        let broken = FrontierPoint { cost: CostPoint::new(f64::NAN, 0.0), ..points[0] };
        points.push(broken);
        let (position, look_at) = (Vec3::new(0.0, 1.5, 4.0), Vec3::ZERO);
        let summary = SweepSummary {
            scene: "court",
            space: &space,
            points: &points,
            error: "of some kind",
            meter: &meter,
            size: [320, 180],
            fps: 30.0,
            position,
            look_at,
        };
        let html = sweep_report(&summary, &[]).unwrap();
        assert!(
            html.contains("1 combinations have no finite cost") && html.contains("0, 1.5, 4 m")
        );
        let none = SweepSummary { points: &[], ..summary };
        assert!(sweep_report(&none, &[]).unwrap().contains("<svg "));
    }
}
