//! What AMD's GPUs run for each compute shader of the plugin: registers, spills and instructions, without such a GPU.
//!
//! `make bench BENCH=isa [ARGS='vangogh navi22 gfx1100']`
//!
//! 1. A child renders a small scene with Mesa's software driver, which writes down every SPIR-V module that it is given.
//! 2. A child for each GPU compiles those modules with Mesa's driver for AMD. `RADV_FORCE_FAMILY` gives that driver a device that
//!    compiles and never runs. The numbers are the compiler's: they change with Mesa's version, which is printed.
//!
//! A shader that the scene compiles in several variants has the row of its largest. Needs Linux and Mesa's drivers, as
//! `scripts/setup` installs them.

mod compile;
mod module;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::{env, fs};

use bevy::material::OpaqueRendererMethod;
use bevy::math::Vec3;
use bevy::prelude::{Cuboid, Transform};
use compile::Statistics;
use frugal_tests::table::markdown;
use frugal_tests::{folder, meshes, set};
use module::ComputeModule;

/// The GPUs of the Steam Deck, of a Radeon RX 6700 and of an RX 7900.
const FAMILIES: [&str; 3] = ["vangogh", "navi22", "gfx1100"];
/// Between them, these compile every shader of the gather, the maps, the cache and the filters.
const SETTINGS: [&str; 5] = [
    "max",
    "max,gi_visibility=coarse",
    "max,gi_visibility=cached",
    "max,gi_visibility=none",
    "max,gi_pixel_fraction=1/4,resolution_scale=70%",
];
/// Frames for each of the settings: pipelines come a frame or two after they are asked for.
const FRAMES: u32 = 6;

fn main() {
    let arguments: Vec<String> = env::args().skip(1).filter(|text| text != "--bench").collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["--render"] => render(),
        ["--compile", folder] => {
            let [driver, rows @ ..] = &compile::all(&modules(Path::new(folder)))[..] else {
                panic!("no driver")
            };
            println!("{driver}");
            rows.iter().for_each(|row| println!("{row}"));
        }
        [] => report(&FAMILIES),
        ref families => report(families),
    }
}

fn render() {
    let mut stage = set::open(&set::scene("courtyard"), set::options(64, 64));
    // Lights what is not deferred, and bounces twice.
    let mut material = meshes::diffuse(0.7, 0.7, 0.7);
    material.opaque_render_method = OpaqueRendererMethod::Forward;
    let at = Transform::from_xyz(0.0, 1.0, 0.0);
    meshes::spawn(&mut stage, Cuboid::from_length(0.4).into(), material, at);
    set::look(&mut stage, Vec3::new(3.0, 1.6, 3.0), Vec3::Y);
    set::gi(&mut stage).bounces = 2;
    for settings in SETTINGS {
        set::apply(&mut stage, settings);
        (0..FRAMES).for_each(|_| stage.frame());
    }
}

/// The plugin's entry points, as its sources name them.
fn entry_points() -> BTreeSet<String> {
    let files = folder::files(&folder::workspace().join("plugin/src"), "wgsl");
    let name = |shader: &str| {
        let (_, function) = shader.split_once("fn ")?;
        function.split_once('(').map(|(name, _)| name.to_owned())
    };
    files
        .expect("the plugin's sources")
        .iter()
        .map(|file| fs::read_to_string(file).expect("a shader"))
        .flat_map(|text| text.split("@compute").skip(1).filter_map(name).collect::<Vec<_>>())
        .collect()
}

/// The compute modules of the plugin in a folder of dumps; those of Bevy and of tests are left out.
fn modules(folder: &Path) -> Vec<ComputeModule> {
    let known = entry_points();
    let files = fs::read_dir(folder).expect("the folder of the dumps");
    let mut modules: Vec<ComputeModule> = files
        .filter_map(|file| ComputeModule::read(&file.expect("a file").path()))
        .filter(|module| known.contains(&module.entry_point))
        .collect();
    modules.sort_by(|a, b| (&a.entry_point, &a.words).cmp(&(&b.entry_point, &b.words)));
    modules.dedup_by(|a, b| a.words == b.words);
    modules
}

/// This program again, with a driver's manifest.
fn child(manifest: &Path) -> Command {
    let mut command = Command::new(env::current_exe().expect("this program's own path"));
    // Older loaders know the second name alone. A cache would compile nothing.
    for name in ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"] {
        command.env(name, manifest);
    }
    command.env("MESA_SHADER_CACHE_DISABLE", "1");
    command
}

fn manifest(driver: &str) -> PathBuf {
    let folders = ["/usr/share/vulkan/icd.d", "/etc/vulkan/icd.d"];
    let files = folders.iter().filter_map(|folder| fs::read_dir(folder).ok()).flatten().flatten();
    files
        .map(|file| file.path())
        .find(|path| {
            path.file_name().is_some_and(|name| name.to_string_lossy().starts_with(driver))
        })
        .unwrap_or_else(|| panic!("no {driver}*.json in {folders:?}: install mesa-vulkan-drivers"))
}

fn report(families: &[&str]) {
    let dumps = tempfile::tempdir().expect("a temporary folder");
    let software =
        env::var_os("VK_DRIVER_FILES").map_or_else(|| manifest("lvp_icd"), PathBuf::from);
    let status = child(&software)
        .arg("--render")
        .env("MESA_SPIRV_DUMP_PATH", dumps.path())
        .stdout(Stdio::null())
        .status()
        .expect("a child that renders");
    assert!(status.success(), "rendering failed: {status}");
    let mut missing = entry_points();

    let radeon = manifest("radeon_icd");
    for family in families {
        let output = child(&radeon)
            .args(["--compile".as_ref(), dumps.path()])
            .env("RADV_FORCE_FAMILY", family)
            .stderr(Stdio::inherit())
            .output()
            .expect("a child that compiles");
        assert!(output.status.success(), "compiling for {family} failed: {}", output.status);
        let text = String::from_utf8_lossy(&output.stdout);
        let mut lines = text.lines();
        println!("\n{family}: {}\n", lines.next().unwrap_or_default());

        let mut shaders: BTreeMap<String, (Statistics, u32)> = BTreeMap::new();
        for row in lines {
            let (name, statistics) = Statistics::parse(row).unwrap_or_else(|| panic!("{row}"));
            missing.remove(&name);
            let (largest, variants) = shaders.entry(name).or_default();
            *largest = statistics.max(*largest);
            *variants += 1;
        }
        let headers: Vec<&str> = ["shader", "variants"]
            .into_iter()
            .chain(Statistics::NAMES.map(|(_, header)| header))
            .collect();
        let rows: Vec<Vec<String>> = shaders
            .iter()
            .map(|(name, (largest, variants))| {
                let numbers = largest.0.iter().map(u64::to_string);
                [name.clone(), variants.to_string()].into_iter().chain(numbers).collect()
            })
            .collect();
        println!("{}", markdown(&headers, &rows));
    }
    println!("\nNot compiled in this scene: {missing:?}");
}
