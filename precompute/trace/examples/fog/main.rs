//! A cache of light in fog against paths: a dark room with a bright panel and an occluder.
//!
//! `cargo run --release -p frugal_trace --features media --example fog -- [SEEDS]`. Every figure is
//! the median over the seeds, with the least and the greatest.

use std::time::Instant;

use frugal_trace::fog_cache::{Cache, CacheSettings, Shape};
use frugal_trace::integrator::{Pixels, ReferenceScene, Settings, View, Watch, render};
use frugal_trace::light::Sky;
use frugal_trace::media::{Distances, Fog};
use frugal_trace::metrics::Radiance;
use frugal_trace::scene::{Bounds, CameraPose, RayScene, SceneGeometry, SceneMaterial, SceneMesh};
use glam::{UVec2, Vec3};

/// A room of 4 m, a panel of 1.6 m under its ceiling, and a plate below it.
fn room() -> ReferenceScene {
    let quad = |material, corners: [[f32; 3]; 4]| {
        let positions = corners.map(Vec3::from).to_vec();
        let normal = (positions[2] - positions[0]).cross(positions[3] - positions[1]).normalize();
        let indices = vec![0, 1, 2, 0, 2, 3];
        SceneMesh { positions, normals: vec![normal; 4], indices, material, ..Default::default() }
    };
    let flat = |material, half: f32, x: f32, y: f32| {
        let (least, most) = (x - half, x + half);
        quad(material, [[least, y, -half], [most, y, -half], [most, y, half], [least, y, half]])
    };
    let wall = |z: f32| quad(0, [[-2.0, -2.0, z], [2.0, -2.0, z], [2.0, 2.0, z], [-2.0, 2.0, z]]);
    let side = |x: f32| quad(0, [[x, -2.0, -2.0], [x, 2.0, -2.0], [x, 2.0, 2.0], [x, -2.0, 2.0]]);
    let meshes = vec![
        flat(0, 2.0, 0.0, -2.0),
        flat(0, 2.0, 0.0, 2.0),
        wall(-2.0),
        wall(2.0),
        side(-2.0),
        side(2.0),
        flat(1, 0.8, 0.0, 1.9),
        flat(0, 0.5, 0.3, 0.9),
    ];
    let material = |nits| SceneMaterial {
        base_color: [0.0, 0.0, 0.0, 1.0],
        emissive: [nits; 3],
        reflectance: 0.0,
        double_sided: true,
        ..SceneMaterial::default()
    };
    let materials = vec![material(0.0), material(100.0)];
    let geometry = SceneGeometry { meshes, materials, ..SceneGeometry::default() };
    let rays = RayScene::from_geometry(&geometry);
    let fog = Fog {
        absorption: [0.05; 3],
        scattering: [0.2; 3],
        asymmetry: 0.0,
        bounds: Bounds { min: Vec3::splat(-2.0), max: Vec3::splat(2.0) },
        distances: Distances::default(),
    };
    ReferenceScene::new(geometry.into(), rays.into(), &[], Sky::Black)
        .expect("valid geometry")
        .with_fog(fog)
        .expect("valid fog")
}

/// Root of the mean squared error ÷ the mean, at the pixels of an image `scale`, odd, times as wide
/// that have the same centres as the truth's.
fn error(image: &Radiance, scale: u32, truth: &Radiance) -> f64 {
    let squares = truth.rgb.iter().enumerate().map(|(index, exact)| {
        let (x, y) = (index as u32 % truth.width, index as u32 / truth.width);
        let place = (y * scale + scale / 2) * image.width + x * scale + scale / 2;
        f64::from(image.rgb[place as usize][1] - exact[1]).powi(2)
    });
    (squares.sum::<f64>() / truth.rgb.len() as f64).sqrt() / truth.mean()
}

fn main() {
    let seeds: u64 = std::env::args().nth(1).map_or(5, |text| text.parse().expect("a number"));
    let scene = room();
    // The panel is out of view.
    let view = |scale: u32| View {
        pose: CameraPose::looking_at(Vec3::new(0.0, -0.6, 1.9), Vec3::new(0.0, -0.6, -2.0)),
        vertical_fov_degrees: 60.0,
        near: 0.01,
        size: UVec2::new(48, 36) * scale,
    };
    let paths = |scale, samples, seed| {
        let pixels = Pixels::Middle;
        let settings = Settings { samples, bounces: Some(0), seed, pixels, ..Settings::default() };
        render(&scene, &view(scale), &settings, Watch::default()).expect("not interrupted").full()
    };
    let truth = paths(1, 1 << 11, 999);
    println!("records; seconds; error; error of paths in that time; paths / cache");
    for scale in [1, 5] {
        for shape in [Shape::Anisotropic, Shape::Isotropic] {
            let mut runs: Vec<[f64; 5]> = (0..seeds.max(1))
                .map(|seed| {
                    let settings = CacheSettings { shape, seed, ..Default::default() };
                    let start = Instant::now();
                    let cache = Cache::new(&scene, &view(scale), settings).expect("even fog");
                    let image = cache.image(&scene, &view(scale));
                    let seconds = start.elapsed().as_secs_f64();
                    // Paths for the same time, from the time of a few.
                    let start = Instant::now();
                    paths(scale, 2, seed);
                    let samples = 2.0 * seconds / start.elapsed().as_secs_f64();
                    let other = paths(scale, (samples.round() as u32).max(1), seed);
                    let [own, other] = [&image, &other].map(|image| error(image, scale, &truth));
                    [cache.len() as f64, seconds, own, other, other / own]
                })
                .collect();
            print!("{} pixels, {shape:?}:", view(scale).size.element_product());
            for column in 0..5 {
                runs.sort_by(|a, b| a[column].total_cmp(&b[column]));
                let at = |run: usize| runs[run][column];
                print!(" {:.4} [{:.4}, {:.4}];", at(runs.len() / 2), at(0), at(runs.len() - 1));
            }
            println!();
        }
    }
}
