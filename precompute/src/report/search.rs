//! The section on a search: cameras, error at equal power, influence of knobs.

use frugal_core::frontier::{CostPoint, Frontier, FrontierMap, FrontierPoint};
use frugal_core::knobs::KnobLevels;
use frugal_search::cameras::{CameraSet, MovingCamera};
use frugal_search::pipeline::Outcome;
use glam::Vec3;

use super::{
    Axis, BLUE, Curve, Fact, GREY, Mark, Plot, Report, SERIES, percent, settings_table, staircase,
};

/// A finished search.
#[derive(Debug)]
pub(crate) struct SearchSummary {
    /// Its map.
    pub map: FrontierMap,
    /// Its outcome.
    pub outcome: Outcome,
    /// Its cameras.
    pub cameras: CameraSet,
}

/// Adds the section.
///
/// # Errors
/// When plotting fails.
pub(crate) fn search_section(report: &mut Report, summary: &SearchSummary) -> Result<(), String> {
    let SearchSummary { map, outcome, .. } = summary;
    report.section(&format!("{}: the search", map.scene.name));
    report.facts(&search_facts(summary));
    report.plots(&[
        (
            "Cameras from above. Lines show where training cameras look, points are calibration cameras",
            plan(summary)?,
        ),
        (
            "Mean error at equal mean power at the training cameras: settings by view (blue), from frontiers fitted without that view; the best constant (orange)",
            equal_power(summary)?,
        ),
    ]);
    report.table(
        "Error of each knob lowered alone to its worst level, mean over the pilot cameras",
        &["knob", "error, 1 − SSIM"],
        &influence(summary),
    );
    let mut pool: Vec<FrontierPoint> = outcome
        .pool
        .iter()
        .filter_map(|settings| {
            Some(FrontierPoint { settings: *settings, cost: mean_cost(outcome, *settings)? })
        })
        .collect();
    pool.sort_by(|a, b| a.cost.power.0.total_cmp(&b.cost.power.0));
    settings_table(report, "The pool: mean costs at the training cameras", &map.knobs, &pool);
    Ok(())
}

/// Effort, size of the map, and accuracy of its figures, by name.
pub(crate) fn search_facts(SearchSummary { map, outcome, cameras }: &SearchSummary) -> Vec<Fact> {
    let report = &outcome.fitted.report;
    let (made, seconds) = outcome.effort;
    let [training, calibration] = outcome.cameras;
    let budgets = match map.error_rates.0.first() {
        Some(least) => format!("from {} up are calibrated", least.budget),
        None => "none is calibrated: each frame's error is limited instead".to_owned(),
    };
    let mut facts = vec![
        (
            "Renderings",
            format!("{}, of them {made} in this run, {seconds:.0} s", outcome.renderings),
        ),
        ("Training cameras", format!("{training} of {}", cameras.training.len())),
        ("Calibration cameras", format!("{calibration} of {}", cameras.calibration.len())),
        ("Pool", format!("{} settings", outcome.pool.len())),
        (
            "Octree",
            format!(
                "{} nodes, {} corners, {} frontiers",
                map.octree.nodes.len(),
                map.octree.corners.len(),
                map.octree.frontiers.len()
            ),
        ),
        ("Cost more than the optimum", percent(report.octree_loss) + ", at held-out cameras"),
        ("With one shared frontier", percent(report.shared_loss)),
        (
            "Error of the cost model",
            percent(outcome.cost_error) + " in the mean, at held-out readings",
        ),
        ("Error budgets", budgets),
        ("Best settings rendered twice", format!("an error of {:.4}", outcome.noise)),
    ];
    let without = &outcome.screening.without_effect;
    if !without.is_empty() {
        let names: Vec<_> =
            without.iter().map(|knob| map.knobs.knobs()[*knob].name.as_str()).collect();
        facts.push(("Without effect, at their cheapest", names.join(", ")));
    }
    facts
}

/// Mean over the training cameras.
fn mean_cost(outcome: &Outcome, settings: KnobLevels) -> Option<CostPoint> {
    let table = &outcome.training;
    table.mean(table.column(settings)?, 0..table.rows())
}

/// Share of the longest side of the camera space that a training camera's line has.
const LINE: f32 = 0.03;

/// Cameras from above, training cameras as lines in their directions.
fn plan(summary: &SearchSummary) -> Result<String, String> {
    let SearchSummary { map, outcome, cameras } = summary;
    let [min, max] = [map.bounds.min, map.bounds.max].map(Vec3::from_array);
    let length = LINE * (max - min).max_element();
    let above = |position: Vec3| (f64::from(position.x), f64::from(-position.z));
    let line = |camera: &MovingCamera| {
        let (from, forward) = (camera.pose.position, camera.pose.forward());
        let points = vec![above(from), above(from + length * forward)];
        Curve { color: BLUE, width: 2, points }
    };
    let point = |camera: &MovingCamera| {
        let at = above(camera.pose.position);
        Mark { name: String::new(), at, color: GREY }
    };
    let training = outcome.training_cameras.iter().filter_map(|one| cameras.training.get(*one));
    let lines: Vec<Curve> = training.map(line).collect();
    let points: Vec<Mark> =
        cameras.calibration.iter().take(outcome.cameras[1]).map(point).collect();
    let plot =
        Plot { label: "Cameras from above", curves: &lines, marks: &points, ..Plot::default() };
    plot.svg([Axis::along("x, m"), Axis::along("−z, m")])
}

