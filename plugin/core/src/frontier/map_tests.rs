//! Tests of the map's text format and its validation.

use glam::Vec3;

use super::*;
use crate::frontier::{CostPoint, Frontier, FrontierPoint};
use crate::knobs::KnobLevels;
use crate::testing;

fn rejection(change: fn(&mut FrontierMap)) -> FrontierMapError {
    let mut map = testing::map(1);
    change(&mut map);
    let text = map.to_ron().expect("writable");
    let error = FrontierMap::from_ron(&text).expect_err("a rejection");
    assert_eq!(error.to_string().lines().count(), 1, "{error}");
    error
}

#[test]
fn text_round_trips() {
    for levels in 0..=3 {
        let map = testing::map(levels);
        let text = map.to_ron().expect("writable");
        let back = FrontierMap::from_ron(&text).expect("readable");
        assert_eq!(back, map);
        assert_eq!(back.to_ron().as_deref(), Ok(text.as_str()));
    }
}

#[test]
fn a_few_hundred_frontiers_take_tens_of_kilobytes() {
    // Three levels down one branch: 65 corners, 390 frontiers of three points.
    let map = testing::map(3);
    assert!((300..500).contains(&map.octree.frontiers.len()));
    let text = map.to_ron().expect("writable");
    assert!(text.len() < 50_000, "{} bytes", text.len());
    // Every corner and every frontier has a line of its own.
    assert!(
        text.lines().filter(|line| line.starts_with("[(")).count() == map.octree.frontiers.len(),
        "{text}"
    );
}

#[test]
fn another_version_is_reported_whatever_its_fields() {
    let text = testing::map(1).to_ron().expect("writable");
    let newer = text
        .replace("version:1", "version:3")
        .replace("seed:7", "seed:Some(Tree(of: [1, \"x\"])), weather: { \"rain\": 0.5 }");
    assert_ne!(newer, text);
    assert_eq!(FrontierMap::from_ron(&newer), Err(FrontierMapError::OtherVersion { found: 3 }));
    assert_eq!(rejection(|map| map.version = 0), FrontierMapError::OtherVersion { found: 0 });
}

#[test]
fn a_truncated_file_is_rejected_with_its_line() {
    let text = testing::map(1).to_ron().expect("writable");
    let whole = text.trim_end().len();
    for cut in (0..whole).step_by(7).chain([whole - 1]) {
        let part = &text[..cut];
        let last_line = 1 + part.matches('\n').count();
        match FrontierMap::from_ron(part) {
            Err(FrontierMapError::Parse { line, .. }) => {
                assert!(
                    line <= last_line && line + 1 >= last_line,
                    "cut at {cut}: {line}, not {last_line}"
                );
            }
            other => panic!("cut at {cut}: {other:?}"),
        }
    }
    let error = FrontierMap::from_ron(&text[..whole / 2]).expect_err("half a file").to_string();
    assert!(error.contains("line ") && error.contains("frugal precompute"), "{error}");
}

#[test]
fn a_misspelt_field_is_rejected_and_one_of_another_version_ignored() {
    let text = testing::map(1).to_ron().expect("writable");
    let error = FrontierMap::from_ron(&text.replace("seed:7", "sead:7"))
        .expect_err("a misspelt field")
        .to_string();
    assert!(error.contains("seed"), "{error}");
    let error = FrontierMap::from_ron(&text.replace("vertical_fov", "vertical_fow"))
        .expect_err("a misspelt field")
        .to_string();
    assert!(error.contains("vertical_fow"), "{error}");
    // A field of maps from before error budgets were calibrated.
    let older = text.replace("seed:7", "seed:7,correction:(error:1.3,samples:24)");
    assert_eq!(
        FrontierMap::from_ron(&older).expect("a map of an earlier version"),
        testing::map(1)
    );
}

