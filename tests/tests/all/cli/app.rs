//! An app in place of a scene file: its own knob and camera, and what goes wrong with apps.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;
use std::thread;
use std::time::{Duration, Instant};

use bevy_frugal_gi::frontier::FrontierMap;
use frugal_trace::metrics::{Picture, Reference};

use super::{assert_refused, command, entries, folder, run, stderr};

tests!(
    an_app_renders_from_where_it_is_told_at_its_own_knob_s_levels,
    an_app_gets_a_map_of_its_own_knob_and_results_even_where_it_breaks,
    what_is_no_stage_is_one_clear_error,
    an_app_that_fails_is_one_clear_error,
    an_app_that_crashes_once_is_started_anew,
    an_app_killed_at_any_time_leaves_a_journal_and_no_orphan,
    nothing_survives_the_tool,
);

/// The app with a fault. `mark` is in the command lines of all that belongs to it.
fn app(mark: &Path, fault: &str) -> String {
    let program = env!("CARGO_BIN_EXE_small_app");
    format!("SMALL_APP='{fault}' '{program}' '{}'", mark.display())
}

/// Renders one image of an app.
fn render(folder: &Path, app: &str, more: &[&str]) -> Output {
    let at = ["--position", "0,1.5,4", "--look-at", "0,0.5,0", "--size", "48x32"];
    run(folder, &[&["render", "--app", app][..], &at, more].concat())
}

fn picture(folder: &Path, app: &str, more: &[&str]) -> Picture {
    let done = render(folder, app, &[&["-o", "a.png"][..], more].concat());
    assert!(done.status.success(), "{}", stderr(&done));
    Picture::read_png(&folder.join("a.png")).expect("an image")
}

/// Process ids of those whose command line names `mark`.
fn running(mark: &Path) -> Vec<u32> {
    let mark = mark.display().to_string();
    let entries = fs::read_dir("/proc").into_iter().flatten().flatten();
    let is_ours = |id: &u32| {
        let line = fs::read(format!("/proc/{id}/cmdline")).unwrap_or_default();
        String::from_utf8_lossy(&line).contains(&mark)
    };
    let ids = entries.filter_map(|entry| entry.file_name().to_str()?.parse().ok());
    ids.filter(is_ours).collect()
}

fn assert_none_left(mark: &Path) {
    let start = Instant::now();
    while !running(mark).is_empty() {
        assert!(start.elapsed() < Duration::from_secs(10), "still there: {:?}", running(mark));
        thread::sleep(Duration::from_millis(20));
    }
}

/// Asserts exit status 1 and one message with all of `words`, and that nothing is left running.
fn assert_fails(output: &Output, mark: &Path, words: &[&str]) {
    let message = stderr(output);
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert_eq!(message.matches("frugal: ").count(), 1, "{message}");
    words.iter().for_each(|word| assert!(message.contains(word), "`{word}` in: {message}"));
    assert!(message.len() < 20_000, "{} bytes", message.len());
    assert_none_left(mark);
}

fn mean(picture: &Picture) -> f64 {
    let sum: u64 = picture.rgb.iter().flatten().map(|value| u64::from(*value)).sum();
    sum as f64 / (3 * picture.rgb.len()) as f64
}

fn an_app_renders_from_where_it_is_told_at_its_own_knob_s_levels() {
    let folder = folder();
    let app = app(folder.path(), "");
    let best = picture(folder.path(), &app, &[]);
    let again = picture(folder.path(), &app, &[]);
    // Its parent turns while the level loads, for a different number of frames each time.
    let error = Reference::new(&best).and_then(|it| it.error(&again)).expect("an error");
    assert!(error < 1e-3, "the same place, whatever the app does: {error}");
    let dim = picture(folder.path(), &app, &["--settings", "lamps=1"]);
    assert!(mean(&dim) < 0.8 * mean(&best), "{} and {}", mean(&dim), mean(&best));
    let unknown = render(folder.path(), &app, &["--settings", "lamp=1"]);
    assert_eq!(unknown.status.code(), Some(2), "{}", stderr(&unknown));
    assert!(stderr(&unknown).contains("did you mean `lamps`?"), "{}", stderr(&unknown));
    let hdr = render(folder.path(), &app, &["--hdr", "a.exr"]);
    assert!(hdr.status.success(), "{}", stderr(&hdr));
    assert!(folder.path().join("a.exr").exists());
    assert_none_left(folder.path());
}

