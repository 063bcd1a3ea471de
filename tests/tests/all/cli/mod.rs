//! The `frugal` command.
//!
//! Incorrect use and invalid input give exit status 2 and one message that names the cause, touch no
//! output, and never panic.

pub(crate) mod analysis;
pub(crate) mod app;
pub(crate) mod counted;
pub(crate) mod input;
pub(crate) mod journal;
pub(crate) mod outputs;
pub(crate) mod stage;

use std::fs;
use std::path::Path;

use bevy_frugal_gi::frontier::{FrontierMap, SceneIdentity};
use bevy_frugal_gi::knobs::{Knob, KnobSpace};
use frugal::scene;
use frugal_tests::map;
use tempfile::TempDir;

use super::command::{assert_refused, command, run, stderr};

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

/// Environment in which no graphics adapter is found.
const NO_ADAPTER: [(&str, &str); 3] = [
    ("VK_ICD_FILENAMES", "/nonexistent"),
    ("VK_DRIVER_FILES", "/nonexistent"),
    ("WGPU_BACKEND", "vulkan"),
];

fn folder() -> TempDir {
    tempfile::tempdir().expect("a folder")
}

fn write(folder: &Path, name: &str, text: &str) {
    fs::write(folder.join(name), text).expect("can be written");
}

/// Names of the files in a folder, sorted.
fn entries(folder: &Path) -> Vec<String> {
    let files = fs::read_dir(folder)
        .expect("a folder")
        .map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned());
    let mut files: Vec<_> = files.collect();
    files.sort();
    files
}

/// A valid GLB of one triangle.
fn triangle() -> Vec<u8> {
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

/// One triangle without punctual lights: few views contain it, and a frame takes milliseconds.
const TINY_SCENE: &str = r#"(geometry: Gltf("a.glb"), environment: Constant((900.0, 900.0, 900.0)), camera: (vertical_fov: 50.0),
    bounds: (min: (0.1, 0.1, 0.8), max: (0.6, 0.5, 1.4)),
    paths: { "tour": [
        (time: 0.0, position: (0.3, 0.3, 1.0), look_at: (0.3, 0.3, 0.0)),
        (time: 0.3, position: (0.4, 0.3, 1.0), look_at: (0.4, 0.3, 0.0)),
    ] })"#;

/// A folder with [`TINY_SCENE`].
fn tiny_scene() -> TempDir {
    let folder = folder();
    write(folder.path(), "a.scene.ron", TINY_SCENE);
    fs::write(folder.path().join("a.glb"), triangle()).expect("can be written");
    folder
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
