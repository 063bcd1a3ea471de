//! Whole runs on counted work, which is the same on every machine.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};
use std::thread;
use std::time::{Duration, Instant};

use bevy_frugal_gi::frontier::FrontierMap;

use super::{
    assert_refused, command, entries, folder, run, scene_with_map, stderr, tiny_scene, write,
};

tests!(
    several_processes_shards_and_merged_journals_make_the_same_map,
    prices_of_a_device_reprice_a_map,
    an_interrupted_calibration_writes_nothing,
    a_quick_evaluation_is_checked_by_a_real_play,
);

const SEARCH: [&str; 10] = [
    "--size",
    "32x32",
    "--levels",
    "0",
    "--training",
    "6",
    "--knobs",
    "antialiasing,post_processing",
    "--meter",
    "work",
];

fn precompute(folder: &Path, map: &str, more: &[&str]) -> Output {
    run(folder, &[&["precompute", "a.scene.ron", "-o", map][..], &SEARCH, more].concat())
}

fn succeeds(output: &Output) -> String {
    assert!(output.status.success(), "{}", stderr(output));
    String::from_utf8_lossy(&output.stdout).into_owned()
}

fn several_processes_shards_and_merged_journals_make_the_same_map() {
    let folder = tiny_scene();
    let read = |name: &str| fs::read(folder.path().join(name)).expect("a file");
    // Processes would disturb what another meter reads.
    let metered = ["precompute", "a.scene.ron", "--workers", "3"];
    assert_refused(&run(folder.path(), &metered), &["--workers 3", "--meter work"]);
    succeeds(&precompute(folder.path(), "whole.pareto.ron", &[]));
    succeeds(&precompute(folder.path(), "side.pareto.ron", &["--workers", "3"]));
    assert!(read("side.pareto.ron") == read("whole.pareto.ron"), "another map");
    let journals = ["a.pareto.ron.0-of-2.journal", "a.pareto.ron.1-of-2.journal"];
    for shard in ["0/2", "1/2"] {
        let output = precompute(folder.path(), "a.pareto.ron", &["--shard", shard, "--resume"]);
        let message = stderr(&output);
        assert_eq!(output.status.code(), Some(1), "{message}");
        assert!(message.contains("share is rendered") && message.contains("--resume"), "{message}");
    }
    let before = journals.map(read);
    // The second had what the first rendered, and went on to its share of what comes next.
    let stages = |journal: &[u8]| {
        let text = String::from_utf8_lossy(journal).into_owned();
        text.lines().filter(|line| line.starts_with("settings ")).count()
    };
    assert!(stages(&before[1]) > stages(&before[0]), "{:?}", before.each_ref().map(|b| stages(b)));
    let said = succeeds(&run(folder.path(), &[&["merge"][..], &journals].concat()));
    assert!(said.contains(" records in a.pareto.ron.journal"), "{said}");
    let said = succeeds(&run(folder.path(), &["merge", journals[0], "-o", "first.journal"]));
    assert!(said.contains(" records in first.journal"), "{said}");
    // The whole search goes on where the shards are.
    succeeds(&precompute(folder.path(), "a.pareto.ron", &["--resume"]));
    assert!(read("a.pareto.ron") == read("whole.pareto.ron"), "another map");
    assert_eq!(journals.map(read), before, "journals of shards are read alone");
    assert!(!folder.path().join("a.pareto.ron.journal").exists(), "nothing is left to resume");
}

