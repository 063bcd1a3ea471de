//! Fog in time: paths and beams against a closed form, the steady image and each other.

use std::f64::consts::PI;

use glam::{DVec3, UVec2, Vec3};

use super::*;
use crate::fog_beams;
use crate::integrator::{Pixels, ReferenceScene, Settings, View, Watch, render};
use crate::light::{Light, Sky};
use crate::media::{Fog, density};
use crate::scene::testing::MeshBuilder;
use crate::scene::{Bounds, CameraPose, RayScene, SceneGeometry, SceneMaterial};
use crate::testing::statistics;

const LIGHT: Vec3 = Vec3::new(0.2, 0.3, -0.1);

/// A light in 2 m of fog above a floor, which reflects this share and emits so many nits.
fn scene(albedo: f32, nits: f32) -> ReferenceScene {
    let corner = |x: f32, z: f32| Vec3::new(x, -0.9, z);
    let mut floor = MeshBuilder::new();
    floor.quad([corner(-1.0, 1.0), corner(1.0, 1.0), corner(1.0, -1.0), corner(-1.0, -1.0)]);
    let material = SceneMaterial {
        base_color: [albedo, albedo, albedo, 1.0],
        emissive: [nits; 3],
        reflectance: 0.0,
        ..SceneMaterial::default()
    };
    let geometry = SceneGeometry {
        meshes: vec![floor.finish(0)],
        materials: vec![material],
        ..SceneGeometry::default()
    };
    let light =
        Light::Point { position: LIGHT, luminous_power: 1000.0, range: 1e3, color: [1.0; 3] };
    let rays = RayScene::from_geometry(&geometry);
    let scene = ReferenceScene::new(geometry.into(), rays.into(), &[light], Sky::Black).unwrap();
    scene.with_fog(fog()).unwrap()
}

fn fog() -> Fog {
    Fog {
        absorption: [0.1; 3],
        scattering: [0.4; 3],
        asymmetry: 0.4,
        bounds: Bounds { min: Vec3::splat(-1.0), max: Vec3::splat(1.0) },
    }
}

fn view(size: [u32; 2]) -> View {
    View {
        pose: CameraPose::looking_at(Vec3::Z * 3.0, Vec3::ZERO),
        vertical_fov_degrees: 40.0,
        near: 0.01,
        size: UVec2::from(size),
    }
}

fn settings(samples: u32, seed: u64, bounces: Option<u32>) -> Settings {
    Settings { samples, seed, bounces, pixels: Pixels::Middle, ..Settings::default() }
}

/// Ways of light that fog scatters once, metres.
fn window(frames: u32) -> Window {
    let [start, end] = [3.0, 6.5].map(|metres| metres / SPEED_OF_LIGHT);
    Window { start, end, frames, at_surfaces: false }
}

/// Light of the middle ray that fog scatters once, with its way from `from` to `to` metres, nits.
fn exact(from: f64, to: f64) -> f64 {
    let (eye, light) = (DVec3::Z * 3.0, LIGHT.as_dvec3());
    let steps = 400_000;
    let part = |step: u32| {
        let distance = 2.0 + 2.0 * (f64::from(step) + 0.5) / f64::from(steps);
        let ray = light - (eye - DVec3::Z * distance);
        let way = distance + ray.length();
        if !(from..to).contains(&way) {
            return 0.0;
        }
        let phase = density(fog().asymmetry(), -ray.normalize().z);
        0.4 * phase * 1000.0 / (4.0 * PI) / ray.length_squared() * (-0.5 * (way - 2.0)).exp()
    };
    (0..steps).map(part).sum::<f64>() * 2.0 / f64::from(steps)
}

/// That of each frame, nits per second.
fn exact_frames(window: Window) -> Vec<f64> {
    let step = window.duration() * SPEED_OF_LIGHT;
    let edge = |frame: u32| window.start * SPEED_OF_LIGHT + f64::from(frame) * step;
    let frame = |frame: u32| exact(edge(frame), edge(frame + 1)) / window.duration();
    (0..window.frames).map(frame).collect()
}

