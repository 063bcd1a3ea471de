//! Reciprocity of the tracer, and recovery of dual images.

use std::f64::consts::{PI, TAU};

use glam::{UVec2, Vec3};

use super::dual::{Haar, gaussian};
use super::*;
use crate::bsdf::Shading;
use crate::integrator::{ReferenceScene, Settings, View, Watch, render};
use crate::light::{Light, Sky};
use crate::sampler::Sampler;
use crate::scene::testing::MeshBuilder;
use crate::scene::{CameraPose, RayScene, SceneGeometry, SceneMaterial};
use crate::testing::fit_square;

/// A room with a red wall and a glossy block.
fn room(lights: &[Light]) -> ReferenceScene {
    let matte = SceneMaterial {
        base_color: [0.7, 0.6, 0.5, 1.0],
        double_sided: true,
        ..SceneMaterial::default()
    };
    let glossy = SceneMaterial { perceptual_roughness: 0.4, metallic: 0.5, ..matte.clone() };
    let mut walls = MeshBuilder::new();
    walls.room(Vec3::new(-2.0, 0.0, -2.0), Vec3::new(2.0, 2.5, 2.0));
    let mut block = MeshBuilder::new();
    block.tint([0.9, 0.4, 0.3]).cuboid(Vec3::new(-0.6, 0.0, -0.8), Vec3::new(0.4, 1.1, 0.1));
    scene(vec![matte, glossy], vec![walls, block], lights)
}

pub(super) fn scene(
    materials: Vec<SceneMaterial>,
    meshes: Vec<MeshBuilder>,
    lights: &[Light],
) -> ReferenceScene {
    let meshes = meshes.into_iter().enumerate().map(|(i, mesh)| mesh.finish(i)).collect();
    let geometry = SceneGeometry { meshes, materials, ..SceneGeometry::default() };
    let rays = RayScene::from_geometry(&geometry);
    ReferenceScene::new(geometry.into(), rays.into(), lights, Sky::Black).expect("valid geometry")
}

fn view(from: [f32; 3], to: [f32; 3], side: u32) -> View {
    View {
        pose: CameraPose::looking_at(from.into(), to.into()),
        vertical_fov_degrees: 50.0,
        near: 1e-3,
        size: UVec2::splat(side),
    }
}

fn ends(side: u32) -> [View; 2] {
    let to = [0.0, 0.6, -0.4];
    [view([-1.2, 1.5, 1.8], to, side), view([1.6, 1.9, 1.4], to, side)]
}

/// Mean and standard error of values.
fn measured(values: &[f64]) -> (f64, f64) {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let squares = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
    (mean, (squares / (count - 1.0) / count).sqrt())
}

#[test]
fn camera_and_projector_can_be_swapped() {
    let scene = room(&[]);
    let [camera, projector] = ends(8);
    for shading in [Shading::Lambertian, Shading::Standard] {
        let traced = |from: &View, to: &View, seed| {
            let tracing = Tracing { samples: 64, bounces: 3, seed, shading };
            Transport::trace(&scene, from, to, &tracing).expect("a matrix")
        };
        let seeds = 10;
        let there: Vec<Transport> = (0..seeds).map(|i| traced(&camera, &projector, i)).collect();
        let back: Vec<Transport> =
            (0..seeds).map(|i| traced(&projector, &camera, 100 + i)).collect();
        // A light of the camera's pixels: the dual image, and the real one after the swap.
        let light: Vec<f64> = (0..64).map(|i| f64::from(i % 8) + 1.0).collect();
        let duals: Vec<Vec<f64>> =
            there.iter().map(|matrix| matrix.dual(&light).expect("64 pixels")).collect();
        let reals: Vec<Vec<f64>> =
            back.iter().map(|matrix| matrix.image(&light).expect("64 pixels")).collect();
        let (mut squares, mut worst) = (0.0, 0.0_f64);
        for pixel in 0..64 {
            let of = |images: &[Vec<f64>]| {
                measured(&images.iter().map(|image| image[pixel]).collect::<Vec<_>>())
            };
            let ((a, ea), (b, eb)) = (of(&duals), of(&reals));
            let sigmas = (a - b) / ea.hypot(eb);
            squares += sigmas * sigmas;
            worst = worst.max(sigmas.abs());
        }
        // Student's t of 18 degrees of freedom: 64 squares of mean 1.125 and deviation 1.86 each.
        assert!(squares < 64.0 * 1.125 + 4.0 * 8.0 * 1.86, "{shading:?}: {squares}");
        assert!(worst < 5.5, "{shading:?}: {worst}");
        let [dual, real] = [&duals, &reals].map(|all| all.iter().flatten().sum::<f64>());
        assert!((dual / real - 1.0).abs() < 0.02, "{shading:?}: {dual} {real}");
        // And the comparison can fail: what a forgotten cosine would do.
        assert!((dual / (1.2 * real) - 1.0).abs() > 0.02);
    }
}

