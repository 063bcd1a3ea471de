use frugal_trace::light::Light;
use frugal_trace::scene::Bounds;
use glam::Vec3;

use super::*;
use crate::scene::{Geometry, LoadedScene, load};

/// A complete description, as in the documentation; each test spoils one value.
const VALID: &str = r#"(
    geometry: Procedural("cornell"),
    lights: [
        Directional(direction: (-0.45, -1.0, -0.3), illuminance: 50000.0, color: (1.0, 0.95, 0.88)), // lux
        Point(position: (0.0, 3.0, 0.0), luminous_power: 4000.0, range: 31.0),
        Spot(position: (0.0, 3.0, 0.0), direction: (0.0, -1.0, 0.0), luminous_power: 4000.0,
             inner_angle: 20.0, outer_angle: 35.0),
    ],
    environment: Constant((200.0, 220.0, 260.0)),
    exposure_ev100: 12.0,
    camera: (vertical_fov: 61.0, near: 0.1, far: 200.0),
    bounds: (min: (-8.0, 0.5, -8.0), max: (8.0, 6.0, 8.0)),
    paths: {
        "tour": [
            (time: 0.0, position: (0.0, 1.7, 6.0), look_at: (0.0, 1.5, 0.0)),
            (time: 2.5, position: (0.0, 1.7, 5.0), look_at: (0.0, 1.5, 0.0)),
        ],
    },
)"#;

fn valid() -> SceneDescription {
    parse(VALID, Path::new("a.scene.ron")).unwrap()
}

/// Replaces `from` in the valid text and checks location, field and words of the error: it must
/// point at `anchor` in its line.
fn spoiled(from: &str, to: &str, (line, anchor): (usize, &str), field: &str, words: &[&str]) {
    assert_eq!(VALID.matches(from).count(), 1, "{from}");
    let text = VALID.replace(from, to);
    let column = text.lines().nth(line - 1).unwrap().find(anchor).unwrap() + 1;
    let error = parse(&text, Path::new("dir/a.scene.ron")).expect_err(to);
    let message = error.to_string();
    let SceneError::Invalid { line: found_line, column: found_column, field: found_field, .. } =
        &error
    else {
        panic!("{error:?}")
    };
    assert_eq!((*found_line, found_field.as_str()), (line, field), "{message}");
    assert_eq!(*found_column, column, "{message}");
    assert!(message.starts_with(&format!("dir/a.scene.ron:{line}:")), "{message}");
    for word in words {
        assert!(message.contains(word), "{message} lacks {word}");
    }
}

#[test]
fn the_documented_form_is_read() {
    let description = valid();
    assert_eq!(description.lights.len(), 3);
    assert_eq!(description.environment, Environment::Constant([200.0, 220.0, 260.0]));
    assert_eq!(
        description.bounds,
        Some(Bounds { min: Vec3::new(-8.0, 0.5, -8.0), max: Vec3::new(8.0, 6.0, 8.0) })
    );
    assert_eq!(description.paths["tour"].duration(), 2.5);
    let Light::Spot { range, color, .. } = description.lights[2] else { panic!() };
    assert_eq!((range, color), (30.0, [1.0; 3]));
    assert!(LoadedScene::new(description).unwrap().rays.triangle_count() > 0);
}

#[test]
fn everything_but_the_geometry_has_a_default() {
    let description =
        parse("(geometry: Procedural(\"furnace\"))", Path::new("f.scene.ron")).unwrap();
    let mut expected = SceneDescription::new(Geometry::Procedural("furnace".into()));
    expected.source = "f.scene.ron".into();
    assert_eq!(description, expected);
    let bounds = LoadedScene::new(description).unwrap().camera_bounds();
    assert!((bounds.max.x - 1.6).abs() < 0.01 && (bounds.min.y + 1.6).abs() < 0.01, "{bounds:?}");
    let partial =
        parse("(geometry: Procedural(\"furnace\"), camera: (far: 9.0))", Path::new("f.scene.ron"))
            .unwrap();
    assert_eq!((partial.camera.far, partial.camera.near), (9.0, 0.1));
}

