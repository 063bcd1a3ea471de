//! Incorrect use and invalid input: exit status 2, one message that names the cause, no output
//! touched, no panic.

use std::fs;
use std::path::Path;

use bevy_frugal_gi::frontier::{
    Capture, CostPoint, Frontier, FrontierMap, FrontierPoint, Octree, SceneIdentity,
};
use bevy_frugal_gi::knobs::{Knob, KnobLevels, KnobSpace};
use frugal::scene;
use frugal::table::{SweepFacts, SweepTable};
use frugal_tests::map;
use tempfile::TempDir;

use super::command::{assert_refused, command, run, stderr};

tests!(
    scenes_that_cannot_be_read_are_named,
    models_that_cannot_be_read_are_named,
    maps_that_cannot_be_used_are_named,
    invalid_budgets_are_named,
    unwritable_outputs_are_named_before_the_work,
    invalid_arguments_are_named,
    a_missing_adapter_is_reported,
    references_are_traced_and_compared_without_an_adapter,
    recorded_tables_are_searched_without_an_adapter,
    a_closed_pipe_is_no_panic,
    maps_that_cost_more_have_their_own_exit_status,
    presets_come_from_a_map,
);

const SCENE: &str = r#"(
    geometry: Procedural("furnace"),
    lights: [Point(position: (0.0, 0.0, 0.0), luminous_power: 20000.0, range: 100.0)],
    bounds: (min: (-0.9, -0.9, -0.9), max: (0.9, 0.9, 0.9)),
    paths: { "tour": [
        (time: 0.0, position: (0.0, 0.0, 0.5), look_at: (0.0, 0.0, -2.0)),
        (time: 0.2, position: (0.1, 0.0, 0.5), look_at: (0.0, 0.0, -2.0)),
    ] },
)"#;

const AT: [&str; 4] = ["--position", "0,0,0.5", "--look-at", "0,0,-2"];
const OUTPUT: &str = "out.png";

fn folder() -> TempDir {
    tempfile::tempdir().expect("a folder")
}

fn write(folder: &Path, name: &str, text: &str) {
    fs::write(folder.join(name), text).expect("can be written");
}

/// Renders a scene to an existing output file, and asserts that the scene is refused and the file
/// unchanged.
fn refused_scene(name: &str, text: Option<&str>, words: &[&str]) {
    let folder = folder();
    if let Some(text) = text {
        write(folder.path(), name, text);
    }
    write(folder.path(), OUTPUT, "precious");
    let before = entries(folder.path());
    let arguments = [&["render", name][..], &AT, &["-o", OUTPUT]].concat();
    assert_refused(&run(folder.path(), &arguments), words);
    assert_eq!(entries(folder.path()), before, "files appeared");
    assert_eq!(fs::read_to_string(folder.path().join(OUTPUT)).expect("still there"), "precious");
}

fn entries(folder: &Path) -> Vec<String> {
    let files = fs::read_dir(folder)
        .expect("a folder")
        .map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned());
    let mut files: Vec<_> = files.collect();
    files.sort();
    files
}

fn scenes_that_cannot_be_read_are_named() {
    let name = "bad.scene.ron";
    refused_scene("missing.scene.ron", None, &["missing.scene.ron"]);
    refused_scene(name, Some(""), &[name]);
    refused_scene(name, Some(&SCENE[..SCENE.len() / 2]), &[name]);
    refused_scene(
        name,
        Some(&SCENE.replace("bounds:", "bonds:")),
        &[name, ":4:", "bonds", "bounds"],
    );
    refused_scene(name, Some(&SCENE.replace("20000.0", "NaN")), &[name, "luminous_power"]);
    refused_scene(name, Some(&SCENE.replace("20000.0", "-1.0")), &[name, "luminous_power"]);
    refused_scene(
        name,
        Some(&SCENE.replace("max: (0.9, 0.9, 0.9)", "max: (0.9, -0.9, 0.9)")),
        &[name, "bounds"],
    );
    refused_scene(name, Some(&SCENE.replace("furnace", "oven")), &[name, "oven", "furnace"]);
}

