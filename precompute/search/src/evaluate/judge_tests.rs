//! Comparisons on a record of known power and error.

use frugal_core::frontier::{CostPoint, Frontier, FrontierPoint};

use super::*;
use crate::testing::formula::{error, judged, map, power, recorded, space, trial};

fn run<'a>(result: &'a EvaluationResult, name: &str) -> &'a RunResult {
    result.runs.iter().find(|run| run.name == name).unwrap()
}

/// Mean of x over the path is 0.9 m.
const ALONG: f64 = 0.009;

#[test]
fn every_run_is_listed_in_order() {
    let map = map(space());
    let budget = BudgetRequest { error: Some(0.05), ..Default::default() };
    let names = |baselines| {
        let result = trial(&recorded(&map, baselines), &map, baselines).judge(&budget);
        assert_eq!((result.frames, result.size, result.warnings.len()), (10, [16, 12], 1));
        result.runs.into_iter().map(|run| run.name).collect::<Vec<_>>()
    };
    let quick = ["frugal", "maximum", "max-mid", "mid-min", "minimum", "resolution-only", TRAINED];
    assert_eq!(names(Baselines::Quick), quick);
    assert_eq!(names(Baselines::None), ["frugal"]);
    let all = names(Baselines::All);
    for name in quick.into_iter().chain([
        "frugal-measured",
        "default",
        "best-constant",
        "mixed-constants",
        "shared-frontier",
    ]) {
        assert!(all.iter().any(|run| run == name), "{name}: {all:?}");
    }
    assert_eq!(all[all.len() - 3..], ["oracle", "oracle-filtered", "reactive"]);
}

#[test]
fn power_and_error_are_the_formulas() {
    let (result, space) = (judged(Some("60%"), None), space());
    let presets =
        [("maximum", 1.0), ("max-mid", 2.0 / 3.0), ("mid-min", 1.0 / 3.0), ("minimum", 0.0)];
    for (name, share) in presets {
        let (run, settings) = (run(&result, name), space.preset(share));
        assert!((run.mean_power_w.0 - power(settings) - ALONG).abs() < 1e-9, "{name}");
        assert!((run.mean_error - error(settings)).abs() < 1e-7, "{name}: {}", run.mean_error);
        assert_eq!((&run.settings, run.switches), (&Some(space.describe(settings)), 0));
    }
    assert_eq!(run(&result, "maximum").max_error, 0.0);
    // From 1 W to 4.2 W, and what the path adds.
    assert!((result.budget.power_w.unwrap().0 - (1.0 + 0.6 * 3.2 + ALONG)).abs() < 1e-9);
}

#[test]
fn the_controller_keeps_the_budget_and_the_baseline_takes_the_highest_resolution_that_does() {
    let result = judged(Some("3.5 W"), None);
    let frugal = run(&result, "frugal");
    assert!(frugal.met && frugal.windows_over == Some(0.0));
    assert!((3.4..3.55).contains(&frugal.mean_power_w.0), "{:?}", frugal.mean_power_w);
    // 2.2 W + 0.4 W a level: level 3 takes 3.4 W.
    let baseline = run(&result, "resolution-only");
    assert_eq!(
        baseline.settings.as_deref(),
        Some("gi_vpl_count=64,resolution_scale=80%,antialiasing=FXAA")
    );
    assert!(baseline.met && baseline.note.is_none());
    let maximum = run(&result, "maximum");
    assert!(!maximum.met && maximum.frames_over_budget == maximum.series.len());
}

#[test]
fn a_meter_corrects_a_map_that_predicts_too_little_power() {
    let mut map = map(space());
    let record = recorded(&map, Baselines::None);
    let cheaper = |point: &FrontierPoint| FrontierPoint {
        settings: point.settings,
        cost: CostPoint::new(0.9 * point.cost.power.0, point.cost.error),
    };
    map.shared = Frontier::from_points(map.shared.points().iter().map(cheaper));
    map.octree = frugal_core::testing::cube(vec![map.shared.clone()]);
    let budget =
        BudgetRequest { power: Some(PowerBudget::Power(Watts(3.5))), ..Default::default() };
    let trial = trial(&record, &map, Baselines::None);
    let frugal = trial.judge(&budget).runs.remove(0);
    assert!((3.4..3.55).contains(&frugal.mean_power_w.0), "{:?}", frugal.mean_power_w);
    let mut unmetered = trial.controller(&budget.resolve(Watts(0.0), Watts(0.0)));
    let mut decide = |frame: usize, dt: f64, pose: &Pose| unmetered.decide(frame, dt, pose);
    let over = mean_power(&record.simulate_for(&mut decide, 60.0)).0;
    assert!(over > 3.6, "{over}");
}

