//! Tests of the HUD's text.

use std::sync::Arc;
use std::time::Duration;

use bevy_frugal_gi::control::{Limit, OffReason, Outcome};
use bevy_frugal_gi::power::{MeterInfo, Provenance};
use bevy_frugal_gi::units::Joules;

use super::*;
use crate::testing::{self, changed};

fn active(outcome: Outcome) -> Selection {
    changed(Selection::default(), |it| {
        it.status = ControlStatus::Active(outcome);
        it.predicted = Some(CostPoint::new(2.0, 0.05));
        it.predicted_applied = it.predicted;
    })
}

#[test]
fn a_summary_has_budget_outcome_and_cost() {
    let (selection, budget) = (active(Outcome::Met), Budget::both(Watts(7.5), 0.06));
    let facts = Facts { selection: Some(&selection), budget: Some(&budget), ..Default::default() };
    assert_eq!(
        facts.summary(),
        "budget    7.50 W, error 0.0600\noutcome   met\npredicted 2.00 W, error 0.0500"
    );
    let selection = changed(active(Outcome::Settling), |it| {
        it.predicted = Some(CostPoint::new(4.0, 0.0));
    });
    let facts = Facts { selection: Some(&selection), name: Some("left"), ..facts };
    let text = facts.summary();
    assert!(text.starts_with("left\nbudget"), "{text}");
    assert!(text.contains("outcome   settling\n"), "{text}");
    assert!(text.ends_with("target    4.00 W, error 0.0000"), "{text}");
}

#[test]
fn cameras_without_a_map_or_a_meter_say_so() {
    let outcome = |selection: &Selection| {
        Facts { selection: Some(selection), ..Default::default() }.summary()
    };
    assert!(Facts::default().summary().contains("settings by hand"));
    assert!(outcome(&Selection::default()).ends_with("outcome   waiting for the map"));
    let off = ControlStatus::Off(OffReason::MapNotLoaded);
    let text = outcome(&changed(Selection::default(), |it| it.status = off));
    assert!(text.ends_with("outcome   off: map not loaded"), "{text}");
    assert_eq!(caption(None, PowerCorrection::default()), "no frontier");
    assert_eq!(caption(Some(&Frontier::default()), PowerCorrection::default()), "no frontier");
    assert_eq!(Facts::default().knobs(), "");

    let metered = |state, mean, info| {
        let facts = |it: &mut MeteredPower| (it.state, it.mean, it.info) = (state, mean, info);
        power(&changed(MeteredPower::default(), facts))
    };
    assert_eq!(metered(MeterState::Starting, None, None), "not yet");
    let text = metered(MeterState::Unavailable { reason: "no counter".into() }, None, None);
    assert_eq!(text, "unknown: no counter");
    let info = MeterInfo {
        name: "nvml".into(),
        provenance: Provenance::Measured,
        description: String::new(),
    };
    let text = metered(MeterState::Running, Some(Watts(12.345)), Some(info));
    assert_eq!(text, "12.35 W, measured (nvml)");
}

#[test]
fn feedback_has_its_uncertainty() {
    let mut feedback = PowerFeedback::default();
    assert_eq!(correction(&feedback), None);
    feedback.state = FeedbackState::Waiting;
    assert_eq!(correction(&feedback).as_deref(), Some("waiting for a reading"));
    feedback.state = FeedbackState::Running;
    feedback.correction = PowerCorrection { gain: 1.25, offset: Watts(0.5) };
    assert_eq!(correction(&feedback).as_deref(), Some("map x 1.25 + 0.50 W"));
    feedback.deviation = Some(Watts(0.4));
    feedback.state = FeedbackState::Held;
    let text = "meter lost, map x 1.25 + 0.50 W, +-0.40 W";
    assert_eq!(correction(&feedback).as_deref(), Some(text));
    let selection = active(Outcome::Met);
    let facts = Facts { feedback: Some(&feedback), ..Default::default() };
    assert!(!facts.summary().contains("feedback"), "no prediction to correct");
    let facts = Facts { selection: Some(&selection), ..facts };
    assert!(facts.summary().ends_with(text));
    let mut changed = feedback;
    changed.has_left_map = true;
    let facts = Facts { feedback: Some(&changed), ..facts };
    assert!(facts.summary().contains("the scene has changed"));
}

#[test]
fn a_measured_error_stands_beside_the_predicted_one() {
    let selection = active(Outcome::Met);
    let mut measured = MeasuredError::default();
    let text = |measured: &MeasuredError| {
        let facts =
            Facts { selection: Some(&selection), measured: Some(measured), ..Default::default() };
        facts.summary()
    };
    assert!(!text(&measured).contains("measured"), "nothing is yet");
    measured = MeasuredError { last: Some(0.021_34), count: 3 };
    assert!(text(&measured).ends_with("measured  error 0.0213, number 3"));
}