/// A valid GLB of one triangle.
pub(crate) fn triangle() -> Vec<u8> {
    let json = r#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],
        "meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],
        "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}],
        "bufferViews":[{"buffer":0,"byteLength":36}],"buffers":[{"byteLength":36}]}"#;
    let mut json = json.as_bytes().to_vec();
    json.resize(json.len().next_multiple_of(4), b' ');
    let positions: Vec<u8> = [0.0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]
        .iter()
        .flat_map(|value| value.to_le_bytes())
        .collect();
    let word = |value: usize| (value as u32).to_le_bytes();
    let total = 12 + 8 + json.len() + 8 + positions.len();
    [
        b"glTF",
        &word(2),
        &word(total),
        &word(json.len()),
        b"JSON",
        &json[..],
        &word(positions.len()),
        b"BIN\0",
        &positions[..],
    ]
    .concat()
}

fn models_that_cannot_be_read_are_named() {
    let folder = folder();
    write(folder.path(), "a.scene.ron", r#"(geometry: Gltf("a.glb"))"#);
    let render =
        || run(folder.path(), &[&["render", "a.scene.ron"][..], &AT, &["-o", OUTPUT]].concat());
    assert_refused(&render(), &["a.glb"]);
    let whole = triangle();
    for length in [0, 3, 11, 40, whole.len() / 2, whole.len() - 1] {
        fs::write(folder.path().join("a.glb"), &whole[..length]).expect("can be written");
        assert_refused(&render(), &["a.glb"]);
        assert_eq!(entries(folder.path()), ["a.glb", "a.scene.ron"], "cut to {length} bytes");
    }
    fs::write(folder.path().join("a.glb"), &whole).expect("can be written");
    assert!(
        scene::load(folder.path().join("a.scene.ron")).expect("a scene").geometry().is_ok(),
        "the complete file is valid"
    );
}

/// Writes a scene and a map of it.
fn scene_with_map(folder: &Path) -> FrontierMap {
    write(folder, "a.scene.ron", SCENE);
    let knobs = KnobSpace::new(vec![Knob::new(
        "gi_vpl_count",
        [0.0, 64.0, 128.0, 256.0, 512.0, 1024.0, 2048.0, 4096.0],
    )])
    .expect("a space");
    let fingerprint = scene::load(folder.join("a.scene.ron"))
        .expect("a scene")
        .fingerprint()
        .expect("a fingerprint");
    let map = FrontierMap {
        scene: SceneIdentity { name: "a".into(), fingerprint },
        ..map::one_cube(knobs)
    };
    write(folder, "a.pareto.ron", &map.to_ron().expect("text"));
    map
}

/// Runs `evaluate` with more arguments, and asserts that it is refused and writes nothing.
fn refused_evaluation(folder: &Path, more: &[&str], words: &[&str]) {
    let before = entries(folder);
    let arguments =
        [&["evaluate", "a.scene.ron", "--map", "a.pareto.ron", "--json", "out.json"][..], more]
            .concat();
    assert_refused(&run(folder, &arguments), words);
    assert_eq!(entries(folder), before, "{more:?}: files appeared");
}

fn maps_that_cannot_be_used_are_named() {
    let folder = folder();
    let map = scene_with_map(folder.path());
    let text = map.to_ron().expect("text");
    let budget = ["--power-budget", "60%"];
    let check = |text: Option<&str>, words: &[&str]| {
        match text {
            Some(text) => write(folder.path(), "a.pareto.ron", text),
            None => fs::remove_file(folder.path().join("a.pareto.ron")).expect("was there"),
        }
        refused_evaluation(folder.path(), &budget, &[&["a.pareto.ron"][..], words].concat());
    };
    check(None, &[]);
    check(Some(&text[..text.len() / 2]), &["cut off"]);
    check(
        Some(&text.replacen("version:1", "version:2", 1).replacen("version: 1", "version: 2", 1)),
        &["version 2"],
    );
    check(Some(&text.replace(&map.scene.fingerprint, "another")), &["another"]);
    check(Some(&text.replace("gi_vpl_count", "sharpness")), &["sharpness"]);
    let empty = FrontierMap { capture: Capture { size: [0, 36], ..map.capture }, ..map.clone() };
    check(Some(&empty.to_ron().expect("text")), &["capture.size"]);
}

fn invalid_budgets_are_named() {
    let folder = folder();
    scene_with_map(folder.path());
    for budget in
        ["0", "0W", "-3W", "NaN", "NaNW", "inf", "-inf", "0%", "101%", "-5%", "NaN%", "7J", ""]
    {
        refused_evaluation(folder.path(), &["--power-budget", budget], &["budget"]);
    }
    for budget in ["0", "-1", "NaN", "inf", "2.5", "x"] {
        refused_evaluation(folder.path(), &["--error-budget", budget], &["budget"]);
    }
    refused_evaluation(folder.path(), &[], &["--power-budget", "--error-budget"]);
    refused_evaluation(
        folder.path(),
        &["--power-budget", "60%", "--path", "walk"],
        &["walk", "tour"],
    );
}

fn unwritable_outputs_are_named_before_the_work() {
    let folder = folder();
    scene_with_map(folder.path());
    write(folder.path(), "file", "precious");
    let before = entries(folder.path());
    for output in ["no/such/out", "file/out", "."] {
        for arguments in [
            [&["render", "a.scene.ron"][..], &AT, &["-o", output]].concat(),
            [&["render", "a.scene.ron"][..], &AT, &["--hdr", output]].concat(),
            [&["sweep", "a.scene.ron"][..], &AT, &["--csv", output]].concat(),
            [&["precompute", "a.scene.ron"][..], &["-o", output]].concat(),
            [
                &["evaluate", "a.scene.ron", "--map", "a.pareto.ron", "--power-budget", "60%"][..],
                &["--csv", output],
            ]
            .concat(),
            [
                &["evaluate", "a.scene.ron", "--map", "a.pareto.ron", "--power-budget", "60%"][..],
                &["--json", output],
            ]
            .concat(),
        ] {
            assert_refused(&run(folder.path(), &arguments), &[&format!("`{output}`")]);
        }
    }
    assert_eq!(entries(folder.path()), before, "files appeared");
}

fn invalid_arguments_are_named() {
    let folder = folder();
    write(folder.path(), "a.scene.ron", SCENE);
    for (arguments, words) in [
        (
            &["precompute", "a.scene.ron", "--error-threshold", "NaN"][..],
            &["--error-threshold"][..],
        ),
        (&["precompute", "a.scene.ron", "--error-threshold", "-0.1"], &["--error-threshold"]),
        (&["precompute", "a.scene.ron", "--levels", "16"], &["--levels"]),
        (&["precompute", "a.scene.ron", "--power-threshold", "-1W"], &["--power-threshold"]),
        (&["precompute", "a.scene.ron", "--time-limit", "0s"], &["--time-limit"]),
        (&["precompute", "a.scene.ron", "--size", "0x9"], &["--size"]),
        (&["precompute", "a.scene.ron", "--fps", "0"], &["frame rate"]),
        (&["precompute", "a.scene.ron", "--fps", "-30"], &["frame rate"]),
        (&["precompute", "a.scene.ron", "--knobs", "sharpness"], &["sharpness", "gi_vpl_count"]),
        (&["precompute", "a.scene.ron", "--meter", "crystal-ball"], &["crystal-ball"]),
        (
            &[&["reference", "a.scene.ron", "--bounces", "-1"][..], &AT].concat(),
            &["--bounces", "all"],
        ),
        (&[&["reference", "a.scene.ron", "--spp", "0"][..], &AT].concat(), &["--spp"]),
        (&[&["reference", "missing.scene.ron"][..], &AT].concat(), &["missing.scene.ron"]),
        (
            &[&["reference", "a.scene.ron", "--hdr", "no/such/folder.exr"][..], &AT].concat(),
            &["no/such/folder.exr"],
        ),
        (&["compare", "missing.exr", "a.scene.ron"], &["missing.exr"]),
        (&["compare", "a.scene.ron", "a.scene.ron"], &["a.scene.ron", "OpenEXR"]),
        (
            &["render", "a.scene.ron", "--position", "1,2,3", "--look-at", "1,2,3", "-o", "a.png"],
            &["--position", "--look-at", "no direction"],
        ),
        (&["inspect", "missing.pareto.ron"], &["missing.pareto.ron"]),
        (&["inspect", "a.scene.ron"], &["a.scene.ron", "no frontier map"]),
        (&["inspect", "--compare", "missing.pareto.ron", "a.scene.ron"], &["missing.pareto.ron"]),
        (
            &["inspect", "--compare", "a.scene.ron", "a.scene.ron", "--tolerance", "1"],
            &["--tolerance", "1%"],
        ),
        (&["inspect", "a.scene.ron", "--json", "out.json"], &["--compare"]),
        (&["reprice", "missing.pareto.ron", "--fps", "60"], &["missing.pareto.ron"]),
        (&["merge", "missing.journal"], &["missing.journal"]),
        (&["merge", "a.scene.ron"], &["a.scene.ron", "not a journal"]),
        (&["calibrate", "a.scene.ron", "--time-limit", "0s"], &["--time-limit"]),
        (&["precompute", "a.scene.ron", "--shard", "4/4"], &["--shard"]),
        (&["precompute", "a.scene.ron", "--path", "walk"], &["walk", "tour"]),
        (&["precompute", "a.scene.ron", "--cameras", "missing.txt"], &["missing.txt"]),
        (
            &["precompute", "a.scene.ron", "--cameras", "a.scene.ron"],
            &["a.scene.ron", "CameraRecorderPlugin"],
        ),
        (&["bake", "a.scene.ron"], &["bake"]),
    ] {
        assert_refused(&run(folder.path(), arguments), words);
    }
    assert_eq!(entries(folder.path()), ["a.scene.ron"], "files appeared");
}

fn a_missing_adapter_is_reported() {
    let folder = folder();
    scene_with_map(folder.path());
    let before = entries(folder.path());
    for arguments in [
        [&["render", "a.scene.ron"][..], &AT].concat(),
        vec!["precompute", "a.scene.ron"],
        vec!["evaluate", "a.scene.ron", "--map", "a.pareto.ron", "--power-budget", "60%"],
    ] {
        let mut command = command(folder.path(), &arguments);
        command.envs([
            ("VK_ICD_FILENAMES", "/nonexistent"),
            ("VK_DRIVER_FILES", "/nonexistent"),
            ("WGPU_BACKEND", "vulkan"),
        ]);
        assert_refused(
            &command.output().expect("starts"),
            &["no graphics adapter", "mesa-vulkan-drivers"],
        );
    }
    assert_eq!(entries(folder.path()), before, "files appeared");
}

fn references_are_traced_and_compared_without_an_adapter() {
    let folder = folder();
    write(folder.path(), "a.scene.ron", SCENE);
    let run = |arguments: &[&str]| {
        let mut command = command(folder.path(), arguments);
        command.envs([
            ("VK_ICD_FILENAMES", "/nonexistent"),
            ("VK_DRIVER_FILES", "/nonexistent"),
            ("WGPU_BACKEND", "vulkan"),
        ]);
        let output = command.output().expect("starts");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8_lossy(&output.stdout).into_owned()
    };
    let trace = |rest: &[&str]| {
        run(&[&["reference", "a.scene.ron", "--lambertian", "--spp", "16"][..], &AT, rest].concat())
    };
    trace(&["--size", "32x18", "--component", "direct", "--hdr", "direct.exr"]);
    trace(&[
        "--size",
        "32x18",
        "--component",
        "indirect",
        "--bounces",
        "1",
        "--hdr",
        "once.exr",
        "-o",
        "once.png",
    ]);
    trace(&["--size", "16x16", "--hdr", "small.exr"]);
    // The furnace's walls reflect 80 %: the first bounce is 80 % of the direct light.
    run(&["compare", "once.exr", "direct.exr", "--json", "difference.json"]);
    let json = fs::read_to_string(folder.path().join("difference.json")).expect("was written");
    let ratio = json
        .lines()
        .find_map(|line| line.trim().strip_prefix("\"mean_ratio\": "))
        .expect("is there");
    let ratio: f64 = ratio.trim_end_matches(',').parse().expect("a number");
    assert!((ratio - 0.8).abs() < 0.005, "{json}");
    assert_refused(
        &super::command::run(
            folder.path(),
            &["compare", "small.exr", "once.exr", "--json", "none.json"],
        ),
        &["small.exr", "32×18", "16×16"],
    );
    assert_eq!(
        entries(folder.path()),
        ["a.scene.ron", "difference.json", "direct.exr", "once.exr", "once.png", "small.exr"]
    );
}

/// Writes a table of two knobs; `worst` is the error of the lowest settings.
fn sweep_table(folder: &Path, name: &str, knobs: [&str; 2], worst: f64) {
    let space =
        frugal::stage::every_knob().expect("the built-in knobs").subset(knobs).expect("built-in");
    let point = |settings| {
        let [a, b] = [0, 1].map(|knob| KnobLevels::level(settings, knob) as f64);
        FrontierPoint { settings, cost: CostPoint::new(1.0 + a + b, worst / (1.0 + a + 2.0 * b)) }
    };
    let table = SweepTable {
        facts: SweepFacts::default(),
        points: space.iter().map(point).collect(),
        space: space.clone(),
    };
    let mut text = Vec::new();
    table.write(&mut text).expect("written");
    fs::write(folder.join(name), text).expect("can be written");
}

fn recorded_tables_are_searched_without_an_adapter() {
    let folder = folder();
    let knobs = ["gi_vpl_count", "shadow_map_resolution"];
    sweep_table(folder.path(), "a.csv", knobs, 0.1);
    sweep_table(folder.path(), "b.csv", knobs, 0.2);
    sweep_table(folder.path(), "c.csv", ["gi_vpl_count", "antialiasing"], 0.2);
    let search = |rest: &[&str]| run(folder.path(), &[&["search"][..], rest].concat());
    let output = search(&[
        "a.csv",
        "--known",
        "b.csv",
        "--seeds",
        "3",
        "--errors",
        "0.02,0.04",
        "--json",
        "out.json",
    ]);
    let printed = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    for word in
        ["32 of 32 combinations", "random", "nsga2", "frugal-cold", "frugal-warm", "100 %", "0.04"]
    {
        assert!(printed.contains(word), "`{word}` is missing in: {printed}");
    }
    let json = fs::read_to_string(folder.path().join("out.json")).expect("was written");
    for key in [
        "\"best_w\"",
        "\"median\"",
        "\"reached\": 1.0",
        "\"renderings\"",
        "\"method\": \"frugal-warm\"",
    ] {
        assert!(json.contains(key), "`{key}` is missing in: {json}");
    }
    let text = fs::read_to_string(folder.path().join("a.csv")).expect("was written");
    write(folder.path(), "nan.csv", &text.replacen(",2,", ",NaN,", 1));
    write(folder.path(), "cut.csv", text.rsplit_once(',').map_or("", |(whole, _)| whole));
    let before = entries(folder.path());
    for (arguments, words) in [
        (&["missing.csv"][..], &["missing.csv", "frugal sweep --csv"][..]),
        (&["nan.csv"], &["nan.csv:", "power_w", "NaN"]),
        (&["cut.csv"], &["cut.csv:34: row:", "cut off"]),
        (&["a.csv", "--known", "c.csv"], &["c.csv", "antialiasing", "shadow_map_resolution"]),
        (&["a.csv", "--errors", "0.001"], &["a.csv", "0.001", "--errors"]),
        (&["a.csv", "--errors", "NaN"], &["--errors"]),
        (&["a.csv", "--within", "-5%"], &["--within"]),
        (&["a.csv", "--seeds", "0"], &["--seeds"]),
        (&["a.csv", "--json", "no/such/out.json"], &["no/such/out.json"]),
    ] {
        assert_refused(&search(arguments), words);
    }
    assert_eq!(entries(folder.path()), before, "files appeared");
}

fn a_closed_pipe_is_no_panic() {
    let folder = folder();
    write(folder.path(), "a.scene.ron", SCENE);
    let arguments =
        [&["reference", "a.scene.ron", "--size", "16x16", "--spp", "1", "--hdr", "a.exr"][..], &AT]
            .concat();
    let mut process = command(folder.path(), &arguments).spawn().expect("starts");
    drop(process.stdout.take());
    let output = process.wait_with_output().expect("ends");
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(
        output.status.success() && !message.contains("panicked"),
        "{:?}: {message}",
        output.status
    );
}

/// A map with a shared frontier, with all powers multiplied by `scale`.
fn map_of_cost(scale: f64) -> FrontierMap {
    let map = map::one_cube(
        KnobSpace::new(vec![Knob::new("gi_vpl_count", [0.0, 64.0, 4096.0])]).expect("a space"),
    );
    let scaled = |point: &FrontierPoint| FrontierPoint {
        cost: CostPoint::new(scale * point.cost.power.0, point.cost.error),
        ..*point
    };
    let shared = Frontier::from_points(map.octree.frontiers[0].points().iter().map(scaled));
    FrontierMap { octree: Octree { frontiers: vec![shared.clone()], ..map.octree }, shared, ..map }
}

fn maps_that_cost_more_have_their_own_exit_status() {
    let folder = folder();
    let save =
        |name: &str, map: &FrontierMap| write(folder.path(), name, &map.to_ron().expect("text"));
    let map = map_of_cost(1.0);
    save("old.pareto.ron", &map);
    save("same.pareto.ron", &map);
    save("worse.pareto.ron", &map_of_cost(1.02));
    save(
        "faster.pareto.ron",
        &FrontierMap { capture: Capture { frames_per_second: 60.0, ..map.capture }, ..map.clone() },
    );
    let compare = |new: &str, more: &[&str]| {
        run(folder.path(), &[&["inspect", "--compare", "old.pareto.ron", new][..], more].concat())
    };

    let same = compare("same.pareto.ron", &[]);
    assert_eq!(same.status.code(), Some(0), "{}", stderr(&same));
    assert!(String::from_utf8_lossy(&same.stdout).contains("+0.00 %"));
    let worse = compare("worse.pareto.ron", &["--json", "gate.json"]);
    let message = stderr(&worse);
    assert_eq!(worse.status.code(), Some(3), "{message}");
    assert!(message.contains("rose by 2.00 %, more than the 1.00 % tolerated"), "{message}");
    let json = fs::read_to_string(folder.path().join("gate.json")).expect("was written");
    assert!(
        ["\"rose\": true", "\"old_w\"", "\"error\": 0.005", "\"tolerance\": 0.01"]
            .iter()
            .all(|part| json.contains(part)),
        "{json}"
    );
    assert_eq!(compare("worse.pareto.ron", &["--tolerance", "3%"]).status.code(), Some(0));
    assert_refused(
        &compare("faster.pareto.ron", &["--json", "none.json"]),
        &["old.pareto.ron", "faster.pareto.ron", "60 Hz", "--fps"],
    );
    assert!(!folder.path().join("none.json").exists());
}

fn presets_come_from_a_map() {
    let folder = folder();
    write(folder.path(), "a.pareto.ron", &map_of_cost(1.0).to_ron().expect("text"));
    let inspect = |map: &str| run(folder.path(), &["inspect", map, "--presets", "presets.ron"]);
    let output = inspect("a.pareto.ron");
    assert!(output.status.success(), "{}", stderr(&output));
    let facts = String::from_utf8_lossy(&output.stdout);
    for words in [" W with errors of ", "budgets    "] {
        assert!(facts.contains(words), "{words} in: {facts}");
    }
    let text = fs::read_to_string(folder.path().join("presets.ron")).expect("was written");
    let order: Vec<_> = ["battery", "low", "medium", "high", "ultra"]
        .iter()
        .map(|name| text.find(&format!("\"{name}\"")))
        .collect();
    assert!(order.iter().all(Option::is_some) && order.is_sorted(), "{text}");
    assert!(text.contains("\"gi_vpl_count\": \"4096\""), "{text}");
    write(
        folder.path(),
        "old.pareto.ron",
        &FrontierMap { shared: Frontier::default(), ..map_of_cost(1.0) }.to_ron().expect("text"),
    );
    assert_refused(
        &inspect("old.pareto.ron"),
        &["old.pareto.ron", "shared frontier", "frugal precompute"],
    );
    assert_eq!(fs::read_to_string(folder.path().join("presets.ron")).expect("still there"), text);
}