/// Checks the images of many seeds against the closed form; in each frame within `bias` of it.
fn assert_exact(images: &[Frames], greatest_error: f64, bias: f64) {
    let window = images[0].window;
    for (frame, exact) in exact_frames(window).into_iter().enumerate() {
        let values = images.iter().map(|image| f64::from(image.values[frame][0]));
        let (mean, error) = statistics(values);
        let tolerance = 3.5 * error + (1e-6 + bias) * exact;
        assert!((mean - exact).abs() <= tolerance, "{frame}: {mean} ± {error}, {exact}");
        assert!(error <= greatest_error * exact, "{frame}: {error} of {exact}");
    }
}

#[test]
fn light_of_paths_that_fog_scatters_once_is_on_time() {
    let scene = scene(0.0, 0.0);
    let image = |seed| {
        let (view, settings) = (view([1, 1]), settings(2048, seed, Some(0)));
        frames(&scene, &view, &settings, window(12), Spread::Bins, Watch::default()).unwrap().1
    };
    let images: Vec<_> = (0..24).map(image).collect();
    assert_exact(&images, 0.05, 0.0);
}

#[test]
fn frames_of_paths_in_fog_add_up_to_the_steady_image() {
    let (scene, view, settings) = (scene(0.7, 5.0), view([8, 6]), settings(32, 1, Some(3)));
    let steady = render(&scene, &view, &settings, Watch::default()).unwrap();
    for at_surfaces in [false, true] {
        let window = Window { at_surfaces, ..window(20) };
        let (same, timed) =
            frames(&scene, &view, &settings, window, Spread::Bins, Watch::default()).unwrap();
        assert_eq!(same, steady);
        for (a, b) in timed.integral().iter().flatten().zip(steady.full().rgb.iter().flatten()) {
            assert!((a - b).abs() <= 3e-6 * b.max(1e-6), "{a} {b}");
        }
        assert!(timed.outside.iter().flatten().any(|value| *value > 0.0), "late light");
    }
}

fn beam_image(
    passes: u32,
    seed: u64,
    spread: Spread,
    of: Beams,
) -> (crate::metrics::Radiance, Frames) {
    let (view, settings) = (view([1, 1]), settings(passes, seed, Some(0)));
    beams(&scene(0.0, 0.0), &view, &settings, of, window(12), spread, Watch::default()).unwrap()
}

#[test]
fn light_of_beams_that_fog_scatters_once_is_on_time() {
    // So narrow that the radius moves no frame's light by much.
    let of = Beams { photons: 2000, radius: 0.03 };
    let images: Vec<_> = (0..48).map(|seed| beam_image(8, seed, Spread::Bins, of).1).collect();
    assert_exact(&images, 0.15, 0.02);
}

#[test]
fn frames_of_beams_add_up_to_the_steady_image() {
    let (scene, view, settings) = (scene(0.7, 5.0), view([8, 6]), settings(4, 1, Some(3)));
    let of = Beams { photons: 500, radius: 0.1 };
    let watch = Watch::default();
    let steady = fog_beams::render(&scene, &view, &settings, 500, 0.1, watch).unwrap();
    for at_surfaces in [false, true] {
        let window = Window { at_surfaces, ..window(20) };
        let (same, timed) =
            beams(&scene, &view, &settings, of, window, Spread::Bins, watch).unwrap();
        assert_eq!(same, steady);
        for (a, b) in timed.integral().iter().flatten().zip(steady.rgb.iter().flatten()) {
            assert!((a - b).abs() <= 3e-6 * b.max(1e-6), "{a} {b}");
        }
        assert!(timed.outside.iter().flatten().any(|value| *value > 0.0), "late light");
    }
    let kernel = Spread::Kernel(0.2 / SPEED_OF_LIGHT);
    let wide = Window { start: 0.0, end: 40.0 / SPEED_OF_LIGHT, frames: 2000, at_surfaces: false };
    let (same, timed) = beams(&scene, &view, &settings, of, wide, kernel, watch).unwrap();
    for (a, b) in timed.integral().iter().flatten().zip(same.rgb.iter().flatten()) {
        assert!((a - b).abs() <= 2e-3 * b.max(1e-6), "{a} {b}");
    }
}

