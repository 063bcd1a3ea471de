//! The split against the whole, and density estimates against brute force and closed forms.

mod density;

use std::sync::atomic::{AtomicU32, Ordering};

use glam::{DVec3, UVec2, Vec2, Vec3};

use super::*;
use crate::integrator::{Pixels, ReferenceScene, Settings, View, Watch, render as path_trace};
use crate::light::{Light, Sky};
use crate::metrics::Radiance;
use crate::scene::testing::MeshBuilder;
use crate::scene::{CameraPose, RayScene, SceneGeometry, SceneMaterial};
use crate::testing::fit_directions;

fn matte(albedo: f32) -> SceneMaterial {
    SceneMaterial {
        base_color: [albedo, 0.9 * albedo, 0.8 * albedo, 1.0],
        reflectance: 0.0,
        double_sided: true,
        ..SceneMaterial::default()
    }
}

fn metal() -> SceneMaterial {
    SceneMaterial { metallic: 1.0, perceptual_roughness: 0.2, ..matte(0.9) }
}

fn emitter() -> SceneMaterial {
    SceneMaterial { emissive: [1000.0, 800.0, 600.0], ..matte(0.0) }
}

/// One part of a scene: a material, and what is made of it.
type Part = (SceneMaterial, fn(&mut MeshBuilder));

fn scene(parts: &[Part], lights: &[Light], sky: Sky) -> ReferenceScene {
    let mut geometry = SceneGeometry::default();
    for (material, build) in parts {
        let mut builder = MeshBuilder::new();
        build(&mut builder);
        geometry.meshes.push(builder.finish(geometry.materials.len()));
        geometry.materials.push(material.clone());
    }
    let rays = RayScene::from_geometry(&geometry);
    ReferenceScene::new(geometry.into(), rays.into(), lights, sky).expect("valid geometry")
}

/// A square of side 2 × `half` at y = `height` that faces up.
fn square(builder: &mut MeshBuilder, half: f32, height: f32) {
    builder.quad([
        Vec3::new(-half, height, half),
        Vec3::new(half, height, half),
        Vec3::new(half, height, -half),
        Vec3::new(-half, height, -half),
    ]);
}

/// A matte floor, a metal mirror that stands on it, and a large light over them.
fn room() -> ReferenceScene {
    scene(&room_parts(metal()), &[], Sky::Black)
}

fn room_parts(mirror: SceneMaterial) -> [Part; 3] {
    [
        (matte(0.7), |builder| square(builder, 2.0, 0.0)),
        (mirror, |builder| builder.icosphere(Vec3::new(0.0, 0.6, -0.6), 0.5, 3, false)),
        (emitter(), |builder| {
            builder.cuboid(Vec3::new(-1.5, 2.0, -1.5), Vec3::new(1.5, 2.1, 1.5));
        }),
    ]
}

fn view(size: u32) -> View {
    View {
        pose: CameraPose::looking_at(Vec3::new(0.0, 1.5, 2.2), Vec3::new(0.0, 0.2, -0.3)),
        vertical_fov_degrees: 60.0,
        near: 0.01,
        size: UVec2::splat(size),
    }
}

fn full(scene: &ReferenceScene, size: u32, settings: &Settings, caustics: &Caustics) -> Radiance {
    let watch = Watch::default();
    render(scene, &view(size), settings, caustics, watch).expect("nothing interrupts").full()
}

fn means(images: &[Radiance], tile: usize) -> (f64, f64) {
    let values = images
        .iter()
        .map(|image| image.rgb[tile].iter().map(|value| f64::from(*value)).sum::<f64>() / 3.0);
    let count = images.len() as f64;
    let mean = values.clone().sum::<f64>() / count;
    let variance = values.map(|value| (value - mean).powi(2)).sum::<f64>() / (count - 1.0);
    (mean, (variance / count).sqrt())
}

