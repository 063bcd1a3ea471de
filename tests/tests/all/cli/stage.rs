//! Knobs, levels and meters, which only a stage can refuse: these need an adapter.

use std::fs;

use super::{
    AT, SCENE, assert_refused, entries, folder, refused_evaluation, run, scene_with_map, stderr,
    tiny_scene, write,
};

tests!(
    unknown_knobs_and_meters_are_named,
    misspelt_knobs_and_levels_get_the_nearest_one,
    watts_of_another_meter_are_not_mixed_with_a_map_s,
    a_search_without_a_camera_is_refused_before_it_begins,
    several_processes_record_the_same_path,
);

fn unknown_knobs_and_meters_are_named() {
    let folder = folder();
    write(folder.path(), "a.scene.ron", SCENE);
    for (option, value, words) in [
        ("--knobs", "sharpness", &["sharpness", "gi_vpl_count"][..]),
        ("--meter", "crystal-ball", &["crystal-ball"]),
    ] {
        assert_refused(&run(folder.path(), &["precompute", "a.scene.ron", option, value]), words);
    }
    assert_eq!(entries(folder.path()), ["a.scene.ron"], "files appeared");
}

fn misspelt_knobs_and_levels_get_the_nearest_one() {
    let folder = folder();
    write(folder.path(), "a.scene.ron", SCENE);
    let precompute = |knobs: &str| {
        run(folder.path(), &["precompute", "a.scene.ron", "--size", "32x18", "--knobs", knobs])
    };
    let render = |settings: &str| {
        let arguments = ["render", "a.scene.ron", "--size", "32x18", "--settings", settings];
        run(folder.path(), &[&arguments[..], &AT].concat())
    };
    for (refused, name) in [
        (precompute("gi_vpl_cuont"), "gi_vpl_count"),
        // An opt-in knob, which is in a space only where it is named.
        (precompute("gi_bounce"), "gi_bounces"),
        (render("gi_bounce=2"), "gi_bounces"),
        (render("gi_visibility=Fine"), "fine"),
    ] {
        assert_refused(&refused, &[&format!("did you mean `{name}`?")]);
    }
}

fn watts_of_another_meter_are_not_mixed_with_a_map_s() {
    let folder = folder();
    scene_with_map(folder.path());
    // The map's name opens a meter here, of another description than the map's.
    let words = ["a.pareto.ron", "by hand", "CPU time of this process", "--meter cpu-time=5"];
    refused_evaluation(folder.path(), &["--error-budget", "0.02"], &words);
}

fn a_search_without_a_camera_is_refused_before_it_begins() {
    let folder = tiny_scene();
    let far = r#"(geometry: Gltf("a.glb"), bounds: (min: (900, 900, 900), max: (901, 901, 901)))"#;
    write(folder.path(), "a.scene.ron", far);
    let before = entries(folder.path());
    let search = ["precompute", "a.scene.ron", "--size", "32x32", "--meter", "work"];
    let words = ["a.scene.ron: no camera in free space sees the scene", "--cameras"];
    assert_refused(&run(folder.path(), &search), &words);
    assert_eq!(entries(folder.path()), before, "files appeared");
}

fn several_processes_record_the_same_path() {
    let folder = folder();
    scene_with_map(folder.path());
    let evaluate = |options: &[&str]| {
        let of_map = ["--map", "a.pareto.ron", "--error-budget", "0.02", "--baselines", "all"];
        run(folder.path(), &[&["evaluate", "a.scene.ron"][..], &of_map, options].concat())
    };
    // The map's own meter reads the machine.
    assert_refused(&evaluate(&["--workers", "2"]), &["--workers 2", "--meter work"]);
    let result = |workers: &str| {
        let (json, record) = (format!("{workers}.json"), format!("{workers}.record"));
        let options = ["--meter", "work", "--workers", workers, "--json", &json];
        let done = evaluate(&[&options[..], &["--record", &record]].concat());
        assert!(done.status.success(), "{}", stderr(&done));
        fs::read_to_string(folder.path().join(json)).expect("a result")
    };
    let one = result("1");
    assert!(one.contains("best-constant"), "{one}");
    assert_eq!(result("2"), one);
}
