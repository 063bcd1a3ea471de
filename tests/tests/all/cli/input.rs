//! Invalid scenes, models, maps, budgets and arguments are named.

use std::fs;

use bevy_frugal_gi::frontier::{Capture, FrontierMap};
use frugal::scene;

use super::{
    AT, OUTPUT, SCENE, assert_refused, command, entries, folder, refused_evaluation, run,
    scene_with_map, triangle, write,
};

tests!(
    scenes_that_cannot_be_read_are_named,
    models_that_cannot_be_read_are_named,
    maps_that_cannot_be_used_are_named,
    invalid_budgets_are_named,
    a_scene_without_paths_asks_for_a_recording,
    invalid_arguments_are_named,
    options_that_would_be_ignored_are_refused,
    misspelt_names_get_the_nearest_one,
    meters_read_the_files_of_another_root,
);

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
    assert!(scene::load(folder.path().join("a.scene.ron")).is_ok(), "the complete file is valid");
    let model = run(folder.path(), &[&["render", "a.glb"][..], &AT].concat());
    assert_refused(&model, &["a.glb", "give a scene file, *.scene.ron"]);
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
    check(Some(&text.replacen("version:1", "version:3", 1)), &["version 3"]);
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

fn a_scene_without_paths_asks_for_a_recording() {
    let folder = folder();
    scene_with_map(folder.path());
    let start = SCENE.split("paths:").next().unwrap_or_default();
    write(folder.path(), "a.scene.ron", &format!("{start})"));
    let words = ["no path `tour`", "give a recording to --path"];
    refused_evaluation(folder.path(), &["--power-budget", "60%"], &words);
    let precompute = ["precompute", "a.scene.ron", "--path", "tour"];
    assert_refused(&run(folder.path(), &precompute), &["give a recording to --cameras"]);
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
        (&["plot-log", "missing.csv"], &["missing.csv", "ControlLogPlugin"]),
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

fn options_that_would_be_ignored_are_refused() {
    let folder = folder();
    scene_with_map(folder.path());
    let one = ["--error-budget", "0.02"];
    let several = ["--error-budget", "0.02", "--error-budget", "0.03", "--baselines", "all"];
    let none = ["--error-budget", "0.02", "--baselines", "none"];
    let refused = |budgets: &[&str], more: &[&str]| {
        refused_evaluation(folder.path(), &[budgets, more].concat(), &[more[0]]);
    };
    refused(&several, &["--csv", "frames.csv"]);
    refused(&several, &["--report", "report"]);
    refused(&one, &["--spot-checks", "2"]);
    refused(&none, &["--spot-checks", "2"]);
    refused(&one, &["--overwrite"]);

    let before = entries(folder.path());
    let direct = ["--component", "direct", "--bounces", "2", "-o", "a.png"];
    for (arguments, words) in [
        (
            &["precompute", "a.scene.ron", "--shard", "0/2", "--time-limit", "1m"][..],
            &["--shard", "--time-limit"][..],
        ),
        (&["precompute", "a.scene.ron", "--resume", "--overwrite"], &["--resume", "--overwrite"]),
        (&["inspect", "a.pareto.ron", "--any-device"], &["--compare"]),
        (&[&["render", "a.scene.ron", "--meter", "work"][..], &AT].concat(), &["--meter"]),
        (&[&["reference", "a.scene.ron"][..], &AT, &direct].concat(), &["--bounces", "direct"]),
    ] {
        assert_refused(&run(folder.path(), arguments), words);
    }
    assert_eq!(entries(folder.path()), before, "files appeared");
}

fn misspelt_names_get_the_nearest_one() {
    let folder = folder();
    scene_with_map(folder.path());
    let misspelt = SCENE.replace("luminous_power", "luminous_powr");
    write(folder.path(), "field.scene.ron", &misspelt);
    let budget = ["--map", "a.pareto.ron", "--power-budget", "60%"];
    for (arguments, name) in [
        (&["precompute", "a.scene.ron", "--path", "tuor"][..], "tour"),
        (&[&["evaluate", "a.scene.ron", "--path", "Tour"][..], &budget].concat(), "tour"),
        (&[&["render", "field.scene.ron"][..], &AT].concat(), "luminous_power"),
    ] {
        assert_refused(&run(folder.path(), arguments), &[&format!("did you mean `{name}`?")]);
    }
}

fn meters_read_the_files_of_another_root() {
    let folder = folder();
    let rail = folder.path().join("sys/bus/iio/devices/iio:device0");
    fs::create_dir_all(&rail).expect("a folder");
    for (file, text) in [("rail_name_0", "POM_5V_IN"), ("in_power0_input", "4838")] {
        write(&rail, file, text);
    }
    let mut command = command(folder.path(), &["meters"]);
    let output = command.env("FRUGAL_SYS_ROOT", folder.path()).output().expect("it runs");
    let text = String::from_utf8_lossy(&output.stdout);
    let (_, jetson) = text.split_once("\njetson ").expect("a meter");
    let (jetson, others) = jetson.split_once("\nbattery ").expect("a meter");
    assert!(jetson.contains("POM_5V_IN") && jetson.contains("idle 4.84 W"), "{jetson}");
    assert!(others.contains("no battery of the machine"), "{others}");
}