/// Arguments of a quick search.
const SEARCH: [&str; 12] = [
    "-o",
    "a.pareto.ron",
    "--size",
    "32x32",
    "--levels",
    "0",
    "--training",
    "6",
    "--knobs",
    "lamps,antialiasing",
    "--meter",
    "work",
];

/// A recorded walk beside the app's block.
fn walk(folder: &Path) -> PathBuf {
    use bevy::math::{Quat, Vec3};
    use bevy_frugal_gi::frontier::CameraView;
    use bevy_frugal_gi_tools::recording::CameraSample;
    use bevy_frugal_gi_tools::row_log::rows_to_text;
    let sample = |step: u32| {
        let position = Vec3::new(-1.0 + 0.1 * step as f32, 1.5, 3.5);
        let view =
            CameraView { position, rotation: Quat::IDENTITY, vertical_fov: 0.8, aspect: 1.0 };
        CameraSample::new(0.25 * f64::from(step), 0, &view)
    };
    let file = folder.join("walk.cameras");
    fs::write(&file, rows_to_text(&(0..12).map(sample).collect::<Vec<_>>())).expect("room");
    file
}

fn search(folder: &Path, app: &str, more: &[&str]) -> Vec<String> {
    let walk = walk(folder).display().to_string();
    let arguments = ["precompute", "--app", app, "--cameras", &walk];
    [&arguments[..], &SEARCH, more].concat().into_iter().map(str::to_owned).collect()
}

fn an_app_gets_a_map_of_its_own_knob_and_results_even_where_it_breaks() {
    let folder = folder();
    let [app, broken] = ["", "breaks when dimmed"].map(|fault| app(folder.path(), fault));
    let arguments = search(folder.path(), &app, &[]);
    let done = run(folder.path(), &arguments.iter().map(String::as_str).collect::<Vec<_>>());
    assert!(done.status.success(), "{}", stderr(&done));
    let text = fs::read_to_string(folder.path().join("a.pareto.ron")).expect("a map");
    let map = FrontierMap::from_ron(&text).expect("a map");
    assert_eq!(map.scene.name, "small_app");
    assert!(map.knobs.index_of("lamps").is_some());
    // The knob is on the frontier: fewer lamps are an error.
    let lamps = map.knobs.index_of("lamps").expect("the knob");
    let levels: Vec<usize> =
        map.shared.points().iter().map(|point| point.settings.level(lamps)).collect();
    assert!(levels.contains(&2), "{levels:?}");
    let walk = walk(folder.path()).display().to_string();
    let evaluate = |app: &str, more: &[&str]| {
        let of_map = ["evaluate", "--app", app, "--map", "a.pareto.ron", "--path", &walk];
        let budget = ["--error-budget", "0.05", "--record", "walk.record"];
        run(folder.path(), &[&of_map[..], &budget, more].concat())
    };
    let played = evaluate(&app, &[]);
    assert!(played.status.success(), "{}", stderr(&played));
    assert_none_left(folder.path());
    // All is recorded: only the spot check renders.
    let played = evaluate(&broken, &["--json", "out.json"]);
    assert_fails(&played, folder.path(), &["lack their spot check", "lamps are broken"]);
    let table = String::from_utf8_lossy(&played.stdout);
    assert!(table.contains("maximum"), "{table}");
    let json = fs::read_to_string(folder.path().join("out.json")).expect("a result");
    assert!(json.contains("\"maximum\"") && !json.contains("\"spot_check\""), "{json}");
}

fn what_is_no_stage_is_one_clear_error() {
    let folder = folder();
    let mark = folder.path();
    let words = ["StagePlugin", "`stage`"];
    let no_app = format!("true '{}'", mark.display());
    assert_fails(&render(mark, &no_app, &[]), mark, &[&words[..], &["ended before"]].concat());
    let missing = format!("'{}/no_such_app'", mark.display());
    assert_fails(&render(mark, &missing, &[]), mark, &[&words[..], &["no_such_app"]].concat());
    // Another program that goes on, with children of its own.
    let other = format!("sh -c 'sleep 1000 & wait' '{}'", mark.display());
    let waited = render(mark, &other, &["--patience", "1s"]);
    assert_fails(&waited, mark, &["did not connect within 1 s", "--patience"]);
    let loud = format!("echo begin '{}'; yes | head -c 30000000; echo end; exit 3", mark.display());
    assert_fails(&render(mark, &loud, &[]), mark, &["ended before", "end"]);
    let old = render(mark, &app(mark, "old"), &[]);
    assert_refused(&old, &["9.8.7", env!("CARGO_PKG_VERSION"), "one version"]);
    assert_none_left(mark);
    let both = run(mark, &["render", "a.scene.ron", "--app", "true"]);
    assert_refused(&both, &["--app"]);
    assert_eq!(entries(mark).len(), 0, "{:?}", entries(mark));
}

