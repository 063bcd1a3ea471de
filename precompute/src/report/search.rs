//! The section on a search: cameras and what their addresses play, costs, influence of knobs,
//! regret at held-out cameras, calibration, effort.

use std::fmt::Write as _;

use bevy_frugal_gi::control::{Budget, select};
use bevy_frugal_gi::frontier::{Bounds, CostPoint, FrontierMap, FrontierPoint};
use bevy_frugal_gi::knobs::KnobLevels;
use bevy_frugal_gi::units::Watts;

use super::{
    Bar, Color, Curve, ReportError, Section, bars, cloud, curves, escape, knob_table, staircase,
};
use crate::cameras::{CameraSet, MovingCamera};
use crate::pipeline::Outcome;

/// The error budget under which the plan shows what addresses play.
const PLAN_BUDGET: f64 = 0.02;
/// Power budgets of the regret at held-out cameras, as shares of the range of power.
const REGRET_BUDGETS: [f64; 9] = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9];
/// Greatest number of settings with colours of their own in the plan.
const COLORS: usize = Color::SERIES.len();

/// A finished search.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SearchSummary<'a> {
    /// Its map.
    pub map: &'a FrontierMap,
    /// Its outcome.
    pub outcome: &'a Outcome,
    /// Its cameras.
    pub cameras: &'a CameraSet,
}