#[test]
fn products_with_the_matrix_and_its_transpose_agree() {
    let matrix = Transport { camera: 3, projector: 2, values: vec![1.0, 2.0, 0.0, -1.0, 0.5, 4.0] };
    let (l, c) = ([3.0, -2.0], [1.0, 5.0, 0.25]);
    let forward: f64 = matrix.image(&l).expect("2").iter().zip(c).map(|(a, b)| a * b).sum();
    let backward: f64 = matrix.dual(&c).expect("3").iter().zip(l).map(|(a, b)| a * b).sum();
    assert!((forward - backward).abs() < 1e-12 && forward != 0.0);
    assert!(matrix.image(&c).is_err() && matrix.dual(&l).is_err());
}

/// A projector that covers all that the camera sees is a point light of the shipped tracer.
#[test]
fn a_white_projector_is_a_point_light() {
    let candela = 100.0;
    let [camera, projector] = ends(8);
    // The light is 20 mm behind nothing: the same place, all around; only direct light compares.
    let light = Light::Point {
        position: projector.pose.position,
        luminous_power: (candela * 4.0 * PI) as f32,
        range: 1e6,
        color: [1.0; 3],
    };
    let wide = View { vertical_fov_degrees: 160.0, ..projector };
    let tracing = Tracing { samples: 256, bounces: 0, ..Tracing::default() };
    let matrix = Transport::trace(&room(&[]), &camera, &wide, &tracing).expect("a matrix");
    let found = matrix.image(&[candela; 64]).expect("64 pixels");
    let settings = Settings { samples: 256, bounces: Some(0), seed: 9, ..Settings::default() };
    let image = render(&room(&[light]), &camera, &settings, Watch::default()).expect("an image");
    let half = (25.0_f64).to_radians().tan();
    let mut worst = 0.0_f64;
    let (mut all, mut exact_sum) = (0.0, 0.0);
    for (pixel, (found, nits)) in found.iter().zip(image.direct.luminance()).enumerate() {
        // The mean of the solid angle over the pixel, by a sum.
        let (x, y) = ((pixel % 8) as f64, (pixel / 8) as f64);
        let cell = |i: u32| {
            let at = |p: f64, i: u32| ((p + (f64::from(i) + 0.5) / 16.0) / 4.0 - 1.0) * half;
            (1.0 + at(x, i % 16).powi(2) + at(y, i / 16).powi(2)).powf(-1.5)
        };
        let angle = (0..256).map(cell).sum::<f64>() / 256.0 * (half / 4.0).powi(2);
        let exact = f64::from(nits) * angle;
        worst = worst.max((found / exact - 1.0).abs());
        (all, exact_sum) = (all + found, exact_sum + exact);
    }
    assert!((all / exact_sum - 1.0).abs() < 0.01, "{all} {exact_sum}");
    assert!(worst < 0.2, "{worst}");
}

