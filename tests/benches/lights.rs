//! Dozens of lights: their cost, their error, and whether the image steps as the camera walks.
//!
//! `make bench BENCH=lights ARGS='…'`: `[--size WxH] [--spp N] [--count FRAMES] [error | cost |
//! walk]…`
//!
//! `hall`, which has 64 point lights. Error: relative L1 of 4x4 means against one path-traced bounce,
//! at three views of the tour. Cost: medians of frames along the tour, with the lights nearest to its
//! beginning alone, or all. Walk: from one end of the hall to the other, the largest change of the
//! image's mean light from frame to frame. With all lights in maps that is the scene's own.

use std::time::Instant;

use bevy::light::PointLight;
use bevy::math::{UVec2, Vec3};
use bevy_frugal_gi::gi::GiLimits;
use frugal::scene::SceneDescription;
use frugal::stage::{Component, Stage, adapter};
use frugal_tests::arguments::Arguments;
use frugal_tests::cost::quantile;
use frugal_tests::method::Method;
use frugal_tests::reference::{self, Tracing};
use frugal_tests::set;
use frugal_tests::table::markdown;
use frugal_trace::integrator::Pixels;
use frugal_trace::light::Light;
use frugal_trace::metrics::Difference;
use frugal_trace::scene::CameraPose;

/// Maps of four, eight and all 64 lights.
const LIMITS: [usize; 3] = [24, 48, 384];
/// Seconds between two frames of a walk.
const STEP: f32 = 1.0 / 30.0;

fn main() {
    let Some(adapter) = adapter() else {
        println!("no graphics adapter: nothing is measured");
        return;
    };
    let options =
        Arguments { size: UVec2::new(96, 54), samples: 256, count: 60, names: vec![] }.read();
    println!("Adapter: {}. `hall`, {}x{}.\n", adapter.name, options.size.x, options.size.y);
    let scene = set::scene("hall");
    if options.wants("error") {
        error(&scene, &options);
    }
    if options.wants("cost") {
        cost(&scene, &options);
    }
    if options.wants("walk") {
        walk(&scene, &options);
    }
}

fn open(scene: &SceneDescription, size: UVec2, most: usize) -> Stage {
    let mut stage = set::open(scene, set::radiance_options(size.x, size.y, Component::Indirect));
    stage.world_mut().insert_resource(GiLimits { max_rsm_count: most, ..Default::default() });
    // Direct shadows of 64 lights are 384 more maps in every frame, which GI does not need.
    let world = stage.world_mut();
    for mut light in world.query::<&mut PointLight>().iter_mut(world) {
        light.shadow_maps_enabled = false;
    }
    stage
}

fn pose(scene: &SceneDescription, path: &str, time: f32) -> CameraPose {
    scene.paths[path].sample(time).unwrap_or_else(|| panic!("hall has no {path}"))
}

fn place(stage: &mut Stage, scene: &SceneDescription, path: &str, time: f32) {
    let pose = pose(scene, path, time);
    stage.place(pose.position, pose.rotation);
}

fn methods() -> [Method; 2] {
    [Method::ours(1024, "4x4", "coarse", "1/4", 128), Method::ours(4096, "2x2", "fine", "1/1", 256)]
}

