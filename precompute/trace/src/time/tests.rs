//! Closed forms of times and densities.

use std::f64::consts::TAU;

use glam::{DVec3, UVec2, Vec3};

use super::*;
use crate::bsdf::Shading;
use crate::integrator::{ReferenceScene, Settings, View, Watch, render};
use crate::light::{Light, Sky};
use crate::scene::testing::MeshBuilder;
use crate::scene::{CameraPose, RayScene, SceneGeometry, SceneMaterial};
use crate::testing::fit_square;

/// A box of 2 × 1.6 × 3 m seen from inside, scaled, with a lamp of a triangle mesh if `lit`.
fn room(scale: f32, lit: bool) -> ReferenceScene {
    let mut walls = MeshBuilder::new();
    walls.room(Vec3::new(-1.0, -0.8, -2.0) * scale, Vec3::new(1.0, 0.8, 1.0) * scale);
    let mut lamp = MeshBuilder::new();
    lamp.cuboid(Vec3::new(-0.2, 0.7, -1.2) * scale, Vec3::new(0.2, 0.75, -0.8) * scale);
    let matte = SceneMaterial {
        base_color: [0.6, 0.5, 0.4, 1.0],
        reflectance: 0.0,
        ..SceneMaterial::default()
    };
    let nits = if lit { 10.0 } else { 0.0 };
    let geometry = SceneGeometry {
        meshes: vec![walls.finish(0), lamp.finish(1)],
        materials: vec![matte.clone(), SceneMaterial { emissive: [nits; 3], ..matte }],
        ..SceneGeometry::default()
    };
    let light = Light::Point {
        position: Vec3::new(0.3, 0.1, 0.0) * scale,
        luminous_power: 100.0,
        range: 1e6,
        color: [1.0; 3],
    };
    let rays = RayScene::from_geometry(&geometry);
    ReferenceScene::new(geometry.into(), rays.into(), &[light], Sky::Black).unwrap()
}

pub(super) fn view(scale: f32) -> View {
    View {
        pose: CameraPose::looking_at(Vec3::ZERO, Vec3::new(0.1, -0.1, -1.0) * scale),
        vertical_fov_degrees: 60.0,
        near: 0.01 * scale,
        size: UVec2::new(8, 6),
    }
}

pub(super) fn settings() -> Settings {
    Settings { samples: 32, bounces: Some(3), shading: Shading::Lambertian, ..Settings::default() }
}

fn window(metres: f64, frames: u32) -> Window {
    Window { start: 0.0, end: metres / SPEED_OF_LIGHT, frames, at_surfaces: false }
}

fn assert_near(a: &[[f32; 3]], b: &[[f32; 3]], tolerance: f32) {
    for (a, b) in a.iter().flatten().zip(b.iter().flatten()) {
        assert!((a - b).abs() <= tolerance * b.abs().max(1e-6), "{a} is not {b}");
    }
}

#[test]
fn frames_add_up_to_the_steady_image() {
    let (scene, view) = (room(1.0, true), view(1.0));
    let steady = render(&scene, &view, &settings(), Watch::default()).unwrap();
    for metres in [40.0, 3.0] {
        for at_surfaces in [false, true] {
            let window = Window { at_surfaces, ..window(metres, 50) };
            let (same, timed) =
                frames(&scene, &view, &settings(), window, Spread::Bins, Watch::default()).unwrap();
            assert_eq!(same, steady, "the steady image is the same bit by bit");
            assert_near(&timed.integral(), &steady.full().rgb, 3e-6);
            let late = timed.outside.iter().flatten().any(|value| *value > 0.0);
            assert_eq!(late, metres < 40.0, "a long window misses nothing");
        }
    }
}

#[test]
fn nothing_is_faster_than_light_and_a_larger_scene_is_slower() {
    let image = |scale: f32, metres: f64| {
        let window = window(metres, 60);
        frames(
            &room(scale, false),
            &view(scale),
            &settings(),
            window,
            Spread::Bins,
            Watch::default(),
        )
        .unwrap()
        .1
    };
    let small = image(1.0, 12.0);
    // The lamp is 0.316 m from the eye, and nothing is nearer to both than the floor.
    let floor = 2.0 * (0.8_f64.powi(2) + 0.158_f64.powi(2)).sqrt() - 0.2;
    for frame in 0..60 {
        let is_dark = small.frame(frame).unwrap().iter().flatten().all(|value| *value == 0.0);
        let end = small.window.middle(frame) + 0.5 * small.window.duration();
        assert!(is_dark || end * SPEED_OF_LIGHT > floor, "light in frame {frame}");
    }
    assert!(small.frame(60).is_none());
    // A power of two scales without rounding: light is a quarter, four times as long.
    let large = image(4.0, 48.0);
    let expected: Vec<_> = small.values.iter().map(|rgb| rgb.map(|value| value / 64.0)).collect();
    let close = |(a, b): (&[f32; 3], &[f32; 3])| (a[0] - b[0]).abs() <= 1e-3 * b[0].abs();
    let same = large.values.iter().zip(&expected).filter(|pair| close(*pair)).count();
    assert!(same as f64 > 0.99 * expected.len() as f64, "{same} of {}", expected.len());
}

