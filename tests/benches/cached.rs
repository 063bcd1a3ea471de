//! The cheap end against path tracing: error and rays of cached light, and of the levels around it, after
//! a cut, at rest and while walking.
//!
//! `make bench BENCH=cached ARGS='[--size WxH] [--spp N] [--count FRAMES] [SCENE@SECONDS | SETTINGS]…'`:
//! a view is a scene of the repository, or a scene file, and a time of its tour. A walk is the tour's last
//! FRAMES frames before that, or the next ones backwards. Settings have a `=`.
//!
//! Error is relative L1 of 4×4 means of indirect light, one bounce between Lambertian surfaces without a
//! sky. References are kept in the folder of temporary files.

use bevy::math::UVec2;
use bevy_frugal_gi::gi::{FrugalGi, GiRefresh, inspect};
use frugal::scene::{CameraPath, SceneDescription};
use frugal::stage::{Component, Stage, adapter};
use frugal_tests::arguments::Arguments;
use frugal_tests::reference::{Tracing, one_bounce, view as parse_view, without_environment};
use frugal_tests::table::markdown;
use frugal_tests::{gpu, set};
use frugal_trace::integrator::Pixels;
use frugal_trace::metrics::{Difference, Radiance};

const SETTINGS: [&str; 3] = [
    "gi_visibility=cached,gi_pixel_fraction=1/16",
    "gi_visibility=coarse,gi_pixel_fraction=1/16,gi_interleave=8x8,gi_vpl_count=64,rsm_resolution=64",
    "gi_visibility=coarse,gi_pixel_fraction=1/16",
];
/// What settings leave open that do not begin with a preset, such as `default`: near the default.
const BASE: &str = "min,gi_refresh_period=1,resolution_scale=100%,gi_vpl_count=1024,gi_interleave=4x4,gi_pixel_fraction=1/4,rsm_resolution=128";
/// Frames after a cut.
const CUT: u32 = 5;
/// Frames a second.
const RATE: f32 = 60.0;

fn main() {
    if adapter().is_none() {
        println!("no graphics adapter: nothing is measured");
        return;
    }
    let options =
        Arguments { size: UVec2::new(640, 360), samples: 256, count: 60, names: vec![] }.read();
    let (settings, views): (Vec<&str>, Vec<&str>) =
        options.names.iter().map(String::as_str).partition(|name| name.contains('='));
    let settings = if settings.is_empty() { SETTINGS.to_vec() } else { settings };
    let views = if views.is_empty() { vec!["courtyard@2", "two_rooms@0"] } else { views };
    let mut rows = Vec::new();
    for view in views {
        measure(view, &settings, &options, &mut rows);
    }
    let head = [
        "view",
        "settings",
        "after a cut",
        "at rest",
        "walking",
        "mean ratio",
        "rays, most",
        "of that light",
    ];
    println!("{}", markdown(&head, &rows));
}

fn reference(view: &str, scene: &SceneDescription, seconds: f32, options: &Arguments) -> Radiance {
    let plain: String = view.chars().map(|c| if c.is_alphanumeric() { c } else { '_' }).collect();
    let (size, samples) = (options.size, options.samples);
    let name = format!("frugal-{plain}-{}x{}-{samples}.exr", size.x, size.y);
    let file = std::env::temp_dir().join(name);
    if let Ok(kept) = Radiance::read_exr(&file) {
        return kept;
    }
    let pose = tour(scene).sample(seconds).unwrap_or_else(|| panic!("{view}: no such time"));
    let tracing = Tracing { size, samples, seed: 0, pixels: Pixels::default() };
    let traced = one_bounce(scene, pose, tracing);
    let bytes = traced.to_exr().unwrap_or_else(|error| panic!("{error}"));
    std::fs::write(&file, bytes).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
    traced
}

fn tour(scene: &SceneDescription) -> &CameraPath {
    &scene.paths["tour"]
}

/// Rays of the cache so far: those that found cells, and places that were lit.
fn counters(stage: &Stage) -> [u32; 2] {
    let state = inspect::gpu_state(stage.render_world());
    let Some([keys, _]) = state.cameras.first().and_then(|camera| camera.cache.clone()) else {
        return [0; 2];
    };
    let words = gpu::words(&gpu::read_buffer(stage.render_world(), &keys));
    let end = words.len() - 4;
    [words[end], words[end + 1]]
}

/// Renders a frame at a time of the tour; returns the rays that found cells, and places that were lit.
fn frame(stage: &mut Stage, scene: &SceneDescription, seconds: f32) -> [u32; 2] {
    let pose = tour(scene).sample(seconds).expect("a pose");
    stage.place(pose.position, pose.rotation);
    let before = counters(stage);
    stage.frame();
    let after = counters(stage);
    // A cut clears them.
    [0, 1].map(|at| if after[at] >= before[at] { after[at] - before[at] } else { after[at] })
}

fn measure(view: &str, settings: &[&str], options: &Arguments, rows: &mut Vec<Vec<String>>) {
    let (scene, seconds) = parse_view(view);
    let scene = without_environment(&scene);
    let truth = reference(view, &scene, seconds, options);
    let mut stage = set::open(
        &scene,
        set::radiance_options(options.size.x, options.size.y, Component::Indirect),
    );
    // A stage gathers as if its camera moved; an app at rest averages samples.
    stage.world_mut().insert_resource(GiRefresh::OnChange);
    set::gi(&mut stage).rest_frames = FrugalGi::default().rest_frames;
    let back = options.count as f32 / RATE;
    let walk = if seconds >= back { -1.0 / RATE } else { 1.0 / RATE };
    for settings in settings {
        let begins = |preset| settings.starts_with(preset);
        let text = match ["min,", "max,", "default,"].into_iter().any(begins) {
            true => settings.to_string(),
            false => format!("{BASE},{settings}"),
        };
        set::apply(&mut stage, &text);
        set::make_lambertian(&mut stage);
        frame(&mut stage, &scene, seconds);
        stage.get_ready().unwrap_or_else(|error| panic!("{error}"));
        let mut most = [0; 2];
        let mut rays = 0;
        let mut errors = Vec::new();
        let mut ratio = 0.0;
        for (frames, step) in [(CUT, 0.0), (options.count, 0.0), (options.count, walk)] {
            set::apply(&mut stage, &text);
            for left in (0..frames).rev() {
                let [seeking, lit] = frame(&mut stage, &scene, seconds + step * left as f32);
                rays = rays.max(set::gathered(&stage).rays);
                let light = lit * 2;
                if seeking + light > most[0] {
                    most = [seeking + light, light];
                }
            }
            let shown = stage.radiance().unwrap_or_else(|error| panic!("{error}"));
            let found = Difference::new(&shown, &truth, None).expect("images of one size");
            errors.push(found.relative_l1_boxes);
            ratio = found.mean_ratio;
        }
        let [total, light] = most;
        let (total, light) = if total == 0 {
            (rays.to_string(), String::new())
        } else {
            (total.to_string(), light.to_string())
        };
        let mut row =
            vec![view.rsplit('/').next().unwrap_or(view).to_owned(), (*settings).to_owned()];
        row.extend(errors.iter().map(|error| format!("{error:.3}")));
        row.extend([format!("{ratio:.3}"), total, light]);
        println!("{row:?}");
        rows.push(row);
    }
}
