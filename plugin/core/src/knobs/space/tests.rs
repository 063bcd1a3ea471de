//! Tests of spaces, of settings as text, and of distinct settings.

use super::*;

/// Three knobs; the resolution of maps needs VPLs.
fn space() -> KnobSpace {
    KnobSpace::new(vec![
        Knob::new("gi_vpl_count", [0.0, 32.0, 64.0]),
        Knob::new("rsm_resolution", [64.0, 128.0]).needing("gi_vpl_count", 1),
        Knob::labelled("antialiasing", [(0.0, "off"), (1.0, "FXAA")]),
    ])
    .expect("a valid space")
}

#[test]
fn presets_accept_any_share() {
    let space = space();
    for share in [f64::NAN, f64::NEG_INFINITY, -1.0, 0.0, 0.5, 1.0, 2.0, f64::INFINITY] {
        assert!(space.contains(space.preset(share)));
    }
    assert_eq!(space.preset(f64::NAN), space.lowest());
    assert_eq!(space.preset(f64::INFINITY), space.highest());
}

#[test]
fn invalid_spaces_are_rejected() {
    let twice = vec![Knob::new("a", [1.0]), Knob::new("a", [1.0])];
    assert_eq!(KnobSpace::new(twice), Err(KnobSpaceError::Duplicate("a".into())));
    assert_eq!(
        KnobSpace::new(vec![Knob::new("a", [])]),
        Err(KnobSpaceError::BadLevels("a".into()))
    );
    assert_eq!(
        KnobSpace::new(vec![Knob::new("a", [f64::NAN])]),
        Err(KnobSpaceError::BadLevels("a".into()))
    );
    let many = (0..33).map(|i| Knob::new(&format!("k{i}"), [0.0])).collect();
    assert_eq!(KnobSpace::new(many), Err(KnobSpaceError::TooManyKnobs(33)));
}

const KNOWN: [&str; 5] = ["gi_visibility", "antialiasing", "FXAA", "off", "4x4"];

#[test]
fn one_misspelling_in_three_letters_is_recognised() {
    for (name, known) in [
        ("gi_visibilty", "gi_visibility"),
        ("GI-Visibility", "gi_visibility"),
        ("anti_aliasing", "antialiasing"),
        ("fxaa", "FXAA"),
        ("of", "off"),
        ("4×4", "4x4"),
    ] {
        assert_eq!(did_you_mean(name, KNOWN), format!("did you mean `{known}`? "), "{name}");
    }
}

#[test]
fn another_word_is_not_a_misspelling() {
    for name in ["", "sharpness", "MSAA", "on", "8x8", "gi_bounces", &"x".repeat(10_000)] {
        assert_eq!(did_you_mean(name, KNOWN), "", "{name}");
    }
    assert_eq!(did_you_mean("off", []), "");
}

#[test]
fn the_nearest_comes_first_and_ties_keep_their_order() {
    assert_eq!(did_you_mean("shadow", ["shadows", "shadow_"]), "did you mean `shadows`? ");
    assert_eq!(
        did_you_mean("shadow_cascade", ["shadow_cast", "shadow_cascades"]),
        "did you mean `shadow_cascades`? "
    );
}

#[test]
fn text_and_settings_round_trip() {
    let space = space();
    for settings in space.iter() {
        assert_eq!(space.parse(&space.describe(settings)), Ok(settings));
    }
    assert_eq!(space.parse("min,antialiasing=FXAA").map(|s| s.level(2)), Ok(1));
    assert!(matches!(space.parse("sharpness=3"), Err(KnobSpaceError::Unknown { .. })));
    assert!(matches!(space.parse("antialiasing=MSAA"), Err(KnobSpaceError::UnknownLevel { .. })));
    assert!(matches!(space.parse("best"), Err(KnobSpaceError::NotAnAssignment(_))));
}

#[test]
fn a_misspelt_name_or_level_gets_the_nearest_one() {
    let space = space();
    let refused = |text: &str| space.parse(text).expect_err(text).to_string();
    let knob = refused("gi_vpl_cuont=32");
    assert!(knob.contains("did you mean `gi_vpl_count`?"), "{knob}");
    let knob = space.subset(["antialiassing"]).expect_err("no such knob").to_string();
    assert!(knob.contains("did you mean `antialiasing`?"), "{knob}");
    let level = refused("antialiasing=fxaa");
    assert!(level.contains("did you mean `FXAA`?"), "{level}");
    // All names are listed, and none is suggested where none is near.
    for far in ["sharpness=3", "rsm_resolution=512", "antialiasing=MSAA", "=", "a=1"] {
        let message = refused(far);
        assert!(!message.contains("did you mean"), "{message}");
        assert!(
            message.contains("64, 128")
                || message.contains("FXAA")
                || message.contains("rsm_resolution"),
            "{message}"
        );
    }
}

#[test]
fn every_combination_appears_once_in_canonical_form() {
    let space = space();
    let all: Vec<_> = space.iter().collect();
    // Without VPLs the RSM's resolution has no effect: (1 + 2 * 2) * 2.
    assert_eq!(all.len(), 10);
    assert_eq!(space.combinations(), 10);
    assert!(all.iter().all(|s| space.contains(*s) && space.canonical(*s) == *s));
    assert_eq!(all.iter().collect::<std::collections::HashSet<_>>().len(), 10);
}

#[test]
fn dependencies_chain() {
    let knobs = vec![
        Knob::new("count", [0.0, 1.0, 2.0]),
        Knob::new("rays", [0.0, 2.0, 8.0]).needing("count", 1),
        Knob::new("sky", [0.0, 8.0]).needing("rays", 1),
    ];
    let space = KnobSpace::new(knobs).expect("a valid space");
    let all: Vec<_> = space.iter().collect();
    // Without a count there are no rays, and without rays no sky: 1 + 2 * (1 + 2 * 2).
    assert_eq!((all.len(), space.combinations()), (11, 11));
    let dark = KnobLevels::default().with_level(1, 2).with_level(2, 1);
    assert_eq!(space.canonical(dark), space.lowest());
    let shown: Vec<_> = space
        .cheapest_with(&space.knobs()[2])
        .iter()
        .map(|s| [s.level(0), s.level(1), s.level(2)])
        .collect();
    assert_eq!(shown, [[1, 1, 0], [1, 2, 0]]);
    assert_eq!(space.cheapest_with(&space.knobs()[0]), [space.lowest()]);
    let circle = vec![
        Knob::new("a", [0.0, 1.0]).needing("b", 1),
        Knob::new("b", [0.0, 1.0]).needing("a", 1),
    ];
    let space = KnobSpace::new(circle).expect("a valid space");
    assert_eq!(space.canonical(space.highest()), space.highest());
}

#[test]
fn the_largest_space_is_counted_without_overflow() {
    let knobs = (0..32).map(|i| Knob::new(&format!("k{i}"), (0..16).map(f64::from))).collect();
    assert_eq!(KnobSpace::new(knobs).expect("as large as settings pack").combinations(), u64::MAX);
}
