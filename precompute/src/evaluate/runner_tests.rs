//! Evaluations with a frame renderer of known power and error.

use std::ops::ControlFlow;

use bevy_frugal_gi::frontier::{CostPoint, Frontier, FrontierPoint};
use bevy_frugal_gi::units::Watts;

use super::*;
use crate::evaluate::fake::{Fake, error, meter, path, power, space};
use crate::evaluate::{Choice, Controlled};

fn evaluated(
    renderer: &mut Fake,
    power: Option<&str>,
    error: Option<f64>,
) -> Result<Evaluation, EvaluationError<std::fmt::Error>> {
    let (space, path) = (space(), path());
    let budget = BudgetRequest { power: power.map(|text| text.parse().unwrap()), error };
    let plan = EvaluationPlan {
        scene: "fake",
        space: &space,
        path: &path,
        meter: meter(),
        budget,
        trained: None,
        keep_frames: &[0, 7, 99],
    };
    let frontier = frontier(&space);
    let controller = move |budget: &ResolvedBudget| -> Box<dyn Policy> {
        let budget = *budget;
        Box::new(Controlled(move |_: usize, dt: f64, _: &crate::evaluate::Pose| {
            assert!((dt - 0.2).abs() < 1e-12);
            let point = match (budget.power_w, budget.error) {
                (Some(limit), _) => frontier.least_error_within(limit),
                (None, limit) => frontier.least_power_within(limit.unwrap_or(0.0)),
            };
            let point = point.or(frontier.points().first()).unwrap();
            Choice { settings: point.settings, target: point.settings, predicted: Some(point.cost) }
        }))
    };
    evaluate(renderer, &plan, controller, &mut |_| ControlFlow::Continue(()))
}

fn frontier(space: &KnobSpace) -> Frontier {
    let point = |settings| FrontierPoint {
        settings,
        cost: CostPoint::new(power(settings), error(settings)),
    };
    Frontier::from_points(space.iter().map(point))
}

fn run<'a>(evaluation: &'a Evaluation, name: &str) -> &'a RunResult {
    evaluation.result.runs.iter().find(|run| run.name == name).unwrap()
}

/// Mean of x over the path is 0.9 m.
const ALONG: f64 = 0.009;

#[test]
fn every_run_is_played_and_listed_in_order() {
    let mut renderer = Fake::default();
    let evaluation = evaluated(&mut renderer, Some("60%"), None).unwrap();
    let names: Vec<_> = evaluation.result.runs.iter().map(|run| run.name.as_str()).collect();
    assert_eq!(names, ["frugal", "maximum", "max-mid", "mid-min", "minimum", "resolution-only"]);
    assert_eq!(renderer.runs[..5], ["maximum", "minimum", "frugal", "max-mid", "mid-min"]);
    assert_eq!(renderer.runs.last().unwrap(), "maximum again");
    assert_eq!((evaluation.result.frames, evaluation.result.size), (10, [16, 12]));
    assert!(evaluation.result.warnings.is_empty(), "{:?}", evaluation.result.warnings);
}

#[test]
fn power_and_error_are_the_formulas() {
    let evaluation = evaluated(&mut Fake::default(), Some("60%"), None).unwrap();
    let space = space();
    let presets =
        [("maximum", 1.0), ("max-mid", 2.0 / 3.0), ("mid-min", 1.0 / 3.0), ("minimum", 0.0)];
    for (name, share) in presets {
        let (run, settings) = (run(&evaluation, name), space.preset(share));
        assert!((run.mean_power_w.0 - power(settings) - ALONG).abs() < 1e-9, "{name}");
        assert!(
            (run.mean_error - error(settings)).abs() < 1e-7,
            "{name}: {} is not {}",
            run.mean_error,
            error(settings)
        );
        assert_eq!(run.settings, Some(space.describe(settings)));
        assert_eq!(run.switches, 0);
    }
    assert_eq!(run(&evaluation, "maximum").max_error, 0.0);
    // From 1 W to 4.2 W, and what the path adds.
    assert!((evaluation.result.budget.power_w.unwrap().0 - (1.0 + 0.6 * 3.2 + ALONG)).abs() < 1e-9);
}