fn prices_of_a_device_reprice_a_map() {
    let folder = tiny_scene();
    succeeds(&precompute(folder.path(), "a.pareto.ron", &[]));
    let calibrate = ["calibrate", "a.scene.ron", "--size", "32x32", "--time-limit", "15s"];
    let of = ["--knobs", "antialiasing,post_processing", "--meter", "work", "-o", "b.prices.ron"];
    let said = succeeds(&run(folder.path(), &[calibrate, of].concat()));
    assert!(said.contains(" readings at 6 cameras") && said.contains("held-out"), "{said}");
    let at = ["--fps", "60", "--size", "64x64", "-o", "b.pareto.ron"];
    let reprice = [&["reprice", "a.pareto.ron", "--prices", "b.prices.ron"][..], &at].concat();
    let said = succeeds(&run(folder.path(), &reprice));
    assert!(said.contains("the shared frontier went from"), "{said}");
    let map = |name: &str| {
        let text = fs::read_to_string(folder.path().join(name)).expect("a map");
        FrontierMap::from_ron(&text).expect("a valid map")
    };
    let (old, new) = (map("a.pareto.ron"), map("b.pareto.ron"));
    assert_eq!((new.capture.size, new.capture.frames_per_second), ([64, 64], 60.0));
    // Four times the pixels, twice as often.
    let power = |map: &FrontierMap| map.shared.points().last().expect("a point").cost.power.0;
    let ratio = power(&new) / power(&old);
    assert!((2.0..8.5).contains(&ratio), "{ratio}");
    let errors = |map: &FrontierMap| {
        map.shared.points().iter().map(|point| point.cost.error).collect::<Vec<_>>()
    };
    assert_eq!(errors(&new), errors(&old), "errors stay");
}

/// Whether the process of this number has a handler of SIGINT.
fn catches_interrupts(id: u32) -> bool {
    let status = fs::read_to_string(format!("/proc/{id}/status")).unwrap_or_default();
    let caught = status.lines().find_map(|line| line.strip_prefix("SigCgt:"));
    caught.is_some_and(|mask| u64::from_str_radix(mask.trim(), 16).is_ok_and(|mask| mask & 2 != 0))
}

fn an_interrupted_calibration_writes_nothing() {
    let folder = tiny_scene();
    write(folder.path(), "b.prices.ron", "precious");
    let calibrate = ["calibrate", "a.scene.ron", "--size", "32x32", "--time-limit", "10m"];
    let of = ["--knobs", "antialiasing,post_processing", "--meter", "work", "-o", "b.prices.ron"];
    let child = command(folder.path(), &[calibrate, of].concat()).spawn().expect("starts");
    let start = Instant::now();
    // From the first reading on.
    while !catches_interrupts(child.id()) {
        assert!(start.elapsed() < Duration::from_secs(120), "no reading in two minutes");
        thread::sleep(Duration::from_millis(20));
    }
    // Enough readings for a fit.
    thread::sleep(Duration::from_secs(5));
    let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    assert!(sent.is_ok_and(|status| status.success()));
    let output = child.wait_with_output().expect("ends");
    let message = stderr(&output);
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(message.contains("frugal: interrupted: nothing was written"), "{message}");
    let left = fs::read_to_string(folder.path().join("b.prices.ron")).expect("still there");
    assert_eq!(left, "precious");
}

fn a_quick_evaluation_is_checked_by_a_real_play() {
    let folder = folder();
    let map = scene_with_map(folder.path());
    let map = FrontierMap { shared: map.octree.frontiers[0].clone(), ..map };
    write(folder.path(), "a.pareto.ron", &map.to_ron().expect("text"));
    let before = entries(folder.path());
    let evaluate = ["evaluate", "a.scene.ron", "--map", "a.pareto.ron", "--meter", "work"];
    let outputs = ["--error-budget", "0.02", "--json", "out.json", "--report", "page"];
    let said = succeeds(&run(folder.path(), &[&evaluate[..], &outputs].concat()));
    for words in ["The frugal run rendered: ", "trained-constant", "mid-min"] {
        assert!(said.contains(words), "{words} in: {said}");
    }
    let json = fs::read_to_string(folder.path().join("out.json")).expect("a result");
    assert!(json.contains("\"spot_check\"") && json.contains("\"repeat_mean_error\""), "{json}");
    let page = fs::read_to_string(folder.path().join("page/report.html")).expect("a page");
    // Means, and power and error along the path.
    assert_eq!(page.matches("<svg ").count(), 3, "{said}");
    let mut after = entries(folder.path());
    after.retain(|name| !["out.json", "page"].contains(&name.as_str()));
    assert_eq!(after, before, "no record is left");
}
