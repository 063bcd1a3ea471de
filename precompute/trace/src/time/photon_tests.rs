//! Caustics in time against closed forms and paths.

use std::f64::consts::{PI, TAU};
use std::sync::atomic::{AtomicU32, Ordering};

use glam::{DVec3, UVec2, Vec3};

use super::*;
use crate::integrator::{Pixels, ReferenceScene, Settings, View, Watch};
use crate::light::{Light, Sky};
use crate::sampler::Sampler;
use crate::scene::testing::MeshBuilder;
use crate::scene::{CameraPose, RayScene, SceneGeometry, SceneMaterial};
use crate::testing::statistics;

/// Places of light and eye.
const SOURCE: Vec3 = Vec3::new(-1.0, 1.0, 0.0);
const EYE: Vec3 = Vec3::new(0.0, 1.0, 1.5);

/// A floor, and a mirror at x = 1 that alone is lit.
fn scene(roughness: f32) -> ReferenceScene {
    let (mut floor, mut mirror) = (MeshBuilder::new(), MeshBuilder::new());
    floor.quad(
        [[-3.0, 3.0], [3.0, 3.0], [3.0, -3.0], [-3.0, -3.0]].map(|[x, z]| Vec3::new(x, 0.0, z)),
    );
    mirror.quad(
        [[0.4, 0.5], [0.4, -0.5], [1.4, -0.5], [1.4, 0.5]].map(|[y, z]| Vec3::new(1.0, y, z)),
    );
    let matte = SceneMaterial { reflectance: 0.0, double_sided: true, ..SceneMaterial::default() };
    let metal = SceneMaterial { metallic: 1.0, perceptual_roughness: roughness, ..matte.clone() };
    let geometry = SceneGeometry {
        meshes: vec![floor.finish(0), mirror.finish(1)],
        materials: vec![matte, metal],
        ..SceneGeometry::default()
    };
    let light = Light::Spot {
        position: SOURCE,
        direction: Vec3::X,
        luminous_power: 1e3,
        range: 1e6,
        inner_angle: 11.0,
        outer_angle: 14.0,
        color: [1.0; 3],
    };
    let rays = RayScene::from_geometry(&geometry);
    ReferenceScene::new(geometry.into(), rays.into(), &[light], Sky::Black).unwrap()
}

fn view(to: Vec3, degrees: f32, size: [u32; 2]) -> View {
    let pose = CameraPose::looking_at(EYE, to);
    View { pose, vertical_fov_degrees: degrees, near: 0.01, size: UVec2::from(size) }
}

fn settings(samples: u32, seed: u64) -> Settings {
    Settings { samples, seed, bounces: Some(1), pixels: Pixels::Area, ..Settings::default() }
}

fn window(metres: [f64; 2], frames: u32) -> Window {
    let [start, end] = metres.map(|metres| metres / SPEED_OF_LIGHT);
    Window { start, end, frames, at_surfaces: false }
}

fn get(scene: &ReferenceScene, of: Photons, samples: u32, seed: u64, spread: Spread) -> Frames {
    let (view, window) = (view(Vec3::new(-1.0, 0.0, 0.0), 40.0, [6, 4]), window([3.0, 8.0], 10));
    let (image, frames) =
        caustics(scene, &view, &settings(samples, seed), of, window, spread, Watch::default())
            .unwrap();
    if spread == Spread::Bins {
        for (steady, sum) in image.rgb.iter().flatten().zip(frames.integral().iter().flatten()) {
            assert!((steady - sum).abs() <= 1e-5 * steady.abs(), "{steady} is not {sum}");
        }
    }
    frames
}

#[test]
fn a_mirror_s_light_arrives_when_that_of_the_source_s_image_would() {
    // The middle of the light that the mirror throws on the floor, far behind the light.
    let place = Vec3::new(-2.9, 0.0, 0.0);
    let (image, view) = (Vec3::new(3.0, 1.0, 0.0), view(place, 1.0, [2, 2]));
    let way = f64::from(image.distance(place) + place.distance(EYE));
    let of = Photons { photons: 20_000, radius: 0.1, roughness: 0.25 };
    let found = |at_surfaces, way: f64| {
        let window = Window { at_surfaces, ..window([way - 0.2, way + 0.2], 1) };
        let settings = settings(4, 0);
        let (steady, frames) =
            caustics(&scene(0.089), &view, &settings, of, window, Spread::Bins, Watch::default())
                .unwrap();
        let inside: f64 =
            frames.values.iter().map(|rgb| f64::from(rgb[0])).sum::<f64>() * window.duration();
        inside / steady.rgb.iter().map(|rgb| f64::from(rgb[0])).sum::<f64>()
    };
    assert!(found(false, way) > 0.95, "{}", found(false, way));
    assert!(found(false, way + 0.5) < 0.05);
    let at_surface = way - f64::from(place.distance(EYE));
    assert!(found(true, at_surface) > 0.95, "{}", found(true, at_surface));
}

