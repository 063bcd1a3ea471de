//! Light that a bent mirror throws on a table, in time: from photons, and along paths.

use std::sync::LazyLock;

use frugal_trace::integrator::{ReferenceScene, Settings, View, Watch};
use frugal_trace::scene::{CameraPose, SceneMaterial};
use frugal_trace::time::{
    Frames, Photons, SPEED_OF_LIGHT, Spread, Window, caustics, frames, progressive,
};
use glam::{UVec2, Vec3};

use crate::sheet::{scene, sheet, spot};
use crate::timing::timed;

/// Bandwidth of the first pass, metres.
const BANDWIDTH: f64 = 0.1;
const PASSES: u32 = 32;
/// Paths of a pixel in a pass with kernels, and in the run that tells how long they take.
const SAMPLES: u32 = 8;
const TRIAL: u32 = 256;

/// The scene, and long runs with a third of the radius. Roughness of the mirror.
static POLISHED: LazyLock<(ReferenceScene, Frames)> = LazyLock::new(|| with_truth(0.1));
static DULL: LazyLock<(ReferenceScene, Frames)> = LazyLock::new(|| with_truth(0.2));

fn with_truth(roughness: f32) -> (ReferenceScene, Frames) {
    let matte = SceneMaterial { reflectance: 0.0, double_sided: true, ..SceneMaterial::default() };
    let metal = SceneMaterial { metallic: 1.0, perceptual_roughness: roughness, ..matte.clone() };
    let table = sheet([1, 1], |s, t| Vec3::new(4.0 * (s - 0.5), 0.0, 2.0 - 4.0 * t));
    let mirror = sheet([64, 2], |s, t| {
        let x = 1.2 * (s - 0.5);
        Vec3::new(x, 0.6 + 0.4 * t, -0.6 + 0.8 * x * x + 0.15 * (3.0 * x).sin())
    });
    let light = spot([0.6, 2.2, 1.8], [0.0, 0.8, -0.5], 8.0);
    let scene = scene(vec![(matte, table), (metal, mirror)], &[light]);
    let of = Photons { photons: 40_000, radius: 0.033, roughness: 0.25 };
    let truth = by_photons(&scene, of, 300, 999, Spread::Bins);
    (scene, truth)
}

fn view() -> View {
    View {
        pose: CameraPose::looking_at(Vec3::new(0.0, 1.4, 1.6), Vec3::new(0.0, 0.0, 0.3)),
        vertical_fov_degrees: 30.0,
        near: 0.01,
        size: UVec2::new(12, 9),
    }
}

fn window() -> Window {
    let [start, end] = [5.9, 6.7].map(|metres| metres / SPEED_OF_LIGHT);
    Window { start, end, frames: 24, at_surfaces: false }
}

fn settings(samples: u32, seed: u64) -> Settings {
    Settings { samples, seed, bounces: Some(1), ..Settings::default() }
}

fn by_photons(
    scene: &ReferenceScene,
    of: Photons,
    passes: u32,
    seed: u64,
    spread: Spread,
) -> Frames {
    let settings = settings(passes, seed);
    caustics(scene, &view(), &settings, of, window(), spread, Watch::default()).expect("a window").1
}

fn by_paths(scene: &ReferenceScene, samples: u32, seed: u64, spread: Spread) -> Frames {
    let (view, watch) = (view(), Watch::default());
    let found = match spread {
        Spread::Bins => {
            let settings = settings(samples, seed);
            frames(scene, &view, &settings, window(), spread, watch).map(|found| found.1)
        }
        Spread::Kernel(first) => {
            let (settings, passes) = (settings(SAMPLES, seed), samples / SAMPLES);
            progressive(scene, &view, &settings, window(), first, passes, watch)
        }
    };
    found.expect("a window")
}

/// Root of the mean squared error ÷ mean: of photons, and of paths in the same time.
pub(crate) fn errors(seed: u64) -> Vec<(&'static str, f64)> {
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    let kernel = Spread::Kernel(BANDWIDTH / SPEED_OF_LIGHT);
    let mut rows = Vec::new();
    for (name, place, spread) in [
        ("roughness 0.1, bins: photons", &POLISHED, Spread::Bins),
        ("roughness 0.1, kernels: photons", &POLISHED, kernel),
        ("roughness 0.2, bins: photons", &DULL, Spread::Bins),
        ("roughness 0.2, kernels: photons", &DULL, kernel),
    ] {
        let (scene, truth) = &**place;
        let error = |found: &Frames| {
            let pairs = found.values.iter().zip(&truth.values);
            let sum: f64 = pairs.map(|(a, b)| f64::from(a[1] - b[1]).powi(2)).sum();
            let mean: f64 = truth.values.iter().map(|value| f64::from(value[1])).sum();
            (sum * truth.values.len() as f64).sqrt() / mean
        };
        let of = Photons { photons: 10_000, radius: 0.1, roughness: 0.25 };
        let (own, seconds) = one.install(|| timed(|| by_photons(scene, of, PASSES, seed, spread)));
        let trial = one.install(|| timed(|| by_paths(scene, TRIAL, seed, spread))).1;
        let samples = (f64::from(TRIAL) * seconds / trial).round() as u32;
        let paths = by_paths(scene, samples, seed, spread);
        rows.push((name, error(&own)));
        rows.push(("  paths in that time", error(&paths)));
        rows.push(("  paths / photons", error(&paths) / error(&own)));
    }
    rows
}