fn an_app_that_fails_is_one_clear_error() {
    let folder = folder();
    let mark = folder.path();
    let patient = ["--patience", "20s"];
    for (fault, words) in [
        ("crashes", &["the small app has crashed"][..]),
        ("exits", &["the app ended itself"]),
        ("hangs", &["hangs", "20 s", "--patience"]),
        ("never ready", &["after 20 s", "`StageReady`"]),
        ("silent", &["did not connect within 20 s"]),
    ] {
        let output = render(mark, &app(mark, fault), &patient);
        println!("    {fault}: {}", stderr(&output).trim());
        assert_fails(&output, mark, words);
    }
    let refused = render(mark, &app(mark, "no level"), &["--level", "attic"]);
    assert_refused(&refused, &["no level `attic`: try `cave`"]);
    let loud = render(mark, &app(mark, "loud"), &["-o", "loud.png"]);
    assert!(loud.status.success(), "{}", stderr(&loud));
    assert!(stderr(&loud).len() < 4000, "what it says is its own business");
    assert_none_left(mark);
}

fn an_app_that_crashes_once_is_started_anew() {
    let folder = folder();
    let mark = folder.path();
    let once = mark.join("once");
    let app = format!("SMALL_APP_ONCE='{}' {}", once.display(), app(mark, "crashes"));
    let arguments = search(mark, &app, &[]);
    let done = run(mark, &arguments.iter().map(String::as_str).collect::<Vec<_>>());
    assert!(done.status.success(), "{}", stderr(&done));
    assert!(once.exists(), "it crashed");
    assert_none_left(mark);
}

fn an_app_killed_at_any_time_leaves_a_journal_and_no_orphan() {
    let folder = folder();
    let mark = folder.path();
    let app = app(mark, "");
    let mut killed = 0;
    for milliseconds in [0, 300, 900, 2000, 4000, 7000, 9000] {
        let arguments = search(mark, &app, &["--resume"]);
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        let mut child = command(mark, &arguments).spawn().expect("frugal starts");
        thread::sleep(Duration::from_millis(milliseconds));
        // Its program, and not the shell or the guard, which name it too.
        let program = PathBuf::from(env!("CARGO_BIN_EXE_small_app"));
        for id in running(mark) {
            if fs::read_link(format!("/proc/{id}/exe")).is_ok_and(|exe| exe == program) {
                kill(id);
                killed += 1;
            }
        }
        let start = Instant::now();
        while child.try_wait().expect("a child").is_none() {
            assert!(start.elapsed() < Duration::from_secs(300), "it hangs");
            thread::sleep(Duration::from_millis(20));
        }
        let output = child.wait_with_output().expect("an output");
        let message = stderr(&output);
        // It goes on with a fresh one where that was running already.
        assert!(matches!(output.status.code(), Some(0 | 1)), "{message}");
        assert_none_left(mark);
        if output.status.success() {
            fs::remove_file(mark.join("a.pareto.ron")).expect("the map");
        }
    }
    assert!(killed > 2, "{killed} were there");
}

fn kill(id: u32) {
    let killed = std::process::Command::new("kill").args(["-9", &id.to_string()]).status();
    assert!(killed.is_ok());
}

fn nothing_survives_the_tool() {
    let folder = folder();
    let mark = folder.path();
    // What a build starts knows nothing of the tool.
    let slow = format!("sh -c 'sleep 1000 & wait' '{}'", mark.display());
    for app in [slow, app(mark, ""), app(mark, "hangs"), app(mark, "never ready")] {
        for milliseconds in [50, 500, 2000, 6000] {
            let arguments = search(mark, &app, &["--overwrite"]);
            let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
            let mut child = command(mark, &arguments).spawn().expect("frugal starts");
            thread::sleep(Duration::from_millis(milliseconds));
            child.kill().expect("can be killed");
            child.wait().expect("ends");
            assert_none_left(mark);
        }
    }
}