#[test]
fn kernels_have_the_integral_one_and_the_image_s_light() {
    for width in [1e-12, 0.3, 5.0] {
        let sum: f64 = (-2000..2000)
            .map(|i| kernel((f64::from(i) + 0.5) / 1000.0 * width, width) * width / 1000.0)
            .sum();
        assert!((sum - 1.0).abs() < 1e-6, "{sum}");
    }
    assert_eq!([kernel(0.0, 0.0), kernel(f64::NAN, 1.0), kernel(2.0, 1.0)], [0.0; 3]);
    let (scene, view) = (room(1.0, true), view(1.0));
    let steady = render(&scene, &view, &settings(), Watch::default()).unwrap().full();
    let (window, width) = (window(40.0, 800), 0.5 / SPEED_OF_LIGHT);
    let spread = Spread::Kernel(width);
    let (_, timed) = frames(&scene, &view, &settings(), window, spread, Watch::default()).unwrap();
    assert_near(&timed.integral(), &steady.rgb, 2e-3);
    let passes = progressive(&scene, &view, &settings(), window, width, 3, Watch::default());
    let sum =
        |image: &[[f32; 3]]| image.iter().flatten().map(|value| f64::from(*value)).sum::<f64>();
    assert!((sum(&passes.unwrap().integral()) / sum(&steady.rgb) - 1.0).abs() < 0.05);
}

/// Slope of the squared error over the number of samples, in logarithms, for a normal density.
fn slope(estimate: impl Fn(&[f64], &[f64]) -> Vec<f64>) -> f64 {
    let mut sampler = crate::sampler::Sampler::new(7, 0, 0);
    let places: Vec<f64> = (0..41).map(|i| f64::from(i) * 0.1 - 2.0).collect();
    let mut logs = Vec::new();
    for count in [512, 1024, 2048, 4096, 8192, 16_384] {
        let mut error = 0.0;
        for _ in 0..60 {
            let times: Vec<f64> = (0..count)
                .map(|_| {
                    let (a, b) = (sampler.number(), sampler.number());
                    (-2.0 * (1.0 - a).ln()).sqrt() * (TAU * b).cos()
                })
                .collect();
            let found = estimate(&times, &places);
            let exact = |t: f64| (-0.5 * t * t).exp() / TAU.sqrt();
            error +=
                places.iter().zip(found).map(|(t, own)| (own - exact(*t)).powi(2)).sum::<f64>();
        }
        logs.push((f64::from(count).ln(), error.ln()));
    }
    let n = logs.len() as f64;
    let (x, y) = logs.iter().fold((0.0, 0.0), |sum, p| (sum.0 + p.0 / n, sum.1 + p.1 / n));
    logs.iter().map(|p| (p.0 - x) * (p.1 - y)).sum::<f64>()
        / logs.iter().map(|p| (p.0 - x).powi(2)).sum::<f64>()
}

#[test]
fn kernels_that_shrink_converge_as_theory_says_and_bins_slower() {
    let kernels = slope(|times, places| {
        let passes: Vec<_> = times.chunks(16).collect();
        let mut sums = vec![0.0; places.len()];
        for (pass, times) in passes.iter().enumerate() {
            let width = bandwidth(1.0, pass as u32);
            for (sum, place) in sums.iter_mut().zip(places) {
                *sum += times.iter().map(|time| kernel(time - place, width)).sum::<f64>();
            }
        }
        sums.iter().map(|sum| sum / times.len() as f64).collect()
    });
    let bins = slope(|times, places| {
        let width = 3.49 * (times.len() as f64).powf(-1.0 / 3.0);
        let bin = |time: f64| ((time + 8.0) / width).floor() as i64;
        let mut counts = std::collections::HashMap::new();
        times.iter().for_each(|time| *counts.entry(bin(*time)).or_insert(0.0) += 1.0);
        let at = |place: &f64| counts.get(&bin(*place)).copied().unwrap_or(0.0);
        places.iter().map(|place| at(place) / (times.len() as f64 * width)).collect()
    });
    assert!((-0.92..-0.70).contains(&kernels), "{kernels} is not −4/5");
    assert!((-0.76..-0.57).contains(&bins), "{bins} is not −2/3");
    assert!(kernels < bins - 0.05, "{kernels} {bins}");
}