/// The section.
///
/// # Errors
/// When plotting fails.
pub(crate) fn search_section(summary: &SearchSummary<'_>) -> Result<Section, ReportError> {
    let SearchSummary { map, outcome, .. } = summary;
    let mut section = Section::new(&format!("{}: the search", map.scene.name));
    section.facts(&facts(summary));
    let (plan, legend) = plan(summary);
    let (influence, without) = influence(summary)?;
    section.plots(&[
        (
            &format!(
                "Cameras from above: what each training camera's frontier, with the camera held out, plays under an error budget of {PLAN_BUDGET}; rings are calibration cameras"
            ),
            plan,
        ),
        ("Costs of the pool at the training cameras, and the shared frontier", costs(summary)?),
        ("Greatest error of each knob lowered alone, mean over the pilot cameras", influence),
        (
            "Error under a power budget at held-out cameras, as a share of the least possible there: the map's selection, and the shared frontier's",
            regret(summary)?,
        ),
        (
            "Calibrated error budgets: the controller aims at this predicted error to keep each budget; the line is the prediction taken at its word",
            calibration(summary)?,
        ),
    ]);
    section.legend(legend.iter().map(|(name, color)| (name.as_str(), *color)));
    if !without.is_empty() {
        section.paragraph(&format!(
            "Without effect in this scene, fixed at their cheapest and not searched: {}.",
            without.join(", ")
        ));
    }
    let effort = outcome.stages.iter().map(|stage| {
        vec![
            stage.stage.clone(),
            stage.renderings.to_string(),
            format!("{:.1}", stage.seconds),
            format!("{:.3}", stage.seconds / stage.renderings.max(1) as f64),
        ]
    });
    section.table(
        "Effort of this run by stage; renderings of a resumed run are not counted",
        &["stage", "renderings", "seconds", "seconds each"],
        &effort.collect::<Vec<_>>(),
    );
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

fn facts(summary: &SearchSummary<'_>) -> Vec<(String, String)> {
    let outcome = summary.outcome;
    let report = &outcome.fitted.report;
    let percent = |share: f64| format!("{:.1} %", 100.0 * share);
    let (made, seconds) = outcome.effort;
    [
        (
            "Renderings",
            format!("{}, of them {made} in this run, {seconds:.0} s", outcome.renderings),
        ),
        ("Training cameras", outcome.cameras[0].to_string()),
        ("Calibration cameras", outcome.cameras[1].to_string()),
        ("Loss at held-out cameras", percent(report.octree_loss)),
        ("With one shared frontier", percent(report.shared_loss)),
        (
            "By depth of the octree",
            report.depth_losses.iter().map(|loss| percent(*loss)).collect::<Vec<_>>().join(", "),
        ),
        (
            "Error of the cost model at held-out readings",
            format!(
                "{} in the mean, {} at the 90th percentile",
                percent(outcome.cost_quality.mean_absolute_error),
                percent(outcome.cost_quality.ninth_decile)
            ),
        ),
        ("Noise floor: the best settings rendered twice", format!("{:.4}", outcome.noise)),
    ]
    .into_iter()
    .map(|(name, value)| (name.to_owned(), value))
    .collect()
}

/// Mean over the training cameras.
fn mean_cost(outcome: &Outcome, settings: KnobLevels) -> Option<CostPoint> {
    let table = &outcome.training;
    table.mean(table.column(settings)?, 0..table.rows())
}

fn training_cameras<'a>(
    summary: &SearchSummary<'a>,
) -> impl Iterator<Item = (usize, &'a MovingCamera)> + use<'a> {
    let (outcome, cameras) = (summary.outcome, summary.cameras);
    let cameras = outcome.training_cameras.iter().map(|camera| cameras.training.get(*camera));
    cameras.enumerate().filter_map(|(row, camera)| Some((row, camera?)))
}

fn selected(summary: &SearchSummary<'_>, row: usize, budget: &Budget) -> Option<KnobLevels> {
    let rate = budget.error.and_then(|error| summary.map.error_rates.rate(error));
    Some(select(summary.outcome.fitted.held_out.get(row)?, budget, rate)?.settings)
}

/// Cameras from above, each a wedge in its direction, and the legend of their colours.
fn plan(summary: &SearchSummary<'_>) -> (String, Vec<(String, Color)>) {
    let budget = Budget::error(PLAN_BUDGET);
    let played: Vec<(MovingCamera, Option<KnobLevels>)> = training_cameras(summary)
        .map(|(row, camera)| (*camera, selected(summary, row, &budget)))
        .collect();
    let mut counts: Vec<(KnobLevels, usize)> = Vec::new();
    for settings in played.iter().filter_map(|(_, settings)| *settings) {
        match counts.iter_mut().find(|(known, _)| *known == settings) {
            Some((_, count)) => *count += 1,
            None => counts.push((settings, 1)),
        }
    }
    counts.sort_by_key(|(settings, count)| (std::cmp::Reverse(*count), settings.bits()));
    let color = |settings: Option<KnobLevels>| {
        counts
            .iter()
            .take(COLORS)
            .position(|(known, _)| Some(*known) == settings)
            .map_or(Color::GREY, |rank| Color::SERIES[rank])
    };
    let legend = counts.iter().take(COLORS).enumerate().map(|(rank, (settings, count))| {
        let power = mean_cost(summary.outcome, *settings).map_or(f64::NAN, |cost| cost.power.0);
        (format!("{power:.2} W, {count} cameras"), Color::SERIES[rank])
    });
    let mut legend: Vec<_> = legend.collect();
    if counts.len() > COLORS {
        legend.push(("other settings".to_owned(), Color::GREY));
    }
    let mut svg = Plan::new(&summary.map.bounds);
    for camera in summary.cameras.calibration.iter().take(summary.outcome.cameras[1]) {
        svg.ring(camera);
    }
    for (camera, settings) in &played {
        svg.wedge(camera, color(*settings));
    }
    (svg.finish(), legend)
}

/// A plan of cameras, true to scale.
struct Plan {
    svg: String,
    low: [f64; 2],
    scale: f64,
}

impl Plan {
    const EDGE: f64 = 440.0;
    const MARGIN: f64 = 14.0;

    fn new(bounds: &Bounds) -> Self {
        let [low, high] = [bounds.min, bounds.max].map(|at| [f64::from(at[0]), f64::from(at[2])]);
        let size = [high[0] - low[0], high[1] - low[1]];
        let longer = size[0].max(size[1]);
        let scale = if longer > 0.0 && longer.is_finite() { Self::EDGE / longer } else { 0.0 };
        let [width, height] = size.map(|size| size.max(0.0) * scale + 2.0 * Self::MARGIN);
        let label = escape("Cameras from above");
        let svg = format!(
            "<svg role=\"img\" aria-label=\"{label}\" viewBox=\"0 0 {width:.1} {height:.1}\" style=\"max-width:{width:.0}px\">\n\
             <rect x=\"{0}\" y=\"{0}\" width=\"{1:.1}\" height=\"{2:.1}\" fill=\"none\" stroke=\"currentColor\" opacity=\"0.35\"/>\n",
            Self::MARGIN,
            width - 2.0 * Self::MARGIN,
            height - 2.0 * Self::MARGIN
        );
        Self { svg, low, scale }
    }

    fn at(&self, camera: &MovingCamera) -> [f64; 2] {
        let position = camera.pose.position;
        let along = |at: f32, low: f64| Self::MARGIN + (f64::from(at) - low) * self.scale;
        [along(position.x, self.low[0]), along(position.z, self.low[1])]
    }

    fn ring(&mut self, camera: &MovingCamera) {
        let [x, y] = self.at(camera);
        let _ = writeln!(
            self.svg,
            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"4\" fill=\"none\" stroke=\"currentColor\" opacity=\"0.6\"/>"
        );
    }

    fn wedge(&mut self, camera: &MovingCamera, color: Color) {
        let [x, y] = self.at(camera);
        let forward = camera.pose.forward();
        let angle = f64::from(forward.z).atan2(f64::from(forward.x));
        let tip = |turn: f64, length: f64| {
            [x + length * (angle + turn).cos(), y + length * (angle + turn).sin()]
        };
        let [a, b, c] = [tip(0.0, 9.0), tip(2.5, 5.0), tip(-2.5, 5.0)];
        let _ = writeln!(
            self.svg,
            "<path d=\"M{:.1} {:.1}L{:.1} {:.1}L{:.1} {:.1}Z\" fill=\"{}\"/>",
            a[0],
            a[1],
            b[0],
            b[1],
            c[0],
            c[1],
            color.css()
        );
    }

    fn finish(mut self) -> String {
        self.svg.push_str("</svg>");
        self.svg
    }
}

fn costs(summary: &SearchSummary<'_>) -> Result<String, ReportError> {
    let table = &summary.outcome.training;
    let points: Vec<(f64, f64)> = (0..table.settings().len())
        .flat_map(|column| (0..table.rows()).filter_map(move |row| table.at(row, column)))
        .map(|cost| (cost.power.0, cost.error))
        .collect();
    let shared =
        Curve { color: Color::BLUE, width: 2, points: staircase(&summary.outcome.fitted.shared) };
    cloud("Costs of the pool", ["power, W", "error, 1 − SSIM"], &points, &[shared])
}

/// A bar for each knob with effect, and the names of the others.
fn influence(summary: &SearchSummary<'_>) -> Result<(String, Vec<String>), ReportError> {
    let (space, screening) = (&summary.map.knobs, &summary.outcome.screening);
    let mut rows: Vec<Bar> = Vec::new();
    let mut without = Vec::new();
    for (index, knob) in space.knobs().iter().enumerate() {
        if screening.without_effect.contains(&index) {
            without.push(knob.name.clone());
            continue;
        }
        let value = screening.effects.get(index).into_iter().flatten().copied().fold(0.0, f64::max);
        rows.push(Bar { name: knob.name.clone(), value, color: Color::BLUE });
    }
    rows.sort_by(|a, b| b.value.total_cmp(&a.value).then_with(|| a.name.cmp(&b.name)));
    Ok((bars("Influence of knobs", "error, 1 − SSIM", &rows, 3, None)?, without))
}

/// Mean error of two selections at held-out cameras over that of the best selection, by budget.
fn regret(summary: &SearchSummary<'_>) -> Result<String, ReportError> {
    let outcome = summary.outcome;
    let table = &outcome.training;
    let mut ours = Curve { color: Color::BLUE, width: 2, points: Vec::new() };
    let mut shared = Curve { color: Color::GREY, width: 2, points: Vec::new() };
    let powers = outcome.fitted.shared.points();
    let Some((low, high)) = powers.first().zip(powers.last()) else {
        return curves("Regret", ["power budget, W", "share"], &[ours, shared], None);
    };
    for share in REGRET_BUDGETS {
        let watts = low.cost.power.0 + share * (high.cost.power.0 - low.cost.power.0);
        let budget = Budget::power(Watts(watts));
        let (mut least, mut picked, mut common) = (0.0, 0.0, 0.0);
        for (row, _) in training_cameras(summary) {
            let costs: Vec<CostPoint> = (0..table.settings().len())
                .filter_map(|column| table.at(row, column))
                .filter(|cost| cost.power.0 <= watts)
                .collect();
            let error = |settings: Option<KnobLevels>| Some(table.get(row, settings?)?.error);
            let one = select(&outcome.fitted.shared, &budget, None).map(|choice| choice.settings);
            let best = costs.iter().map(|cost| cost.error).fold(f64::INFINITY, f64::min);
            if let (Some(a), Some(b)) = (error(selected(summary, row, &budget)), error(one))
                && best.is_finite()
            {
                least += best;
                picked += a;
                common += b;
            }
        }
        if least > 0.0 {
            ours.points.push((watts, picked / least));
            shared.points.push((watts, common / least));
        }
    }
    curves(
        "Regret at held-out cameras",
        ["power budget, W", "error ÷ least"],
        &[ours, shared],
        Some(1.0),
    )
}

fn calibration(summary: &SearchSummary<'_>) -> Result<String, ReportError> {
    let known = summary.map.error_rates.0.iter();
    let points: Vec<(f64, f64)> =
        known.filter_map(|rate| Some((rate.budget, rate.predicted?))).collect();
    let straight = points.iter().map(|(budget, _)| (*budget, *budget)).collect();
    cloud(
        "Calibration of error budgets",
        ["error budget", "predicted error"],
        &[],
        &[
            Curve { color: Color::BLUE, width: 2, points },
            Curve { color: Color::GREY, width: 1, points: straight },
        ],
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipeline::tests::searched;
    use crate::report::Report;

    fn map(
        outcome: &Outcome,
        bounds: Bounds,
        knobs: bevy_frugal_gi::knobs::KnobSpace,
    ) -> FrontierMap {
        FrontierMap {
            shared: outcome.fitted.shared.clone(),
            error_rates: outcome.error_rates.clone(),
            knobs,
            bounds,
            octree: outcome.fitted.octree.clone(),
            ..crate::inspect::testing::map()
        }
    }

    #[test]
    fn a_search_is_described() {
        let (space, bounds, cameras, outcome) = searched();
        let map = map(&outcome, bounds, space);
        let summary = SearchSummary { map: &map, outcome: &outcome, cameras: &cameras };
        let mut report = Report::new("search");
        report.section(search_section(&summary).expect("a section"));
        let html = report.render();
        for text in [
            "fixed at their cheapest and not searched: idle.",
            "Training cameras",
            "screening",
            "proposals",
            "gi_pixel_fraction",
        ] {
            assert!(html.contains(text), "{text}");
        }
        // A wedge for each training camera, and a ring for each calibration camera.
        assert_eq!(html.matches("<path d=\"M").count(), outcome.cameras[0]);
        assert_eq!(
            html.matches("fill=\"none\" stroke=\"currentColor\" opacity=\"0.6\"").count(),
            outcome.cameras[1]
        );
        assert!(!html.contains("NaN") && !html.contains("inf\""));
    }

    #[test]
    fn a_search_that_found_nothing_is_described_too() {
        let (space, _, _, mut outcome) = searched();
        outcome.pool.clear();
        outcome.training_cameras.clear();
        outcome.training = crate::table::CostTable::new(0);
        outcome.fitted.shared = bevy_frugal_gi::frontier::Frontier::default();
        outcome.fitted.held_out.clear();
        outcome.error_rates.0.clear();
        outcome.stages.clear();
        let map = map(&outcome, Bounds { min: [1.0; 3], max: [1.0; 3] }, space);
        let cameras = CameraSet::default();
        let summary = SearchSummary { map: &map, outcome: &outcome, cameras: &cameras };
        let mut report = Report::new("search");
        report.section(search_section(&summary).expect("a section"));
        assert!(!report.render().contains("NaN"));
    }
}
