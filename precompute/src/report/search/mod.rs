//! The section on a search: cameras and the settings selected there, error at equal power, influence
//! of knobs, calibration.

mod plots;
mod summary;

use frugal_core::frontier::FrontierPoint;

use super::{Fact, ReportError, Section, knob_table, percent};
use plots::PLAN_BUDGET;
pub(crate) use summary::SearchSummary;
use summary::mean_cost;

/// The section.
///
/// # Errors
/// When plotting fails.
pub(crate) fn search_section(summary: &SearchSummary) -> Result<Section, ReportError> {
    let SearchSummary { map, outcome, .. } = summary;
    let mut section = Section::new(&format!("{}: the search", map.scene.name));
    section.facts(&search_facts(summary));
    let (plan, legend) = plots::plan(summary);
    let influence = plots::influence(summary)?;
    section.plots(&[
        (
            &format!(
                "Cameras from above. Wedges are training cameras, in the colour of the settings selected there under an error budget of {PLAN_BUDGET} from a frontier fitted without that camera; rings are calibration cameras"
            ),
            plan,
        ),
        (
            "Mean error at equal mean power at the training cameras: settings by view (blue), from frontiers fitted without that view; the best constant (orange)",
            plots::equal_power(summary)?,
        ),
        ("Error of each knob lowered alone to its worst level, mean over the pilot cameras", influence),
        (
            "Calibrated error budgets: the predicted error at which the controller keeps each budget (blue); on the grey line predictions would need no correction",
            plots::calibration(summary)?,
        ),
    ]);
    section.legend(legend.iter().map(|(name, color)| (name.as_str(), *color)));
    let mut pool: Vec<FrontierPoint> = outcome
        .pool
        .iter()
        .filter_map(|settings| {
            Some(FrontierPoint { settings: *settings, cost: mean_cost(outcome, *settings)? })
        })
        .collect();
    pool.sort_by(|a, b| a.cost.power.0.total_cmp(&b.cost.power.0));
    let (headers, rows, shared) = knob_table(&map.knobs, &pool);
    section.table("The pool: mean costs at the training cameras", &headers, &rows);
    if !shared.is_empty() {
        section.paragraph(&format!("All of these have {shared}."));
    }
    Ok(section)
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
        (
            "Errors in play ÷ those of clips",
            format!("{:.2} at an error of 0.02", outcome.played.at(0.02)),
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

#[cfg(test)]
mod tests {
    use frugal_core::frontier::Bounds;
    use frugal_search::testing::searched;

    use super::*;
    use crate::inspect::testing::map_of;
    use crate::report::Report;

    #[test]
    fn a_search_is_described() {
        let (space, bounds, cameras, outcome) = searched();
        let map = map_of(&outcome, bounds, space);
        let counts = outcome.cameras;
        let summary = SearchSummary { map, outcome, cameras };
        let mut report = Report::new("search");
        report.section(search_section(&summary).expect("a section"));
        let html = report.render();
        for text in
            ["Without effect, at their cheapest", "idle", "Training cameras", "gi_pixel_fraction"]
        {
            assert!(html.contains(text), "{text}");
        }
        // A wedge for each training camera, and a ring for each calibration camera.
        assert_eq!(html.matches("<path d=\"M").count(), counts[0]);
        assert_eq!(
            html.matches("fill=\"none\" stroke=\"currentColor\" opacity=\"0.6\"").count(),
            counts[1]
        );
        assert!(!html.contains("NaN") && !html.contains("inf\""));
    }

    #[test]
    fn a_search_that_found_nothing_is_described_too() {
        let (space, _, _, mut outcome) = searched();
        outcome.pool.clear();
        outcome.training_cameras.clear();
        outcome.training = frugal_search::table::CostTable::new(0);
        outcome.fitted.shared = frugal_core::frontier::Frontier::default();
        outcome.fitted.held_out.clear();
        outcome.error_rates.0.clear();
        let map = map_of(&outcome, Bounds { min: [1.0; 3], max: [1.0; 3] }, space);
        let summary =
            SearchSummary { map, outcome, cameras: frugal_search::cameras::CameraSet::default() };
        let mut report = Report::new("search");
        report.section(search_section(&summary).expect("a section"));
        assert!(!report.render().contains("NaN"));
    }
}
