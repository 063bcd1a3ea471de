//! A room from where a projector stands, without a camera there.
//!
//! `cargo run --release -p frugal_trace --features inverse --example dual -- [SEEDS [PICTURE.png]]`
//!
//! Prints how far the dual image is from that of a camera in the projector's place, and how far
//! images from few patterns are from the dual image: of the whole light at once, and as the sum of
//! 64 patches. From left to right the picture shows the camera's view, the projector's by the
//! transposed matrix and by a camera in its place, then from 512 and 2048 patterns at once, from 512
//! and 2048 by patches, and the last one relit from the left.

use std::error::Error;
use std::path::Path;

use frugal_trace::integrator::{ReferenceScene, View};
use frugal_trace::inverse::{Capture, Patterns, Recovery, Tracing, Transport};
use frugal_trace::light::Sky;
use frugal_trace::metrics::{Picture, Radiance, tone};
use frugal_trace::scene::{CameraPose, RayScene, SceneGeometry, SceneMaterial, SceneMesh};
use glam::{UVec2, Vec2, Vec3};

/// Pixels along each side of camera and projector.
const SIDE: usize = 64;
/// Patches along each side.
const PATCHES: usize = 8;
const COUNTS: [usize; 4] = [256, 512, 1024, 2048];
/// Noise of an exposure ÷ its mean.
const NOISE: f64 = 0.01;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let seeds: u64 = arguments.next().map_or(Ok(1), |text| text.parse())?;
    let file = arguments.next();
    let scene = room()?;
    let [camera, projector] = [[-1.2, 1.5, 1.8], [1.6, 1.9, 1.4]].map(view);
    let mut pictures = Vec::new();
    for seed in 0..seeds {
        let tracing = Tracing { samples: 64, seed, ..Tracing::default() };
        let there = Transport::trace(&scene, &camera, &projector, &tracing)?;
        let swapped = Tracing { seed: seed + 1000, ..tracing };
        let back = Transport::trace(&scene, &projector, &camera, &swapped)?;
        let all = vec![1.0; SIDE * SIDE];
        let (dual, real) = (there.dual(&all)?, back.image(&all)?);
        let sums = [&dual, &real].map(|image| image.iter().sum::<f64>());
        println!(
            "seed {seed} dual against real: mean {:.4}, pixels differ by {:.3} (noise of 64 paths)",
            sums[0] / sums[1],
            difference(&dual, &real)
        );
        pictures = vec![there.image(&all)?, dual.clone(), real];
        let patches = patches();
        let mut by_patches = Vec::new();
        for count in COUNTS {
            let capture =
                Capture::new(&there, Patterns::new(SIDE * SIDE, count, seed)?, NOISE, seed)?;
            let recovery = |sparsity| Recovery { size: [SIDE; 2], sparsity, iterations: 200 };
            let whole = capture.dual(&all, &recovery(0.01))?;
            let basis = capture.patches(&patches, &recovery(0.01))?;
            let sum = relit(&basis, |_| 1.0);
            println!(
                "seed {seed} {count:5} patterns: at once {:.3}, by patches {:.3}",
                difference(&whole, &dual),
                difference(&sum, &dual)
            );
            if [512, 2048].contains(&count) {
                let before = pictures.len() - by_patches.len();
                pictures.insert(before, whole);
                pictures.push(sum.clone());
                by_patches.push(sum);
            }
            if count == 2048 {
                let left = |patch: usize| (1.0 - (patch % PATCHES) as f64 / 4.0).max(0.0) * 3.0;
                let mut light = vec![0.0; SIDE * SIDE];
                for (patch, pixels) in patches.iter().enumerate() {
                    pixels.iter().for_each(|pixel| light[*pixel] = left(patch));
                }
                let (found, exact) = (relit(&basis, left), there.dual(&light)?);
                println!("seed {seed} relit from the left: {:.3}", difference(&found, &exact));
                pictures.push(found);
            }
        }
    }
    if let Some(file) = file {
        strip(&pictures).write_png(Path::new(&file))?;
    }
    Ok(())
}