#[test]
fn transforms_multiply_like_the_patterns() {
    let patterns = Patterns::new(64, 20, 3).expect("patterns");
    let image: Vec<f64> = (0..64).map(|i| f64::from(i * i % 11)).collect();
    let dense: Vec<f64> =
        (0..20).map(|k| patterns.pattern(k).iter().zip(&image).map(|(a, b)| a * b).sum()).collect();
    let found = patterns.multiply(&image).expect("64");
    assert!(found.iter().zip(&dense).all(|(a, b)| (a - b).abs() < 1e-9));
    let weights: Vec<f64> = (0..20).map(f64::from).collect();
    let mut sum = vec![0.0; 64];
    for (k, weight) in weights.iter().enumerate() {
        sum.iter_mut().zip(patterns.pattern(k)).for_each(|(sum, own)| *sum += own * weight);
    }
    let found = patterns.transposed(&weights).expect("20");
    assert!(found.iter().zip(&sum).all(|(a, b)| (a - b).abs() < 1e-9));
    assert!(patterns.pattern(3).iter().all(|sign| sign.abs() == 1.0));
    assert_eq!(patterns.pattern(3).iter().sum::<f64>(), 8.0);
    for (pixels, count) in [(63, 5), (64, 65), (64, 0), (0, 1), (1, 1)] {
        assert!(Patterns::new(pixels, count, 0).is_err());
    }
}

#[test]
fn wavelets_are_orthonormal() {
    for (width, height) in [(8, 8), (16, 4), (2, 32), (1, 8)] {
        let image: Vec<f64> = (0..width * height).map(|i| ((i * 37) % 23) as f64 - 7.0).collect();
        let mut found = image.clone();
        Haar::new(width, height).forward(&mut found);
        let energy = |values: &[f64]| values.iter().map(|v| v * v).sum::<f64>();
        assert!((energy(&found) / energy(&image) - 1.0).abs() < 1e-12);
        let mean = image.iter().sum::<f64>() / ((width * height) as f64).sqrt();
        assert!((found[0] - mean).abs() < 1e-9);
        Haar::new(width, height).backward(&mut found);
        assert!(found.iter().zip(&image).all(|(a, b)| (a - b).abs() < 1e-9), "{width}×{height}");
    }
}

/// Root of the mean squared difference ÷ that of the exact values.
fn difference(found: &[f64], exact: &[f64]) -> f64 {
    let squares = |values: &mut dyn Iterator<Item = f64>| values.map(|v| v * v).sum::<f64>();
    let error = squares(&mut found.iter().zip(exact).map(|(a, b)| a - b));
    (error / squares(&mut exact.iter().copied())).sqrt()
}

#[test]
fn a_sparse_dual_image_is_recovered_and_errors_fall_with_patterns() {
    // A projector of 32 × 32 pixels of which each camera pixel sees one block of 4 × 4.
    let values = (0..64).flat_map(|pixel| {
        (0..1024).map(move |i| {
            let block = (i / 128) * 8 + (i % 32) / 4;
            if block == pixel { 1.0 + pixel as f32 / 64.0 } else { 0.0 }
        })
    });
    let matrix = Transport { camera: 64, projector: 1024, values: values.collect() };
    let light: Vec<f64> = (0..64).map(|pixel| f64::from(u8::from(pixel % 9 == 4))).collect();
    let exact = matrix.dual(&light).expect("64 pixels");
    let recovery = Recovery { size: [32, 32], sparsity: 1e-4, iterations: 400 };
    let error = |count, noise| {
        let patterns = Patterns::new(1024, count, 5).expect("patterns");
        let capture = Capture::new(&matrix, patterns, noise, 1).expect("a capture");
        difference(&capture.dual(&light, &recovery).expect("an image"), &exact)
    };
    let [few, some, many] = [64, 256, 768].map(|count| error(count, 0.0));
    assert!(many < 0.05 && some < 0.4 && few > some && some > many, "{few} {some} {many}");
    assert!(error(768, 0.05) > many);
}

