//! Commands that render nothing: they need no adapter.

use std::fs;

use bevy_frugal_gi::frontier::{Capture, CostPoint, Frontier, FrontierMap, FrontierPoint, Octree};
use bevy_frugal_gi::knobs::{Knob, KnobSpace};
use bevy_frugal_gi_tools::control_log::ControlSample;
use bevy_frugal_gi_tools::row_log::rows_to_text;
use frugal_tests::map;

use super::{AT, NO_ADAPTER, SCENE, assert_refused, command, entries, folder, run, stderr, write};

tests!(
    references_are_traced_and_compared_without_an_adapter,
    maps_that_cost_more_have_their_own_exit_status,
    watts_of_two_devices_are_not_compared,
    presets_come_from_a_map,
    control_logs_are_plotted,
);

fn references_are_traced_and_compared_without_an_adapter() {
    let folder = folder();
    write(folder.path(), "a.scene.ron", SCENE);
    let run = |arguments: &[&str]| {
        let mut command = command(folder.path(), arguments);
        command.envs(NO_ADAPTER);
        let output = command.output().expect("starts");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8_lossy(&output.stdout).into_owned()
    };
    let trace = |rest: &[&str]| {
        run(&[&["reference", "a.scene.ron", "--lambertian", "--spp", "16"][..], &AT, rest].concat())
    };
    trace(&["--size", "32x18", "--component", "direct", "--hdr", "direct.exr"]);
    let once = ["--size", "32x18", "--component", "indirect", "--bounces", "1"];
    trace(&[&once[..], &["--hdr", "once.exr", "-o", "once.png"]].concat());
    trace(&["--size", "16x16", "--hdr", "small.exr"]);
    trace(&[&once[..], &["--guide", "photons", "--hdr", "guided.exr"]].concat());
    // The furnace's walls reflect 80 %: the first bounce is 80 % of the direct light, guided or not.
    for image in ["once.exr", "guided.exr"] {
        run(&["compare", image, "direct.exr", "--json", "difference.json"]);
        let json = fs::read_to_string(folder.path().join("difference.json")).expect("was written");
        let ratio = json
            .lines()
            .find_map(|line| line.trim().strip_prefix("\"mean_ratio\": "))
            .expect("is there");
        let ratio: f64 = ratio.trim_end_matches(',').parse().expect("a number");
        assert!((ratio - 0.8).abs() < 0.005, "{image}: {json}");
    }
    assert_refused(
        &super::run(folder.path(), &["compare", "small.exr", "once.exr", "--json", "none.json"]),
        &["small.exr", "32×18", "16×16"],
    );
    assert_eq!(
        entries(folder.path()),
        [
            "a.scene.ron",
            "difference.json",
            "direct.exr",
            "guided.exr",
            "once.exr",
            "once.png",
            "small.exr"
        ]
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

fn watts_of_two_devices_are_not_compared() {
    let folder = folder();
    let save = |name: &str, description: &str, scale: f64| {
        let mut map = map_of_cost(scale);
        map.meter.name = "amdgpu".into();
        map.meter.description = description.into();
        write(folder.path(), name, &map.to_ron().expect("text"));
    };
    save(
        "old.ron",
        "whole card or APU 0000:03:00.0 (card0, PPT), power1_average of its driver",
        1.0,
    );
    let other = "whole card or APU 0000:0b:00.0 (card1, slowPPT), power1_input of its driver";
    save("new.ron", other, 1.12);
    save("low.ron", other, 0.8);
    save(
        "same.ron",
        "whole card or APU 0000:03:00.0 (card1, PPT), power1_average of its driver",
        1.0,
    );
    let compare = |new: &str, more: &[&str]| {
        run(folder.path(), &[&["inspect", "--compare", "old.ron", new][..], more].concat())
    };
    for new in ["new.ron", "low.ron"] {
        let words = ["0000:03:00.0", "0000:0b:00.0", "frugal reprice", "--prices", "--any-device"];
        assert_refused(&compare(new, &["--json", "gate.json"]), &words);
    }
    assert!(!folder.path().join("gate.json").exists());
    let any = |new: &str| compare(new, &["--any-device"]).status.code();
    assert_eq!((any("new.ron"), any("low.ron")), (Some(3), Some(0)));
    assert_eq!(compare("same.ron", &[]).status.code(), Some(0), "the card got another number");
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

fn control_logs_are_plotted() {
    let folder = folder();
    let sample = |time_s: f64, power: f64| ControlSample {
        time_s,
        status: "met".into(),
        power_budget_w: Some(5.0),
        predicted_w: Some(power),
        metered_w: Some(power),
        meter: "simulated (modelled)".into(),
        ..ControlSample::default()
    };
    let text =
        rows_to_text(&[sample(0.0, 4.0), sample(0.5, 6.5), sample(1.5, 4.0), sample(0.0, 3.0)]);
    write(folder.path(), "play.csv", &text);
    let output = run(folder.path(), &["plot-log", "play.csv"]);
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{}", stderr(&output));
    for text in ["run 1, camera 0", "run 2, camera 0", "1 of 2 windows", "simulated (modelled)"] {
        assert!(said.contains(text), "{text}: {said}");
    }
    let page = fs::read_to_string(folder.path().join("play.report/report.html")).expect("a page");
    assert_eq!(page.matches("<svg ").count(), 2);

    write(folder.path(), "odd.csv", &text.replacen("5.0", "five", 1));
    let refused = run(folder.path(), &["plot-log", "odd.csv", "-o", "none"]);
    assert_refused(&refused, &["odd.csv", "line 2", "power_budget_w", "five", "correct the line"]);
    write(folder.path(), "empty.csv", &rows_to_text::<ControlSample>(&[]));
    assert_refused(&run(folder.path(), &["plot-log", "empty.csv"]), &["empty.csv", "no samples"]);
    assert_refused(&run(folder.path(), &["report", "missing.csv"]), &["missing.csv"]);
    let left = entries(folder.path());
    assert!(!left.iter().any(|name| name == "none" || name == "empty.report"), "{left:?}");
}