/// Root of the mean squared difference ÷ that of the exact values.
fn difference(found: &[f64], exact: &[f64]) -> f64 {
    let error: f64 = found.iter().zip(exact).map(|(a, b)| (a - b).powi(2)).sum();
    (error / exact.iter().map(|value| value * value).sum::<f64>()).sqrt()
}

/// The camera's pixels of each patch, row by row.
fn patches() -> Vec<Vec<usize>> {
    let side = SIDE / PATCHES;
    let of = |pixel: usize| pixel / SIDE / side * PATCHES + pixel % SIDE / side;
    let patch = |patch| (0..SIDE * SIDE).filter(|pixel| of(*pixel) == patch).collect();
    (0..PATCHES * PATCHES).map(patch).collect()
}

/// The sum of the patches' images with these weights.
fn relit(basis: &[Vec<f64>], weight: impl Fn(usize) -> f64) -> Vec<f64> {
    let mut sum = vec![0.0; SIDE * SIDE];
    for (patch, image) in basis.iter().enumerate() {
        sum.iter_mut().zip(image).for_each(|(sum, own)| *sum += own * weight(patch));
    }
    sum
}

/// Pictures side by side, each pixel four times as large.
fn strip(pictures: &[Vec<f64>]) -> Picture {
    let side = SIDE as u32;
    let shown: Vec<Picture> = pictures
        .iter()
        .map(|values| {
            let rgb = values.iter().map(|value| [(*value * 1e6) as f32; 3]).collect();
            let image = Radiance { width: side, height: side, rgb };
            tone::display(&image, tone::middle_grey_ev100(&image))
        })
        .collect();
    Picture::from_fn(side * 4 * shown.len() as u32, side * 4, |x, y| {
        shown[(x / (side * 4)) as usize].rgb[(y / 4 * side + x % (side * 4) / 4) as usize]
    })
}

fn view(from: [f32; 3]) -> View {
    View {
        pose: CameraPose::looking_at(from.into(), Vec3::new(0.0, 0.6, -0.4)),
        vertical_fov_degrees: 60.0,
        near: 1e-3,
        size: UVec2::splat(SIDE as u32),
    }
}

/// A room with a box, a pillar and a dark panel.
fn room() -> Result<ReferenceScene, Box<dyn Error>> {
    let mut geometry = SceneGeometry::default();
    let mut solid = |albedo: f32, low: [f32; 3], high: [f32; 3]| {
        let material = geometry.materials.len();
        geometry.materials.push(SceneMaterial {
            base_color: [albedo, albedo, albedo, 1.0],
            double_sided: true,
            ..SceneMaterial::default()
        });
        geometry.meshes.push(SceneMesh { material, ..cuboid(low.into(), high.into()) });
    };
    solid(0.7, [-2.0, 0.0, -2.0], [2.0, 2.5, 2.0]);
    solid(0.5, [-0.8, 0.0, -0.9], [0.1, 0.9, -0.1]);
    solid(0.8, [0.6, 0.0, -1.3], [0.9, 1.8, -1.0]);
    solid(0.1, [-1.6, 0.8, -1.99], [-0.6, 1.8, -1.97]);
    let rays = RayScene::from_geometry(&geometry);
    Ok(ReferenceScene::new(geometry.into(), rays.into(), &[], Sky::Black)?)
}

fn cuboid(low: Vec3, high: Vec3) -> SceneMesh {
    let (center, half) = (0.5 * (low + high), 0.5 * (high - low));
    let mut mesh = SceneMesh::default();
    for axis in Vec3::AXES.into_iter().flat_map(|axis| [axis, -axis]) {
        let up = if axis.y == 0.0 { Vec3::Y } else { Vec3::Z };
        let right = up.cross(axis);
        let first = mesh.positions.len() as u32;
        for (r, u) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
            mesh.positions.push(center + (axis + right * r + up * u) * half);
            mesh.normals.push(axis);
            mesh.uvs.push(Vec2::ZERO);
        }
        mesh.indices.extend([0, 1, 2, 0, 2, 3].map(|i| first + i));
    }
    mesh
}
