//! Formulas of 340 combinations of four knobs, at cameras that differ in the error of each knob.

use std::ops::ControlFlow;

use bevy_frugal_gi::frontier::{CostPoint, FrontierPoint};
use bevy_frugal_gi::knobs::{KnobLevels, KnobSpace};

use super::*;
use crate::cost::{FrameLayout, Work, work_names};
use crate::table::{SweepFacts, SweepTable};

const LAYOUT: FrameLayout =
    FrameLayout { size: [128, 72], maps: 1, point_lights: 0, has_sky: true };

fn space() -> KnobSpace {
    let names = ["gi_vpl_count", "gi_pixel_fraction", "gi_visibility", "shadow_map_resolution"];
    crate::stage::every_knob()
        .and_then(|space| Ok(space.subset(names)?))
        .expect("the built-in knobs")
}

/// Watts by fixed prices of work.
fn power(space: &KnobSpace, settings: KnobLevels) -> f64 {
    let price = |name: &str| match name {
        "frame" => 2.0,
        "rays" => 4e-5,
        "pairs" => 6e-7,
        "shadow texels" => 2e-7,
        "gathered pixels" => 1e-4,
        _ => 1e-9,
    };
    work_names(space)
        .iter()
        .zip(&Work::of(space, settings, &LAYOUT).0)
        .map(|(name, work)| work * price(name))
        .sum()
}

/// Errors of knobs are multiplicative; `weights` are the camera's.
fn error(space: &KnobSpace, settings: KnobLevels, weights: [f64; 4]) -> f64 {
    let kept = (0..4).map(|knob| {
        let top = space.knobs()[knob].levels.len() - 1;
        let missing = (top - settings.level(knob)) as f64 / top as f64;
        1.0 - weights[knob] * missing.powf(1.5 + 0.5 * knob as f64)
    });
    1.0 - kept.product::<f64>()
}

fn table(weights: [f64; 4], factor: f64) -> SweepTable {
    let space = space();
    let point = |settings| {
        let cost = CostPoint::new(
            factor * power(&space, settings),
            0.002 + error(&space, settings, weights),
        );
        FrontierPoint { settings, cost }
    };
    SweepTable {
        facts: SweepFacts::default(),
        points: space.iter().map(point).collect(),
        space: space.clone(),
    }
}

fn here() -> SweepTable {
    table([0.12, 0.05, 0.03, 0.06], 1.0)
}

fn elsewhere() -> Vec<SweepTable> {
    vec![
        table([0.2, 0.04, 0.03, 0.03], 1.3),
        table([0.08, 0.06, 0.05, 0.06], 0.8),
        table([0.15, 0.08, 0.02, 0.09], 1.1),
    ]
}

fn runs() -> SearchRuns {
    SearchRuns { errors: vec![0.01, 0.02, 0.04], within: 0.05, seeds: 11, batch: 8 }
}

fn search(recorded: &Recorded, runs: &SearchRuns) -> Vec<MethodResult> {
    let goals = runs.goals(recorded).expect("errors that occur");
    run(recorded, runs, &goals, &|| ControlFlow::Continue(())).expect("not stopped")
}

fn median(results: &[MethodResult], method: Method, goal: usize) -> f64 {
    let result = results.iter().find(|result| result.method == method).expect("was run");
    result.goals[goal].spread.median.unwrap_or(f64::INFINITY)
}

#[test]
fn ours_needs_fewer_renderings_than_chance_and_fewer_still_where_other_cameras_are_known() {
    let recorded = Recorded::new(&here(), &elsewhere()).expect("tables that fit");
    assert_eq!(
        (recorded.costs.len() as u64, recorded.others.rows()),
        (recorded.space.combinations(), 3)
    );
    let results = search(&recorded, &runs());
    for goal in 0..3 {
        let [random, nsga2, cold, warm] =
            [Method::Random, Method::Nsga2, Method::FrugalCold, Method::FrugalWarm]
                .map(|method| median(&results, method, goal));
        assert!(
            cold < random && warm <= cold,
            "goal {goal}: random {random}, NSGA-II {nsga2}, cold {cold}, warm {warm}"
        );
    }
    assert!(results.iter().all(|result| result.missing == 0), "the table is whole");
}

#[test]
fn seeds_decide_everything() {
    let recorded = Recorded::new(&here(), &elsewhere()).expect("tables that fit");
    let few = SearchRuns { seeds: 3, ..runs() };
    let (once, again) = (search(&recorded, &few), search(&recorded, &few));
    assert_eq!(once, again);
    let random = &once[0].goals[0].renderings;
    assert!(random.windows(2).any(|two| two[0] != two[1]), "seeds differ: {random:?}");
}

#[test]
fn missing_combinations_of_a_partial_table_are_counted_and_never_chosen() {
    let mut part = here();
    // Neither the best settings nor every other one.
    part.points
        .retain(|point| point.settings != space().highest() && point.settings.bits() % 3 != 0);
    let held = part.points.len();
    let recorded = Recorded::new(&part, &elsewhere()).expect("tables that fit");
    let runs = SearchRuns { seeds: 3, errors: vec![0.04], ..runs() };
    for result in search(&recorded, &runs) {
        assert_eq!(result.missing == 0, result.method == Method::Random, "{result:?}");
        assert!(
            result.goals[0].renderings.iter().flatten().all(|count| (1..=held).contains(count)),
            "{result:?}"
        );
    }
}

#[test]
fn errors_that_no_settings_have_and_an_interrupt_are_no_result() {
    let recorded = Recorded::new(&here(), &[]).expect("a table");
    let unreachable = SearchRuns { errors: vec![0.001], ..runs() }
        .goals(&recorded)
        .expect_err("less than the least");
    assert!(unreachable.to_string().contains("0.0020"), "{unreachable}");
    let goals = runs().goals(&recorded).expect("errors that occur");
    assert_eq!(run(&recorded, &runs(), &goals, &|| ControlFlow::Break(())), None);
    // Without other cameras nothing is warm.
    let once = SearchRuns { seeds: 1, ..runs() };
    assert_eq!(search(&recorded, &once).len(), 3);
}