#[test]
fn the_controller_keeps_the_budget_and_the_baseline_takes_the_highest_resolution_that_does() {
    let evaluation = evaluated(&mut Fake::default(), Some("3.5 W"), None).unwrap();
    let frugal = run(&evaluation, "frugal");
    assert!(frugal.met && frugal.frames_over_budget == 0);
    assert_eq!(frugal.series[3].predicted.unwrap().power, Watts(power(frugal.series[3].settings)));
    // 2.2 W + 0.4 W a level: level 3 takes 3.4 W.
    let baseline = run(&evaluation, "resolution-only");
    assert_eq!(
        baseline.settings.as_deref(),
        Some("gi_vpl_count=64,resolution_scale=80%,antialiasing=FXAA")
    );
    assert!(baseline.met && baseline.note.is_none());
    assert!(
        !run(&evaluation, "maximum").met && run(&evaluation, "maximum").frames_over_budget == 10
    );
    assert!((run(&evaluation, "maximum").p99_overshoot_w.unwrap().0 - 0.7).abs() < 0.02);
}

#[test]
fn an_error_budget_finds_the_lowest_resolution_that_keeps_it() {
    let space = space();
    let at = |level| error(space.highest().with_level(1, level));
    let evaluation = evaluated(&mut Fake::default(), None, Some(at(2) + 1e-6)).unwrap();
    let baseline = run(&evaluation, "resolution-only");
    assert_eq!(
        baseline.settings.as_deref(),
        Some("gi_vpl_count=64,resolution_scale=70%,antialiasing=FXAA")
    );
    assert!(baseline.met && baseline.p99_overshoot_w.is_none());
    assert_eq!(evaluation.result.budget.power_w, None);
}

#[test]
fn a_budget_that_no_resolution_meets_gives_the_closest_and_says_so() {
    let evaluation = evaluated(&mut Fake::default(), Some("1.5W"), None).unwrap();
    let baseline = run(&evaluation, "resolution-only");
    assert_eq!(
        baseline.settings.as_deref(),
        Some("gi_vpl_count=64,resolution_scale=50%,antialiasing=FXAA")
    );
    assert!(!baseline.met && baseline.note.as_deref().unwrap().contains("closest"));
}

#[test]
fn a_wide_budget_needs_no_other_resolution() {
    let mut renderer = Fake::default();
    let evaluation = evaluated(&mut renderer, Some("100W"), None).unwrap();
    assert_eq!(run(&evaluation, "resolution-only").series, run(&evaluation, "maximum").series);
    assert!(!renderer.runs.iter().any(|run| run == "resolution-only"));
    let of = |name: &str| {
        evaluation
            .pictures
            .iter()
            .filter(|picture| picture.run == name)
            .map(|picture| picture.frame)
            .collect::<Vec<_>>()
    };
    assert_eq!(of("resolution-only"), [0, 7]);
    assert_eq!(of("frugal"), [0, 7], "frames beyond the path are ignored");
}

#[test]
fn drift_is_found_and_warned_of() {
    let mut renderer = Fake { drift: 0.1, ..Fake::default() };
    let evaluation = evaluated(&mut renderer, Some("60%"), None).unwrap();
    let last = (renderer.runs.len() - 1) as f64;
    assert!((evaluation.result.drift.relative - 0.1 * last / (4.2 + ALONG)).abs() < 1e-9);
    assert_eq!(evaluation.result.drift.repeat_max_error, 0.0);
    assert!(evaluation.result.warnings[0].contains("the machine's"));
}