/// Events of all kinds, and a floor that shines and reflects.
#[test]
fn beams_and_paths_have_the_same_light_in_each_frame() {
    let scene = scene(0.7, 5.0);
    // Above the floor, whose own light beams leave out.
    let view = View { vertical_fov_degrees: 8.0, ..view([4, 3]) };
    let (window, watch, of) = (window(8), Watch::default(), Beams { photons: 1000, radius: 0.1 });
    let sums = |frames: &Frames| -> Vec<f64> {
        (0..8).map(|i| frames.frame(i).unwrap().iter().map(|rgb| f64::from(rgb[0])).sum()).collect()
    };
    let settings = |samples, seed| settings(samples, seed, Some(2));
    let by_beams: Vec<_> = (0..24)
        .map(|seed| {
            let found = beams(&scene, &view, &settings(6, seed), of, window, Spread::Bins, watch);
            sums(&found.unwrap().1)
        })
        .collect();
    let by_paths: Vec<_> = (0..24)
        .map(|seed| {
            let found = frames(&scene, &view, &settings(512, seed), window, Spread::Bins, watch);
            sums(&found.unwrap().1)
        })
        .collect();
    for frame in 0..8 {
        let [(own, error), (other, noise)] =
            [&by_beams, &by_paths].map(|runs| statistics(runs.iter().map(|run| run[frame])));
        let tolerance = 3.5 * error.hypot(noise) + 0.02 * other;
        assert!((own - other).abs() <= tolerance, "{frame}: {own} ± {error}, {other} ± {noise}");
        assert!(frame > 5 || tolerance < 0.3 * other, "{frame}: {tolerance} of {other}");
    }
}

#[test]
fn the_error_of_kernels_of_beams_falls_as_theory_says() {
    let of = Beams { photons: 100, radius: 0.15 };
    let spread = Spread::Kernel(0.4 / SPEED_OF_LIGHT);
    let window = window(12);
    // Where light is smooth in time: the closed form jumps at its first and last way.
    let frames = 3..6;
    let exact: Vec<f64> = frames
        .clone()
        .map(|frame| {
            let way = window.middle(frame) * SPEED_OF_LIGHT;
            exact(way - 0.01, way + 0.01) / 0.02 * SPEED_OF_LIGHT
        })
        .collect();
    let error = |passes: u32| -> f64 {
        let square = |seed| -> f64 {
            let found = beam_image(passes, seed, spread, of).1;
            let pairs = frames.clone().zip(&exact);
            pairs.map(|(i, own)| (f64::from(found.values[i as usize][0]) / own - 1.0).powi(2)).sum()
        };
        (0..120).map(square).sum()
    };
    let slope = (error(128) / error(8)).ln() / 16.0_f64.ln();
    assert!((slope + 2.0 / 3.0).abs() < 0.15, "{slope}");
    assert!((narrowing(1) - (5.0_f64 / 6.0).sqrt()).abs() < 1e-12 && narrowing(0) == 1.0);
}

#[test]
fn beams_refuse_what_is_out_of_range() {
    let get = |scene: &ReferenceScene, radius: f64, spread: Spread| {
        let of = Beams { photons: 50, radius };
        let (view, settings) = (view([4, 3]), settings(2, 0, Some(1)));
        beams(scene, &view, &settings, of, window(4), spread, Watch::default())
    };
    let lit = scene(0.5, 0.0);
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert_eq!(get(&lit, bad, Spread::Bins).err(), Some(TimeError::NotPositive));
        assert_eq!(get(&lit, 0.1, Spread::Kernel(bad)).err(), Some(TimeError::NotPositive));
    }
    for (radius, width) in [(1e-20, 1e-20), (1e20, 1e20), (0.1, 1e-20), (0.1, 1e20)] {
        let (_, found) = get(&lit, radius, Spread::Kernel(width)).unwrap();
        assert!(found.values.iter().flatten().all(|value| value.is_finite() && *value >= 0.0));
    }
    let clear = Fog { absorption: [0.0; 3], scattering: [0.0; 3], ..fog() };
    let clear = scene(0.5, 0.0).with_fog(clear).unwrap();
    assert_eq!(get(&clear, 0.1, Spread::Bins).err(), Some(TimeError::NoFog));
}