fn error(scene: &SceneDescription, options: &Arguments) {
    let mut rows = Vec::new();
    let times = [0.0, 3.0, 6.0];
    let traced = times.map(|time| {
        let tracing = Tracing {
            size: options.size,
            samples: options.samples,
            seed: 0,
            pixels: Pixels::Middle,
        };
        reference::one_bounce_untextured(scene, pose(scene, "tour", time), tracing)
    });
    for method in methods() {
        for most in LIMITS {
            let mut stage = open(scene, options.size, most);
            let mut row = vec![method.name.clone(), format!("{}", most / 6)];
            let mut bytes = 0;
            for (time, traced) in times.into_iter().zip(&traced) {
                place(&mut stage, scene, "tour", time);
                set::cut(&mut stage);
                let found = method.radiance(&mut stage);
                let difference =
                    Difference::new(&found, traced, None).unwrap_or_else(|error| panic!("{error}"));
                row.push(format!("{:.1} %", 100.0 * difference.relative_l1_boxes));
                row.push(format!("{:+.1} %", 100.0 * (difference.mean_ratio - 1.0)));
                bytes = set::gathered(&stage).bytes;
            }
            row.push(format!("{:.1}", bytes as f64 / 1_048_576.0));
            rows.push(row);
        }
    }
    let headers = ["settings", "lights", "L1", "mean", "L1", "mean", "L1", "mean", "MiB"];
    println!("{}", markdown(&headers, &rows));
}

/// Seconds of each frame of the tour, after one that fills maps and history.
fn frames(stage: &mut Stage, scene: &SceneDescription, count: u32) -> Vec<f64> {
    let end = scene.paths["tour"].duration();
    (0..count)
        .map(|frame| {
            place(stage, scene, "tour", end * frame as f32 / count as f32);
            let started = Instant::now();
            stage.frame();
            started.elapsed().as_secs_f64()
        })
        .collect()
}

fn cost(scene: &SceneDescription, options: &Arguments) {
    let start = pose(scene, "tour", 0.0).position;
    let distance = |light: &Light| match light {
        Light::Point { position, .. } => Vec3::distance(*position, start),
        _ => f32::INFINITY,
    };
    let mut sorted = scene.lights.clone();
    sorted.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
    let counts = [0, 4, 16, 64];
    let mut stages = counts.map(|count| {
        let scene = SceneDescription { lights: sorted[..count].to_vec(), ..scene.clone() };
        let mut stage = open(&scene, options.size, GiLimits::default().max_rsm_count);
        methods()[0].radiance(&mut stage);
        stage
    });
    let mut milliseconds = counts.map(|_| Vec::new());
    // Alternated, so that a busy machine slows all of them.
    for _ in 0..3 {
        for (stage, found) in stages.iter_mut().zip(&mut milliseconds) {
            found.extend(frames(stage, scene, options.count).into_iter().map(|s| 1e3 * s));
        }
    }
    let mut rows = Vec::new();
    for ((count, stage), mut found) in counts.into_iter().zip(&stages).zip(milliseconds) {
        let mut at = |share| quantile(&mut found, share);
        let counted = set::gathered(stage);
        rows.push(vec![
            count.to_string(),
            format!("{:.1}", at(0.5)),
            format!("{:.1} to {:.1}", at(0.1), at(0.9)),
            counted.maps.to_string(),
            format!("{:.1}", counted.bytes as f64 / 1_048_576.0),
        ]);
    }
    let headers = ["lights", "median ms", "p10 to p90", "maps rendered", "MiB"];
    println!("{}", markdown(&headers, &rows));
}

fn walk(scene: &SceneDescription, options: &Arguments) {
    let count = 10 * options.count;
    let mut rows = Vec::new();
    for most in LIMITS {
        let mut stage = open(scene, options.size, most);
        place(&mut stage, scene, "walk", 0.0);
        let mut last = methods()[0].radiance(&mut stage).mean();
        let mut steps: Vec<f64> = (1..=count)
            .map(|frame| {
                place(&mut stage, scene, "walk", STEP * frame as f32);
                stage.frame();
                let mean = stage.radiance().unwrap_or_else(|error| panic!("{error}")).mean();
                let step = (mean - last).abs() / mean.max(last);
                last = mean;
                step
            })
            .collect();
        let mut at = |share| 100.0 * quantile(&mut steps, share);
        rows.push(vec![
            (most / 6).to_string(),
            format!("{:.2} %", at(0.5)),
            format!("{:.2} %", at(0.99)),
            format!("{:.2} %", at(1.0)),
        ]);
    }
    println!("{}", markdown(&["lights", "median step", "p99", "largest"], &rows));
}