#[test]
fn what_a_level_saves_and_costs_alone_stands_beside_it() {
    let settings = KnobLevels::default().with_level(0, 1).with_level(1, 2);
    let settings = KnobSettings { space: Arc::new(testing::space()), settings };
    let effects = KnobEffects {
        joules: vec![vec![0.08, 0.06, 0.04, 0.02, 0.0], vec![0.02, 0.01, 0.0]],
        errors: vec![vec![0.1, 0.05, 0.02, 0.01, 0.0], vec![0.2, 0.1, 0.0]],
    };
    let facts =
        Facts { settings: Some(&settings), effects: Some((&effects, 30.0)), ..Default::default() };
    let text = facts.knobs();
    let lines: Vec<&str> = text.lines().collect();
    assert!(lines[0].ends_with("-1.80 W, error +0.0500"), "{text}");
    assert!(lines[1].ends_with("  1"), "the best level: {text}");
    // Effects of other knobs are none of these.
    let other = KnobEffects { joules: vec![vec![0.1]], errors: vec![] };
    let facts = Facts { effects: Some((&other, 30.0)), ..facts };
    assert!(!facts.knobs().contains('W'));
}

#[test]
fn numbers_at_extremes_stay_short() {
    let cases = [
        (f64::NAN, "?"),
        (f64::INFINITY, "inf"),
        (f64::NEG_INFINITY, "-inf"),
        (0.0, "0.00"),
        (-3.456, "-3.46"),
        (99_999.0, "99999.00"),
        (1e300, "1.0e300"),
        (-2.5e7, "-2.5e7"),
        (1e-300, "0.00"),
    ];
    for (value, text) in cases {
        assert_eq!(number(value, 2), text);
    }
    // Nothing that a camera may hold breaks the panel.
    for value in [f64::NAN, f64::INFINITY, -1.0, 0.0, 1e300] {
        let selection = changed(active(Outcome::Met), |it| {
            it.predicted = Some(CostPoint::new(value, value));
            it.predicted_applied = it.predicted;
            it.target = KnobLevels::from_bits(u128::MAX);
        });
        let settings = KnobSettings {
            space: Arc::new(testing::space()),
            settings: KnobLevels::from_bits(u128::MAX),
        };
        let (budget, metered) = (
            Budget::both(Watts(value), value),
            changed(MeteredPower::default(), |it| it.mean = Some(Watts(value))),
        );
        let facts = Facts {
            selection: Some(&selection),
            budget: Some(&budget),
            app_budget: Some(Watts(value)),
            settings: Some(&settings),
            metered: Some(&metered),
            warming: Some(f32::NAN),
            ..Default::default()
        };
        let text = facts.summary();
        assert!(text.lines().all(|line| line.len() < 80), "{text}");
        assert!(text.contains("warming up, ? %"), "{text}");
        assert!(facts.knobs().len() < 80, "{}", facts.knobs());
    }
}

#[test]
fn an_infinite_limit_is_none() {
    let limits = |budget: Budget, app_budget| {
        Facts { budget: Some(&budget), app_budget, ..Default::default() }.limits()
    };
    assert_eq!(limits(Budget::default(), None), "none");
    let infinite = Watts(f64::INFINITY);
    let budget = Budget::both(infinite, f64::INFINITY).with_peak(infinite);
    assert_eq!(limits(budget, Some(infinite)), "none");
    assert_eq!(limits(Budget::error(0.02), Some(Watts(9.0))), "error 0.0200, 9.00 W of the app");
}

#[test]
fn every_currency_is_named_and_the_limit_that_binds() {
    let budget = Budget::error(0.02)
        .with_peak(Watts(9.0))
        .with_energy_per_frame(Joules(0.25))
        .with_frame_time(Duration::from_millis(16))
        .with_battery_until(Duration::from_secs(7200))
        .with_headroom(0.3);
    let selection = changed(active(Outcome::Met), |it| it.binding = Some(Limit::FrameTime));
    let facts = Facts { budget: Some(&budget), selection: Some(&selection), ..Default::default() };
    let text = facts.summary();
    assert!(
        text.starts_with(
            "budget    peak 9.00 W, error 0.0200, 250.0 mJ a frame, 16.0 ms, battery until 120.0 min, headroom 30 %\n"
        ),
        "{text}"
    );
    assert!(text.contains("held by   frame time\n"), "{text}");
}

#[test]
fn knobs_have_level_label_and_target() {
    let at = |samples, scale| KnobLevels::default().with_level(0, samples).with_level(1, scale);
    let selection = changed(active(Outcome::Settling), |it| it.target = at(4, 1));
    let settings = KnobSettings { space: Arc::new(testing::space()), settings: at(2, 1) };
    let facts =
        Facts { selection: Some(&selection), settings: Some(&settings), ..Default::default() };
    assert_eq!(facts.knobs(), "samples   3/5  8 > 32\nscale     2/3  0.75");
    // Before the first decision, and where the controller is off, the target means nothing.
    let facts = Facts { selection: None, ..facts };
    assert_eq!(facts.knobs(), "samples   3/5  8\nscale     2/3  0.75");
}

#[test]
fn a_switch_names_some_knobs_and_counts_the_others() {
    let (space, low, high) =
        (testing::space(), testing::space().lowest(), testing::space().highest());
    let line = |to, is_done, most| switch_line(&space, 12.34, (low, to), is_done, most);
    assert_eq!(line(high, true, 2), "12.3 s  samples 0 > 32, scale 0.5 > 1");
    assert_eq!(line(high, false, 1), "12.3 s  samples 0 > 32, +1 ...");
    assert_eq!(line(low, true, 2), "12.3 s  ");
}

#[test]
fn a_caption_has_the_watts_of_the_meter() {
    let correction = PowerCorrection { gain: 2.0, offset: Watts(1.0) };
    assert_eq!(
        caption(Some(&testing::frontier(1.0)), correction),
        "3 points, 3.00..9.00 W, error 0.200..0.000"
    );
}