#[test]
fn numbers_out_of_range_are_rejected_by_field_name() {
    let field = |change| match rejection(change) {
        FrontierMapError::OutOfRange { field, .. } => field,
        other => panic!("{other}"),
    };
    assert_eq!(field(|map| map.capture.size[1] = 0), "capture.size");
    assert_eq!(
        field(|map| map.capture.frames_per_second = f64::INFINITY),
        "capture.frames_per_second"
    );
    assert_eq!(field(|map| map.capture.vertical_fov = f32::NAN), "capture.vertical_fov");
    assert_eq!(field(|map| map.capture.vertical_fov = 180.0), "capture.vertical_fov");
    assert_eq!(field(|map| map.capture.exposure_ev100 = f32::NAN), "capture.exposure_ev100");
    assert_eq!(field(|map| map.thresholds.power_w = -0.1), "thresholds.power_w");
    assert_eq!(field(|map| map.thresholds.error = f64::NAN), "thresholds.error");
    assert_eq!(field(|map| map.bounds.min[2] = f32::NEG_INFINITY), "bounds.min");
    assert_eq!(field(|map| map.bounds.max[0] = map.bounds.min[0]), "bounds");
    assert_eq!(
        field(|map| map.bounds = Bounds { min: [f32::MIN; 3], max: [f32::MAX; 3] }),
        "bounds"
    );
}

#[test]
fn invalid_octrees_and_unknown_settings_are_rejected() {
    let missing = rejection(|map| map.octree.corners.truncate(26));
    let missing = missing.to_string();
    assert!(missing.contains("corner [2, 2, 2], which a leaf needs, is missing"), "{missing}");
    let point = |bits, power, error| {
        Frontier::from_points([FrontierPoint {
            settings: KnobLevels::from_bits(bits),
            cost: CostPoint::new(power, error),
        }])
    };
    let with = |frontier: Frontier| {
        let mut map = testing::map(0);
        map.octree.frontiers[3] = frontier;
        map.validate().map_err(|error| error.to_string())
    };
    assert_eq!(with(point(0x24, 1.0, 0.0)), Ok(()));
    for (frontier, words) in [
        (point(0x05, 1.0, 0.0), "frontier 3 has settings 5, which the map's knobs lack"),
        (point(0x100, 1.0, 0.0), "frontier 3 has settings 256, which the map's knobs lack"),
        (point(0, -1.0, 0.0), "frontier 3 has a point of -1 W and error 0"),
        (point(0, 1.0, 2.1), "frontier 3 has a point of 1 W and error 2.1"),
    ] {
        let refused = with(frontier).expect_err(words);
        assert!(refused.contains(words), "{refused}");
    }
}

#[test]
fn scenes_are_identified_by_fingerprint() {
    let map = testing::map(0);
    let mut scene = map.scene.clone();
    scene.name = "renamed".into();
    assert_eq!(map.matches_scene(&scene), Ok(()));
    scene.fingerprint = "00fe".into();
    let message = map.matches_scene(&scene).expect_err("another scene").to_string();
    assert!(
        message.contains("courtyard")
            && message.contains("renamed")
            && message.contains("frugal precompute"),
        "{message}"
    );
}

#[test]
fn positions_map_to_the_unit_cube_and_clamp() {
    let bounds = testing::map(0).bounds;
    assert_eq!(bounds.to_unit(Vec3::new(-4.0, 0.0, 2.0)), Vec3::new(0.0, 0.5, 0.75));
    assert_eq!(bounds.from_unit(Vec3::new(0.0, 0.5, 0.75)), Vec3::new(-4.0, 0.0, 2.0));
    assert_eq!(
        bounds.to_unit(Vec3::new(f32::NAN, f32::INFINITY, f32::NEG_INFINITY)),
        Vec3::new(0.0, 1.0, 0.0)
    );
    let empty = Bounds { min: [1.0; 3], max: [1.0; 3] };
    assert!(
        empty.to_unit(Vec3::splat(5.0)).is_finite() && empty.to_unit(Vec3::splat(1.0)).is_finite()
    );
}

#[test]
fn an_index_beyond_the_list_is_one_clear_error() {
    let text = testing::map(1).to_ron().expect("writable");
    let start = text.find("settings:[\n").expect("a list");
    let end = start + text[start..].find("],\n").expect("its end");
    let emptied = format!("{}settings:[\n{}", &text[..start], &text[end..]);
    let error = FrontierMap::from_ron(&emptied).expect_err("no settings");
    let error = error.to_string();
    assert!(error.contains("frontier 0 has settings beyond the 0 that the map lists"), "{error}");
    assert!(error.to_string().contains("frugal precompute"), "{error}");
}

#[test]
fn settings_are_written_once() {
    let text = testing::map(3).to_ron().expect("writable");
    let map = FrontierMap::from_ron(&text).expect("readable");
    let start = text.find("settings:[\n").expect("a list");
    let list = text[start..].lines().skip(1).take_while(|line| *line != "],").count();
    assert_eq!(list, map.settings().len());
}