#[test]
fn photons_in_time_are_what_paths_find() {
    // So rough that paths find the light well.
    let scene = scene(0.5);
    let of = Photons { photons: 20_000, radius: 0.1, roughness: 0.6 };
    let sums = |frames: &Frames| -> Vec<f64> {
        (0..10)
            .map(|i| frames.frame(i).unwrap().iter().map(|rgb| f64::from(rgb[0])).sum())
            .collect()
    };
    let by_photons: Vec<_> =
        (0..16).map(|seed| sums(&get(&scene, of, 4, seed, Spread::Bins))).collect();
    let by_paths: Vec<_> = (0..16)
        .map(|seed| {
            let view = view(Vec3::new(-1.0, 0.0, 0.0), 40.0, [6, 4]);
            let (settings, window) = (settings(4096, seed), window([3.0, 8.0], 10));
            let found = frames(&scene, &view, &settings, window, Spread::Bins, Watch::default());
            sums(&found.unwrap().1)
        })
        .collect();
    let mut lit = 0;
    for frame in 0..10 {
        let [(own, error), (other, noise)] =
            [&by_photons, &by_paths].map(|runs| statistics(runs.iter().map(|run| run[frame])));
        let tolerance = 3.5 * error.hypot(noise) + 0.02 * other;
        assert!((own - other).abs() <= tolerance, "{frame}: {own} ± {error}, {other} ± {noise}");
        lit += u32::from(other > 0.0 && tolerance < 0.3 * other);
    }
    assert!(lit >= 3, "{lit} frames tell something");
    let kernel = Spread::Kernel(0.5 / SPEED_OF_LIGHT);
    let total = |frames: &Frames| sums(frames).iter().sum::<f64>();
    let ratio =
        total(&get(&scene, of, 16, 1, kernel)) / total(&get(&scene, of, 16, 1, Spread::Bins));
    assert!((ratio - 1.0).abs() < 0.05, "{ratio}");
}

/// Mean over passes of a density in a plane and in time at some places: points are normal.
#[test]
fn densities_in_space_and_time_converge_as_theory_says() {
    let mut sampler = Sampler::new(3, 0, 0);
    let places: Vec<DVec3> =
        (0..9).map(|i| DVec3::new(0.2, -0.1, 0.15) * (f64::from(i) - 4.0)).collect();
    let exact = |place: &DVec3| (-0.5 * place.length_squared()).exp() / TAU.powf(1.5);
    let (counts, repeats, each) = ([16_u32, 512], 60, 8);
    let errors = counts.map(|passes| {
        let mut error = 0.0;
        for _ in 0..repeats {
            let mut sums = vec![0.0; places.len()];
            for pass in 0..passes {
                let width = 0.8 * shrinking(pass);
                for _ in 0..each {
                    let mut normal = || {
                        let (a, b) = (sampler.number(), sampler.number());
                        (-2.0 * (1.0 - a).ln()).sqrt() * (TAU * b).cos()
                    };
                    let point = DVec3::new(normal(), normal(), normal());
                    for (sum, place) in sums.iter_mut().zip(&places) {
                        let apart = point - *place;
                        if apart.truncate().length_squared() < width * width {
                            *sum += kernel(apart.z, width) / (PI * width * width);
                        }
                    }
                }
            }
            let count = f64::from(passes * each);
            let squares = sums.iter().zip(&places);
            error += squares.map(|(sum, at)| (sum / count - exact(at)).powi(2)).sum::<f64>();
        }
        error
    });
    let slope = (errors[1] / errors[0]).ln() / 32.0_f64.ln();
    println!("slope {slope}");
    assert!((-0.66..-0.50).contains(&slope), "{slope} is not −4/7");
    let volume = |pass| shrinking(pass).powi(3);
    assert!((volume(1) - 11.0 / 14.0).abs() < 1e-12 && volume(0) == 1.0);
}

#[test]
fn passes_of_photons_in_time_are_reported() {
    let done = AtomicU32::new(0);
    let add = || {
        done.fetch_add(1, Ordering::Relaxed);
    };
    let watch = Watch { row_done: &add, ..Watch::default() };
    let of = Photons { photons: 50, radius: 0.1, roughness: 0.25 };
    let (view, window) = (view(Vec3::new(-1.0, 0.0, 0.0), 40.0, [3, 2]), window([3.0, 8.0], 4));
    caustics(&scene(0.2), &view, &settings(5, 0), of, window, Spread::Bins, watch).unwrap();
    assert_eq!(done.load(Ordering::Relaxed), 5);
}

#[test]
fn photons_in_time_refuse_what_is_out_of_range() {
    let scene = scene(0.2);
    let run = |radius: f64, spread: Spread, photons| {
        let of = Photons { photons, radius, roughness: 0.25 };
        let (view, window) = (view(Vec3::new(-1.0, 0.0, 0.0), 40.0, [3, 2]), window([3.0, 8.0], 4));
        caustics(&scene, &view, &settings(2, 0), of, window, spread, Watch::default())
    };
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert_eq!(run(bad, Spread::Bins, 50).err(), Some(TimeError::NotPositive));
        assert_eq!(run(0.1, Spread::Kernel(bad), 50).err(), Some(TimeError::NotPositive));
    }
    for (radius, width, photons) in
        [(1e-200, 1e-20, 50), (1e200, 1e20, 50), (0.1, 1e-20, 50), (0.1, 1e-9, 0)]
    {
        let (image, found) = run(radius, Spread::Kernel(width), photons).unwrap();
        let all = found.values.iter().chain(&image.rgb).flatten();
        assert!(all.into_iter().all(|value| value.is_finite() && *value >= 0.0));
    }
}