/// The mean of all light in every tile of 8 × 8 pixels, split and whole, within 4 standard errors
/// and `bias`.
#[track_caller]
fn assert_splits(scene: &ReferenceScene, bounces: Option<u32>, bias: f64) {
    let density = Density::Nearest { count: 20 };
    let caustics = Caustics { photons: 40_000, roughness: 0.3, density };
    let (mut whole, mut split, mut paths) = (Vec::new(), Vec::new(), Vec::new());
    for seed in 0..8 {
        let settings = Settings { samples: 32, bounces, seed, ..Settings::default() };
        let watch = Watch::default();
        let image = path_trace(scene, &view(24), &settings, watch).expect("done").full();
        whole.push(image.boxes(8));
        let parts = render(scene, &view(24), &settings, &caustics, watch).expect("done");
        split.push(parts.full().boxes(8));
        paths.push(parts.paths.boxes(8));
    }
    let mut greatest: f64 = 0.0;
    for tile in 0..whole[0].rgb.len() {
        let ((a, a_error), (b, b_error)) = (means(&whole, tile), means(&split, tile));
        let tolerance = 4.0 * a_error.hypot(b_error) + bias * a;
        assert!((a - b).abs() <= tolerance, "tile {tile}: {a} whole, {b} split, ±{tolerance}");
        greatest = greatest.max(1.0 - means(&paths, tile).0 / a);
    }
    // Else there would be nothing to see.
    assert!(greatest > 3.0 * bias, "photons bring at most {greatest} of a tile");
}

#[test]
fn both_parts_sum_to_all_light() {
    assert_splits(&room(), None, 0.01);
    assert_splits(&room(), Some(1), 0.01);
}

#[test]
fn both_parts_sum_to_all_light_of_mixed_surfaces_points_and_skies() {
    let polished = SceneMaterial { metallic: 0.5, perceptual_roughness: 0.2, ..matte(0.9) };
    let point = Light::Point {
        position: Vec3::new(0.5, 1.8, 0.5),
        luminous_power: 10_000.0,
        // Its window matters here.
        range: 4.0,
        color: [1.0; 3],
    };
    let parts = room_parts(polished);
    assert_splits(&scene(&parts[..2], &[point], Sky::constant([20.0; 3])), None, 0.01);
}

#[test]
fn scaling_the_scene_changes_nothing() {
    // Radiance of a light does not depend on scale; single precision rounds.
    let large: [Part; 3] = [
        (matte(0.7), |builder| square(builder, 16.0, 0.0)),
        (metal(), |builder| builder.icosphere(Vec3::new(0.0, 4.8, -4.8), 4.0, 3, false)),
        (emitter(), |builder| {
            builder.cuboid(Vec3::new(-12.0, 16.0, -12.0), Vec3::new(12.0, 16.8, 12.0));
        }),
    ];
    let settings = Settings { pixels: Pixels::Middle, samples: 1, ..Settings::default() };
    let caustics = Caustics { photons: 20_000, ..Caustics::default() };
    let small = photon_image(&room(), &view(8), &settings, &caustics, Watch::default()).unwrap();
    let pose = CameraPose { position: view(8).pose.position * 8.0, ..view(8).pose };
    let far = View { pose, near: 0.08, ..view(8) };
    let large = scene(&large, &[], Sky::Black);
    let large = photon_image(&large, &far, &settings, &caustics, Watch::default()).unwrap();
    assert!(small.mean() > 1.0, "{}", small.mean());
    for (a, b) in small.rgb.iter().flatten().zip(large.rgb.iter().flatten()) {
        assert!((a - b).abs() <= 0.02 * a.max(*b) + 1e-3, "{a} {b}");
    }
}

#[test]
fn empty_dark_and_broken_scenes_are_finite() {
    let degenerate: Part = (metal(), |builder| {
        builder.quad([Vec3::ZERO; 4]);
        builder.quad([Vec3::NAN, Vec3::X, Vec3::Y, Vec3::ZERO]);
        square(builder, 1.0, 0.0);
    });
    let settings = Settings { samples: 2, ..Settings::default() };
    let densities = [
        Density::Nearest { count: 0 },
        Density::Adaptive { passes: 0, first: 0 },
        Density::Adaptive { passes: 3, first: u32::MAX },
    ];
    let sky = || Sky::constant([f32::MAX; 3]);
    for density in densities {
        for photons in [0, 1, 300] {
            for roughness in [0.3, f32::NAN] {
                let caustics = Caustics { photons, roughness, density };
                for scene in [
                    scene(&[], &[], Sky::Black),
                    scene(&[], &[], Sky::constant([1.0; 3])),
                    scene(std::slice::from_ref(&degenerate), &[], Sky::constant([1.0; 3])),
                    scene(std::slice::from_ref(&degenerate), &[], sky()),
                    room(),
                ] {
                    let image = full(&scene, 4, &settings, &caustics);
                    assert!(image.rgb.iter().flatten().all(|value| value.is_finite()));
                }
            }
        }
    }
    let stop = Watch { interrupted: &|| true, ..Watch::default() };
    assert!(render(&room(), &view(4), &settings, &Caustics::default(), stop).is_none());
}