#[test]
fn wrong_values_are_named_with_line_column_and_field() {
    spoiled(
        "\"cornell\"",
        "\"cornel\"",
        (2, "\"cornel\""),
        "geometry[0]",
        &["\"cornel\"", "courtyard", "furnace"],
    );
    spoiled("(-0.45, -1.0, -0.3)", "(0, 0, 0)", (4, "(0, 0, 0)"), "lights[0].direction", &["zero"]);
    spoiled("50000.0", "NaN", (4, "NaN"), "lights[0].illuminance", &["NaN", "at least 0 lux"]);
    spoiled("50000.0", "-1", (4, "-1,"), "lights[0].illuminance", &["-1"]);
    spoiled("50000.0", "1e99", (4, "1e99"), "lights[0].illuminance", &["inf"]);
    spoiled("0.95, 0.88", "-0.95, 0.88", (4, "-0.95, 0.88"), "lights[0].color[1]", &["at least 0"]);
    spoiled("31.0", "-31.0", (5, "-31"), "lights[1].range", &["greater than 0"]);
    spoiled("35.0", "15.0", (7, "15.0"), "lights[2].outer_angle", &["inner_angle"]);
    let (both, narrow) = ("inner_angle: 20.0, outer_angle: 35.0", "outer_angle: 29.0");
    spoiled(both, narrow, (7, "29.0"), "lights[2].outer_angle", &["inner_angle", "default is 30"]);
    spoiled("35.0", "95.0", (7, "95.0"), "lights[2].outer_angle", &["90"]);
    spoiled("220.0", "inf", (9, "inf"), "environment[0][1]", &["nits"]);
    spoiled("12.0", "99", (10, "99"), "exposure_ev100", &["-20 to 30"]);
    spoiled("61.0", "180.0", (11, "180.0"), "camera.vertical_fov", &["between 0 and 180"]);
    spoiled("near: 0.1", "near: 0", (11, "0, far"), "camera.near", &["greater than 0"]);
    spoiled("200.0)", "0.1)", (11, "0.1)"), "camera.far", &["near"]);
    spoiled("6.0, 8.0", "0.5, 8.0", (12, "0.5, 8.0"), "bounds.max[1]", &["empty", "min y is 0.5"]);
    spoiled("-8.0, 0.5", "NaN, 0.5", (12, "NaN"), "bounds.min[0]", &["NaN"]);
    spoiled("2.5", "0.0", (16, "0.0, position"), "paths[\"tour\"][1].time", &["later"]);
    spoiled("1.7, 5.0", "1.7, inf", (16, "inf"), "paths[\"tour\"][1].position[2]", &["inf"]);
    let looks_at = "position: (0.0, 1.7, 5.0), look_at: (0.0, 1.5, 0.0)";
    let itself = "position: (0.0, 1.7, 5.0), look_at: (0.0, 1.7, 5.0)";
    let field = "paths[\"tour\"][1].look_at";
    spoiled(looks_at, itself, (16, "(0.0, 1.7, 5.0))"), field, &["no direction", "middle"]);
    let twice = "        ],\n        \"tour\": [(time: 0.0, position: (0, 1, 6), look_at: (0, 1, 0))],\n    },\n)";
    let end = "        ],\n    },\n)";
    spoiled(end, twice, (14, "["), "paths[\"tour\"]", &["two of this name"]);
    let keys = &VALID[VALID.find("(time: 0.0").unwrap()..VALID.find("],\n    },").unwrap()];
    spoiled(keys, "", (14, "["), "paths[\"tour\"]", &["no keys"]);
}