#[test]
fn impossible_power_and_interruption_end_it() {
    let broken =
        evaluated(&mut Fake { broken_at: Some(13), ..Fake::default() }, None, None).unwrap_err();
    assert_eq!(broken.to_string(), "run `minimum`, frame 3: the meter gave NaN W");
    let (space, path) = (space(), path());
    let plan = EvaluationPlan {
        scene: "",
        space: &space,
        path: &path,
        meter: meter(),
        budget: BudgetRequest::default(),
        trained: None,
        keep_frames: &[],
    };
    let mut seen = Vec::new();
    let stopped = evaluate(
        &mut Fake::default(),
        &plan,
        |_| Box::new(Fixed(space.lowest())),
        &mut |progress| {
            seen.push((progress.run.to_owned(), progress.frames_done));
            assert!(progress.frames_done <= progress.frames_total);
            if progress.frames_done == 25 {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        },
    );
    assert!(matches!(stopped, Err(EvaluationError::Interrupted)));
    assert_eq!(seen.last().unwrap(), &("frugal".to_owned(), 25));
}

#[test]
fn the_best_constant_is_chosen_by_other_cameras_and_played_here() {
    let (space, path) = (space(), path());
    // As if errors elsewhere were higher: a budget of twice the error takes what is within it there.
    let dearer = |point: &FrontierPoint| FrontierPoint {
        settings: point.settings,
        cost: CostPoint::new(point.cost.power.0, 2.0 * point.cost.error),
    };
    let trained = Frontier::from_points(frontier(&space).points().iter().map(dearer));
    let at = error(space.highest().with_level(1, 3));
    let plan = EvaluationPlan {
        scene: "",
        space: &space,
        path: &path,
        meter: meter(),
        budget: BudgetRequest { power: None, error: Some(2.0 * at + 1e-6) },
        trained: Some(&trained),
        keep_frames: &[],
    };
    let mut most = 0;
    let evaluation = evaluate(
        &mut Fake::default(),
        &plan,
        |_| Box::new(Fixed(space.highest())),
        &mut |progress| {
            most = most.max(progress.frames_done);
            assert!(progress.frames_done <= progress.frames_total);
            ControlFlow::Continue(())
        },
    )
    .unwrap();
    let constant = run(&evaluation, "best-constant-elsewhere");
    assert!(constant.mean_error <= at + 1e-6 && constant.met, "{constant:?}");
    let expected = trained.least_power_within(2.0 * at + 1e-6).expect("a point");
    assert_eq!(constant.settings, Some(space.describe(expected.settings)));
    assert!(constant.note.as_deref().is_some_and(|note| note.contains("training")));
    assert!(most > 70, "its frames count: {most}");
}

#[test]
fn progress_never_exceeds_its_total() {
    let (space, path) = (space(), path());
    for watts in [0.5, 1.5, 2.3, 2.7, 3.1, 3.5, 3.9, 9.0] {
        let budget = BudgetRequest { power: Some(PowerBudget::Power(Watts(watts))), error: None };
        let plan = EvaluationPlan {
            scene: "",
            space: &space,
            path: &path,
            meter: meter(),
            budget,
            trained: None,
            keep_frames: &[],
        };
        let done = evaluate(
            &mut Fake::default(),
            &plan,
            |_| Box::new(Fixed(space.lowest())),
            &mut |progress| {
                assert!(progress.frames_done <= progress.frames_total);
                ControlFlow::Continue(())
            },
        );
        assert!(done.is_ok());
    }
}

#[test]
fn json_has_the_agreed_form_and_reads_back() {
    let evaluation = evaluated(&mut Fake::default(), Some("3.5W"), None).unwrap();
    let json = serde_json::to_value(&evaluation.result).unwrap();
    assert_eq!((json["fps"].as_i64(), json["frames"].as_i64()), (Some(5), Some(10)));
    assert_eq!(
        (&json["meter"]["name"], &json["meter"]["provenance"]),
        (&"formula".into(), &"modelled".into())
    );
    assert_eq!(json["budget"], serde_json::json!({"power_w": 3.5, "error": null}));
    assert_eq!(json["size"], serde_json::json!([16, 12]));
    for key in ["name", "mean_power_w", "mean_error", "max_error", "frames_over_budget", "switches"]
    {
        assert!(!json["runs"][0][key].is_null(), "{key}");
    }
    assert_eq!(json["runs"].as_array().unwrap().len(), 6);
    let back: EvaluationResult = serde_json::from_value(json).unwrap();
    assert_eq!((back.runs[2].name.as_str(), back.runs[2].series.len()), ("max-mid", 0));
}

#[test]
fn a_scene_without_a_resolution_knob_has_no_such_run() {
    let (all, path) = (space(), path());
    // Without the knob the fake's second knob is `antialiasing`; only the list of runs matters
    // here.
    let space = all.subset(["gi_vpl_count", "antialiasing"]).unwrap();
    let plan = EvaluationPlan {
        scene: "",
        space: &space,
        path: &path,
        meter: meter(),
        budget: BudgetRequest::default(),
        trained: None,
        keep_frames: &[],
    };
    let evaluation =
        evaluate(&mut Fake::default(), &plan, |_| Box::new(Fixed(space.lowest())), &mut |_| {
            ControlFlow::Continue(())
        })
        .unwrap();
    assert_eq!(evaluation.result.runs.len(), 5);
    assert!(evaluation.result.warnings[0].contains("resolution_scale"));
}