#[test]
fn passes_and_rows_are_reported() {
    let done = AtomicU32::new(0);
    let add = || {
        done.fetch_add(1, Ordering::Relaxed);
    };
    let watch = Watch { row_done: &add, ..Watch::default() };
    let settings = Settings { samples: 2, bounces: Some(1), ..Settings::default() };
    let count = |scene: &ReferenceScene, density, is_whole| {
        let caustics = Caustics { photons: 50, density, ..Caustics::default() };
        done.store(0, Ordering::Relaxed);
        if is_whole {
            render(scene, &view(4), &settings, &caustics, watch).unwrap();
        } else {
            photon_image(scene, &view(4), &settings, &caustics, watch).unwrap();
        }
        done.load(Ordering::Relaxed)
    };
    let (lit, dark) = (room(), scene(&[], &[], Sky::Black));
    for (density, passes) in
        [(Density::Nearest { count: 5 }, 1), (Density::Adaptive { passes: 3, first: 5 }, 3)]
    {
        for scene in [&lit, &dark] {
            assert_eq!(
                [false, true].map(|is_whole| count(scene, density, is_whole)),
                [passes, passes + 4]
            );
        }
    }
}

#[test]
fn more_passes_come_nearer() {
    // Against many photons: 16 times the photons have less error.
    let settings = Settings { pixels: Pixels::Middle, samples: 1, ..Settings::default() };
    let image = |photons, seed, passes| {
        let caustics = Caustics {
            photons,
            density: Density::Adaptive { passes, first: 10 },
            ..Caustics::default()
        };
        let settings = Settings { seed, ..settings };
        photon_image(&room(), &view(16), &settings, &caustics, Watch::default()).unwrap()
    };
    let exact = image(2_000_000, 99, 32);
    let error = |photons, passes| {
        let image = image(photons, 1, passes);
        let pairs = image.rgb.iter().flatten().zip(exact.rgb.iter().flatten());
        pairs.map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>().sqrt()
    };
    let (few, many) = (error(20_000, 4), error(320_000, 64));
    // The theory has (1/16)^(1/3), 0.40.
    assert!(many < 0.6 * few, "{many} of {few}");
}

fn unit(x: f64, y: f64, z: f64) -> Vec3 {
    DVec3::new(x, y, z).normalize().as_vec3()
}

fn at(place: Vec2) -> Vec3 {
    Vec3::new(place.x, 0.0, place.y)
}

#[test]
fn sampled_parts_and_directions_have_their_densities() {
    let polished = SceneMaterial { metallic: 0.5, perceptual_roughness: 0.25, ..matte(0.9) };
    let floor = scene(&[(polished, |builder| square(builder, 2.0, 0.0))], &[], Sky::Black);
    let caustics = Caustics { photons: 1, roughness: 0.3, density: Density::Nearest { count: 1 } };
    let settings = Settings::default();
    let split = Split { scene: &floor, settings: &settings, caustics: &caustics };
    let direction = DVec3::new(0.48, -0.8, 0.36);
    let reflector = split.closest((-direction).as_vec3(), direction).expect("the floor");
    for is_specular in [false, true] {
        let fit = fit_directions(
            (direction.with_y(0.8), 4),
            |sampler| {
                let reflected = reflector.sample(sampler)?;
                (reflected.is_specular == is_specular).then_some(reflected.direction)
            },
            |to| {
                reflector.lobes(to).map_or(0.0, |lobes| {
                    let [specular, diffuse] = [lobes.specular, lobes.diffuse].map(luminance);
                    let own = if is_specular { specular } else { diffuse };
                    lobes.density * own / (specular + diffuse)
                })
            },
        );
        fit.assert(if is_specular { "specular part" } else { "diffuse part" });
    }
}