#[test]
fn patches_add_up_to_the_whole_and_can_be_relit() {
    let [camera, projector] = ends(16);
    let tracing = Tracing { samples: 32, ..Tracing::default() };
    let matrix = Transport::trace(&room(&[]), &camera, &projector, &tracing).expect("a matrix");
    let patches: Vec<Vec<usize>> = (0..64)
        .map(|patch| (0..256).filter(|i| i / 32 * 8 + i % 16 / 2 == patch).collect())
        .collect();
    assert!(patches.iter().all(|patch| patch.len() == 4));
    let patterns = Patterns::new(256, 256, 5).expect("patterns");
    let capture = Capture::new(&matrix, patterns, 0.0, 1).expect("a capture");
    let recovery = Recovery { size: [16, 16], sparsity: 1e-5, iterations: 400 };
    let basis = capture.patches(&patches, &recovery).expect("64 images");
    for weight in [|_| 1.0, |patch: usize| (patch % 8) as f64 * 0.3] {
        let mut light = vec![0.0; 256];
        let mut sum = vec![0.0; 256];
        for (patch, (pixels, image)) in patches.iter().zip(&basis).enumerate() {
            pixels.iter().for_each(|pixel| light[*pixel] = weight(patch));
            sum.iter_mut().zip(image).for_each(|(sum, own)| *sum += own * weight(patch));
        }
        let error = difference(&sum, &matrix.dual(&light).expect("256 pixels"));
        assert!(error < 0.05, "{error}");
    }
}

#[test]
fn extremes_are_errors_or_finite() {
    let [camera, projector] = ends(4);
    let empty = scene(Vec::new(), Vec::new(), &[]);
    let dark = Transport::trace(&empty, &camera, &projector, &Tracing::default()).expect("zeros");
    assert!(dark.image(&[1.0; 16]).expect("16").iter().all(|value| *value == 0.0));
    let same_place = Transport::trace(&room(&[]), &camera, &camera, &Tracing::default());
    assert!(
        (0..16).all(|i| same_place.as_ref().is_ok_and(|m| m.row(i).iter().all(|v| v.is_finite())))
    );
    let huge = View { size: UVec2::splat(1 << 16), ..camera };
    let refused = Transport::trace(&empty, &huge, &huge, &Tracing::default());
    assert!(matches!(refused, Err(InverseError::TooLarge(_))));
    let none = View { size: UVec2::ZERO, ..camera };
    assert!(Transport::trace(&empty, &none, &camera, &Tracing::default()).is_ok());
    let capture = |noise| {
        Capture::new(&dark, Patterns::new(16, 8, 0).expect("patterns"), noise, 0)
            .expect("a capture")
    };
    let recovery = Recovery { size: [4, 4], sparsity: 0.01, iterations: 10 };
    assert_eq!(capture(0.0).dual(&[1.0; 16], &recovery), Ok(vec![0.0; 16]));
    assert!(capture(0.1).dual(&[1.0; 15], &recovery).is_err());
    for size in [[3, 4], [4, 8], [0, 16]] {
        assert!(capture(0.0).dual(&[1.0; 16], &Recovery { size, ..recovery }).is_err());
    }
    assert_eq!(capture(0.0).patches(&[vec![99]], &recovery), Ok(vec![vec![0.0; 16]]));
}

#[test]
fn noise_is_gaussian() {
    // All but one in a million are within five standard deviations.
    let sample =
        |sampler: &mut Sampler| Some([(0.1 * gaussian(sampler) + 0.5).clamp(0.0, 1.0), 0.0]);
    let density = |[u, _]: [f64; 2]| {
        let x = 10.0 * u - 5.0;
        10.0 * (-0.5 * x * x).exp() / TAU.sqrt()
    };
    fit_square([64, 1], sample, density).assert("noise");
}