#[test]
fn distances_are_uniform_in_time() {
    let (light, direction) = (DVec3::new(0.7, 0.2, -1.5), DVec3::new(0.1, 0.0, -1.0).normalize());
    let (from, to) = (light.length() + 0.1, 6.0);
    for i in 0..100 {
        let x = (f64::from(i) + 0.5) / 100.0;
        let (distance, density) = sample_distance(light, direction, [from, to], x).unwrap();
        let way = |r: f64| r + (light - direction * r).length();
        assert!((way(distance) - (from + x * (to - from))).abs() < 1e-9);
        let slope = (way(distance + 1e-6) - way(distance - 1e-6)) / 2e-6;
        assert!((density - slope / (to - from)).abs() < 1e-6);
    }
    // Too short, behind the camera, no span, nothing.
    assert_eq!(sample_distance(light, direction, [0.0, 1.0], 0.5), None);
    assert_eq!(sample_distance(light, direction, [3.0, 3.0], 0.5), None);
    assert_eq!(sample_distance(light, DVec3::NAN, [0.0, 9.0], 0.5), None);
    assert!(sample_distance(DVec3::ZERO, direction, [0.0, 4.0], 0.5).is_some());
}

#[test]
fn sampled_distances_have_their_density() {
    let (light, direction) = (DVec3::new(0.7, 0.2, -1.5), DVec3::new(0.1, 0.0, -1.0).normalize());
    let (from, to) = (light.length() + 0.1, 6.0);
    let [nearest, farthest] =
        [0.0, 1.0].map(|x| sample_distance(light, direction, [from, to], x).unwrap().0);
    let span = farthest - nearest;
    let fit = fit_square(
        [64, 1],
        |sampler| {
            let x = sampler.number();
            let (distance, _) = sample_distance(light, direction, [from, to], x)?;
            Some([(distance - nearest) / span, 0.0])
        },
        |[share, _]| {
            let distance = nearest + share * span;
            let way = distance + (light - direction * distance).length();
            let x = (way - from) / (to - from);
            sample_distance(light, direction, [from, to], x).map_or(0.0, |(_, density)| density)
                * span
        },
    );
    fit.assert("distances");
}

#[test]
fn frames_become_layers_and_an_animation() {
    let window = window(12.0, 5);
    let (_, timed) =
        frames(&room(1.0, true), &view(1.0), &settings(), window, Spread::Bins, Watch::default())
            .unwrap();
    let bytes = timed.to_exr().unwrap();
    use exr::prelude::{ReadChannels, ReadLayers};
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .from_buffered(std::io::Cursor::new(bytes))
        .unwrap();
    assert_eq!(image.layer_data.len(), 5);
    for (frame, layer) in image.layer_data.iter().enumerate() {
        let red = layer.channel_data.list.iter().find(|channel| channel.name.eq("R")).unwrap();
        let expected = timed.frame(frame as u32).unwrap();
        assert!(red.sample_data.values_as_f32().eq(expected.iter().map(|rgb| rgb[0])));
    }
    let bytes = timed.to_animation(1e9, 10).unwrap();
    let reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
    assert_eq!(reader.info().animation_control.unwrap().num_frames, 5);
    let empty = Frames { width: 0, height: 0, values: Vec::new(), outside: Vec::new(), ..timed };
    assert!(empty.to_animation(1.0, 1).is_err());
    let _finite_or_error = empty.to_exr();
}

#[test]
fn odd_windows_are_refused() {
    let with = |window, spread| {
        frames(&room(1.0, true), &view(1.0), &settings(), window, spread, Watch::default()).err()
    };
    let window = window(1.0, 4);
    for bad in [
        Window { end: 0.0, ..window },
        Window { start: f64::NAN, ..window },
        Window { frames: 0, ..window },
        Window { frames: u32::MAX, ..window },
    ] {
        assert_eq!(with(bad, Spread::Bins), Some(TimeError::Window));
    }
    assert_eq!(with(window, Spread::Kernel(0.0)), Some(TimeError::NotPositive));
}