/// Exchange rates of error against power, watts per unit of error, from 10 to the power of −2 to 6.
fn rates() -> impl Iterator<Item = f64> {
    (0..=160).map(|step| 10f64.powf(-2.0 + 0.05 * f64::from(step)))
}

/// Mean error against mean power over the training cameras: by view at one exchange rate, from
/// frontiers fitted without that view, and of constant settings.
fn equal_power(summary: &SearchSummary) -> Result<String, String> {
    let table = &summary.outcome.training;
    let constants: Vec<CostPoint> = (0..table.settings().len())
        .filter_map(|column| table.mean(column, 0..table.rows()))
        .collect();
    let mean = |rate: f64| {
        let costs: Option<Vec<CostPoint>> = (0..table.rows())
            .map(|row| {
                let frontier = summary.outcome.fitted.held_out.get(row)?;
                table.get(row, frontier.least_sum(rate)?.settings)
            })
            .collect();
        let costs = costs.filter(|costs| !costs.is_empty())?;
        let mean = |value: fn(&CostPoint) -> f64| {
            costs.iter().map(value).sum::<f64>() / costs.len() as f64
        };
        Some((mean(|cost| cost.power.0), mean(|cost| cost.error)))
    };
    let by_view = Curve { color: BLUE, width: 2, points: rates().filter_map(mean).collect() };
    let points =
        constants.iter().map(|cost| FrontierPoint { settings: KnobLevels::default(), cost: *cost });
    let best = staircase(&Frontier::from_points(points));
    let best = Curve { color: SERIES[1], width: 2, points: best };
    let plot = Plot {
        label: "Mean error at equal mean power",
        curves: &[by_view, best],
        ..Plot::default()
    };
    plot.svg([Axis::POWER, Axis::ERROR])
}

/// A row for each knob with effect, the greatest first.
fn influence(summary: &SearchSummary) -> Vec<Vec<String>> {
    let screening = &summary.outcome.screening;
    let knobs = summary.map.knobs.knobs().iter().enumerate();
    let mut rows: Vec<(f64, &str)> = knobs
        .filter(|(index, _)| !screening.without_effect.contains(index))
        .map(|(index, knob)| {
            let levels = screening.effects.get(index).into_iter().flatten();
            (levels.copied().fold(0.0, f64::max), knob.name.as_str())
        })
        .collect();
    rows.sort_by(|a, b| b.0.total_cmp(&a.0).then_with(|| a.1.cmp(b.1)));
    rows.into_iter().map(|(error, name)| vec![name.to_owned(), format!("{error:.3}")]).collect()
}

#[cfg(test)]
mod tests {
    use frugal_core::frontier::Bounds;
    use frugal_search::testing::searched;

    use super::*;
    use crate::inspect::testing::map_of;

    #[test]
    fn a_search_is_described() {
        let (space, bounds, cameras, outcome) = searched();
        let map = map_of(&outcome, bounds, space);
        let counts = outcome.cameras;
        let summary = SearchSummary { map, outcome, cameras };
        let mut report = Report::new("search");
        search_section(&mut report, &summary).expect("a section");
        let html = report.render();
        for text in
            ["Without effect, at their cheapest", "idle", "Training cameras", "gi_pixel_fraction"]
        {
            assert!(html.contains(text), "{text}");
        }
        // A line for each training camera, beside one of errors, and a point for each calibration camera.
        assert_eq!(html.matches("stroke=\"#2F7DE1\"").count(), counts[0] + 1);
        assert_eq!(html.matches("<circle ").count(), counts[1]);
        assert!(!html.contains("NaN") && !html.contains("inf\""));
    }

    #[test]
    fn a_search_that_found_nothing_is_described_too() {
        let (space, _, _, mut outcome) = searched();
        outcome.pool.clear();
        outcome.training_cameras.clear();
        outcome.training = frugal_search::table::CostTable::new(0);
        outcome.fitted.shared = Frontier::default();
        outcome.fitted.held_out.clear();
        outcome.error_rates.0.clear();
        let map = map_of(&outcome, Bounds { min: [1.0; 3], max: [1.0; 3] }, space);
        let summary = SearchSummary { map, outcome, cameras: CameraSet::default() };
        let mut report = Report::new("search");
        search_section(&mut report, &summary).expect("a section");
        assert!(!report.render().contains("NaN"));
    }
}