#[test]
fn wrong_words_are_named_with_what_is_known() {
    let at = |from: &str, to: &str| match parse(&VALID.replace(from, to), Path::new("a.scene.ron"))
        .expect_err(to)
    {
        SceneError::Invalid { line, field, problem, remedy, .. } => (line, field, problem, remedy),
        other => panic!("{other}"),
    };
    let (line, field, _, remedy) = at("exposure_ev100", "exposure_ev10");
    assert_eq!((line, field.as_str()), (10, "exposure_ev10"));
    assert!(
        remedy.contains("did you mean `exposure_ev100`?") && remedy.contains("environment"),
        "{remedy}"
    );
    let (line, field, _, remedy) = at("range: 31", "reach: 31");
    assert_eq!((line, field.as_str()), (5, "reach"));
    assert!(remedy.contains("luminous_power"), "{remedy}");
    let (line, .., remedy) = at("Point(", "Pint(");
    assert!(line == 5 && remedy.contains("did you mean `Point`?"), "{line} {remedy}");
    let (line, field, _, remedy) = at("\"cornell\"", "\"cornel\"");
    assert_eq!((line, field.as_str()), (2, "geometry[0]"));
    assert!(remedy.contains("did you mean `cornell`?"), "{remedy}");
    let (line, field, ..) = at("illuminance: 50000.0, ", "");
    assert_eq!((line, field.as_str()), (4, "lights[0].illuminance"));
    let (line, field, problem, _) = at("61.0", "\"wide\"");
    assert_eq!((line, field.as_str()), (11, "camera.vertical_fov"), "{problem}");
    let (line, ..) = at("near: 0.1,", "near: 0.1");
    assert_eq!(line, 11);
    assert!(matches!(parse("", Path::new("a")), Err(SceneError::Invalid { line: 1, .. })));
    assert!(
        matches!(parse("(lights: [])", Path::new("a")), Err(SceneError::Invalid { field, .. }) if field == "geometry")
    );
}

#[test]
fn missing_and_broken_files_are_named_at_their_field() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a.scene.ron");
    let missing = load(&file).expect_err("missing").to_string();
    assert!(missing.contains("a.scene.ron"), "{missing}");
    let write = |geometry: &str| {
        std::fs::write(&file, VALID.replace("Procedural(\"cornell\")", geometry)).unwrap();
    };
    let fails = |words: &[&str]| match load(&file).expect_err("broken") {
        error @ SceneError::Invalid { line: 2, column: 20, .. } => {
            let message = error.to_string();
            assert!(words.iter().all(|word| message.contains(word)), "{message}");
        }
        error => panic!("{error}"),
    };
    write("Gltf(\"a.glb\")");
    fails(&["a.scene.ron:2:20", "a.glb", "cannot read"]);
    let glb = crate::scene::geometry::tests::quad_glb();
    std::fs::write(folder.path().join("a.glb"), &glb[..glb.len() - 7]).unwrap();
    fails(&["cut short"]);
    std::fs::write(folder.path().join("a.glb"), b"no").unwrap();
    fails(&["glTF"]);
    std::fs::write(folder.path().join("a.glb"), &glb).unwrap();
    assert_eq!(load(&file).unwrap().geometry.triangle_count(), 2);
    let text = VALID.replace("Constant((200.0, 220.0, 260.0))", "Map(\"sky.hdr\", 1000.0)");
    std::fs::write(&file, &text).unwrap();
    let fails = |words: &[&str]| match load(&file).expect_err("no sky") {
        error @ SceneError::Invalid { line: 9, .. } => {
            let message = error.to_string();
            assert!(message.contains(": environment[0]: "), "{message}");
            assert!(words.iter().all(|word| message.contains(word)), "{message}");
        }
        error => panic!("{error}"),
    };
    let sky = folder.path().join("sky.hdr");
    fails(&["sky.hdr", "cannot be read", "check the path"]);
    std::fs::write(&sky, b"no").unwrap();
    fails(&["sky.hdr", "OpenEXR"]);
    std::fs::write(&file, text.replace("sky.hdr", "sky.png")).unwrap();
    image::RgbImage::new(4, 2).save(folder.path().join("sky.png")).unwrap();
    fails(&["sky.png", "not linear radiance", "OpenEXR"]);
    std::fs::write(&file, text.replace("sky.hdr", "sky.exr")).unwrap();
    let sky = image::Rgb32FImage::from_pixel(4, 2, image::Rgb([1.0; 3]));
    sky.save(folder.path().join("sky.exr")).unwrap();
    let scene = load(&file).unwrap();
    assert_eq!(scene.sky().unwrap().expect("a map").size(), (4, 2));
    assert!(scene.gaps.is_empty(), "{:?}", scene.gaps);
    // A mirror ball, or the faces of a cube side by side.
    let sky = image::Rgb32FImage::from_pixel(4, 4, image::Rgb([1.0; 3]));
    sky.save(folder.path().join("sky.exr")).unwrap();
    let gaps = load(&file).unwrap().gaps;
    assert!(gaps.len() == 1 && gaps[0].contains("4×4 texels"), "{gaps:?}");
}