#[test]
fn an_error_budget_finds_the_lowest_resolution_that_keeps_it() {
    let at = |level| error(space().highest().with_level(1, level));
    let result = judged(None, Some(at(2) + 1e-6));
    let baseline = run(&result, "resolution-only");
    assert_eq!(
        baseline.settings.as_deref(),
        Some("gi_vpl_count=64,resolution_scale=70%,antialiasing=FXAA")
    );
    assert!(baseline.met && baseline.windows_over.is_none());
    assert_eq!(result.budget.power_w, None);
}

#[test]
fn a_budget_that_no_resolution_meets_gives_the_closest_and_says_so() {
    let result = judged(Some("1.5W"), None);
    let baseline = run(&result, "resolution-only");
    assert_eq!(
        baseline.settings.as_deref(),
        Some("gi_vpl_count=64,resolution_scale=50%,antialiasing=FXAA")
    );
    assert!(!baseline.met && baseline.note.as_deref().unwrap().contains("closest"));
    // 2.2 W: within the 2 % that every run may exceed the budget by.
    let near = judged(Some("2.18W"), None);
    let baseline = run(&near, "resolution-only");
    assert!(baseline.met && baseline.note.is_none(), "{:?}", baseline.note);
    let wide = judged(Some("100W"), None);
    assert_eq!(run(&wide, "resolution-only").series, run(&wide, "maximum").series);
}

#[test]
fn the_trained_constant_is_chosen_by_other_cameras_and_played_here() {
    let mut map = map(space());
    // As if errors elsewhere were higher: a budget of twice the error takes what is within it there.
    let dearer = |point: &FrontierPoint| FrontierPoint {
        settings: point.settings,
        cost: CostPoint::new(point.cost.power.0, 2.0 * point.cost.error),
    };
    map.shared = Frontier::from_points(map.shared.points().iter().map(dearer));
    let at = error(space().highest().with_level(1, 3));
    let budget = BudgetRequest { error: Some(2.0 * at + 1e-6), ..Default::default() };
    let record = recorded(&map, Baselines::Quick);
    let result = trial(&record, &map, Baselines::Quick).judge(&budget);
    let constant = run(&result, TRAINED);
    assert!(constant.mean_error <= at + 1e-6 && constant.met, "{constant:?}");
    let expected = map.shared.least_power_within(2.0 * at + 1e-6).expect("a point");
    assert_eq!(constant.settings, Some(space().describe(expected.settings)));
    assert!(constant.note.as_deref().is_some_and(|note| note.contains("training")));
}

#[test]
fn the_oracle_is_no_worse_than_the_best_constant() {
    let map = map(space());
    let budget = BudgetRequest { power: Some(PowerBudget::Share(0.5)), ..Default::default() };
    let record = recorded(&map, Baselines::All);
    let result = trial(&record, &map, Baselines::All).judge(&budget);
    let [oracle, constant] = ["oracle", "best-constant"].map(|name| run(&result, name).mean_error);
    assert!(oracle <= constant + 1e-9, "{oracle} {constant}");
}

#[test]
fn json_has_the_agreed_form_and_reads_back() {
    let result = judged(Some("3.5W"), None);
    let json = serde_json::to_value(&result).unwrap();
    assert_eq!((json["fps"].as_i64(), json["frames"].as_i64()), (Some(5), Some(10)));
    assert_eq!(
        (&json["meter"]["name"], &json["meter"]["provenance"]),
        (&"formula".into(), &"modelled".into())
    );
    assert_eq!(
        json["budget"],
        serde_json::json!({"power_w": 3.5, "error": null, "horizon_s": 30.0})
    );
    assert_eq!(json["size"], serde_json::json!([16, 12]));
    assert_eq!(json["drift"]["relative"], serde_json::json!(0.0));
    for key in ["name", "mean_power_w", "mean_error", "max_error", "frames_over_budget", "switches"]
    {
        assert!(!json["runs"][0][key].is_null(), "{key}");
    }
    assert_eq!(json["runs"].as_array().unwrap().len(), 7);
    let back: EvaluationResult = serde_json::from_value(json).unwrap();
    assert_eq!((back.runs[2].name.as_str(), back.runs[2].series.len()), ("max-mid", 0));
    assert_eq!(back.runs[6].name, TRAINED);
}

#[test]
fn a_scene_without_a_resolution_knob_has_no_such_run() {
    // Without the knob the fake's second knob is `antialiasing`; only the list of runs matters
    // here.
    let map = map(space().subset(["gi_vpl_count", "antialiasing"]).unwrap());
    let record = recorded(&map, Baselines::Quick);
    let result = trial(&record, &map, Baselines::Quick).judge(&BudgetRequest::default());
    assert_eq!(result.runs.len(), 6);
    assert!(result.warnings.iter().any(|warning| warning.contains("resolution_scale")));
}