#[test]
fn the_content_follows_every_file_of_the_geometry() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, bytes: &str| std::fs::write(folder.path().join(name), bytes).unwrap();
    let mut description = SceneDescription::new(Geometry::Gltf("model/a.gltf".into()));
    description.source = folder.path().join("a.scene.ron");
    let scene = LoadedScene::with_geometry(description, Default::default());
    let content = || scene.content().map_err(|error| error.to_string());
    assert!(content().expect_err("missing").contains("model/a.gltf"));
    std::fs::create_dir(folder.path().join("model")).unwrap();
    let gltf = r#"{"asset":{"version":"2.0"},"buffers":[{"uri":"a.bin","byteLength":2}],
        "images":[{"uri":"wall%20bumps.png"},{"uri":"data:image/png;base64,AAAA"}]}"#;
    write("model/a.gltf", gltf);
    write("model/a.bin", "00");
    let mut last = content().unwrap();
    assert_eq!(content().unwrap(), last);
    for (name, bytes) in [
        ("model/wall bumps.png", "here now"),
        ("model/wall bumps.png", "another"),
        ("model/a.bin", "01"),
        ("model/a.gltf", gltf.replace('\n', " ").as_str()),
    ] {
        write(name, bytes);
        let now = content().unwrap();
        assert_ne!(now, last, "{name}");
        last = now;
    }
}

#[test]
fn the_fingerprint_follows_content_and_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a.scene.ron");
    let glb = folder.path().join("a.glb");
    std::fs::write(&glb, crate::scene::geometry::tests::quad_glb()).unwrap();
    let text = VALID.replace("Procedural(\"cornell\")", "Gltf(\"a.glb\")");
    let print = |text: &str| {
        std::fs::write(&file, text).unwrap();
        load(&file).unwrap().fingerprint().unwrap()
    };
    let first = print(&text);
    assert_eq!(first.len(), 32);
    assert_eq!(print(&text.replace("// lux", "").replace("    ", "\t")), first, "layout");
    assert_eq!(print(&text.replace("2.5", "2.75")), first, "paths");
    for (from, to) in [
        ("12.0", "12.5"),
        ("-0.3)", "-0.31)"),
        ("31.0", "32.0"),
        ("61.0", "62.0"),
        ("(-8.0, 0.5", "(-8.0, 0.6"),
        ("260", "261"),
    ] {
        assert_ne!(print(&text.replace(from, to)), first, "{from}");
    }
    let mut bytes = std::fs::read(&glb).unwrap();
    // The last byte of the binary chunk belongs to a position.
    *bytes.last_mut().unwrap() ^= 0x40;
    std::fs::write(&glb, bytes).unwrap();
    assert_ne!(print(&text), first, "geometry");
    // The hash must never change on any machine, or maps lose their scenes.
    let cornell = LoadedScene::new(valid()).unwrap();
    assert_eq!(cornell.fingerprint().unwrap(), "3bbc134fc1a928776e412f0a60621662");
}
