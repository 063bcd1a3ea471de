//! Fog with closed forms, and invariants of its sampling.

use std::f64::consts::PI;

use glam::{DVec3, UVec2, Vec3};

use super::super::tests::{self, point_light, trace};
use super::super::*;
use crate::bsdf::Shading;
use crate::light::{Light, Sky};
use crate::media::Fog;
use crate::sampler::Sampler;
use crate::scene::testing::MeshBuilder;
use crate::scene::{Bounds, CameraPose, SceneGeometry, SceneMaterial};
use crate::testing::statistics;

fn fog(absorption: f32, scattering: f32, half: f32) -> Fog {
    Fog {
        absorption: [absorption; 3],
        scattering: [scattering; 3],
        asymmetry: 0.0,
        bounds: Bounds { min: Vec3::splat(-half), max: Vec3::splat(half) },
    }
}

/// A scene of meshes, each with its material.
fn scene(parts: Vec<(SceneMaterial, MeshBuilder)>, lights: &[Light], sky: Sky) -> ReferenceScene {
    let mut geometry = SceneGeometry::default();
    for (material, builder) in parts {
        geometry.meshes.push(builder.finish(geometry.materials.len()));
        geometry.materials.push(material);
    }
    tests::scene(geometry, lights, sky)
}

fn matte(albedo: f32, nits: f32) -> SceneMaterial {
    SceneMaterial {
        base_color: [albedo, albedo, albedo, 1.0],
        emissive: [nits; 3],
        reflectance: 0.0,
        ..SceneMaterial::default()
    }
}

fn lambertian(bounces: Option<u32>) -> Settings {
    Settings { bounces, shading: Shading::Lambertian, ..Settings::default() }
}

/// Mean and standard error of the red channel along one ray.
fn measure(
    scene: &ReferenceScene,
    settings: &Settings,
    count: u64,
    origin: Vec3,
    direction: DVec3,
) -> (f64, f64) {
    statistics((0..count).map(|i| {
        let mut sampler = Sampler::new(settings.seed, i, 0);
        let found = trace(scene, settings, None, origin, direction, &mut sampler);
        found.direct.x + found.indirect.x
    }))
}

/// Within four standard errors.
#[track_caller]
fn assert_is((mean, error): (f64, f64), exact: f64, greatest_error: f64) {
    assert!((mean - exact).abs() <= 4.0 * error + 1e-6, "{mean} ± {error} is not {exact}");
    assert!(error <= greatest_error * exact, "{mean} ± {error}");
}

#[test]
fn white_fog_in_white_surroundings_is_invisible() {
    let direction = DVec3::new(0.6, 0.0, 0.8);
    for asymmetry in [0.0, 0.7, -0.4] {
        let fog = Fog { asymmetry, ..fog(0.0, 1.5, 1.0) };
        let open = scene(Vec::new(), &[], Sky::constant([1.0; 3])).with_fog(fog).unwrap();
        assert_is(measure(&open, &lambertian(None), 4000, Vec3::NEG_Z, direction), 1.0, 0.02);
        // The same light from walls, which are sampled, too.
        let mut room = MeshBuilder::new();
        room.room(Vec3::splat(-1.0), Vec3::splat(1.0));
        let room = scene(vec![(matte(0.0, 1.0), room)], &[], Sky::Black).with_fog(fog).unwrap();
        for strategy in [Strategy::Combined, Strategy::Lights, Strategy::Scattering] {
            let settings = Settings { strategy, ..lambertian(None) };
            let found = measure(&room, &settings, 4000, Vec3::new(0.1, 0.2, -0.5), direction);
            assert_is(found, 1.0, 0.2);
        }
    }
}

#[test]
fn colours_of_white_fog_sum_up_to_white_on_every_path() {
    let fog = Fog { scattering: [0.4, 1.5, 4.0], asymmetry: 0.6, ..fog(0.0, 0.0, 1.0) };
    let open = scene(Vec::new(), &[], Sky::constant([1.0; 3])).with_fog(fog).unwrap();
    // No roulette, and no path that long.
    let settings = lambertian(Some(1000));
    let direction = DVec3::new(0.6, 0.0, 0.8);
    let lights: Vec<DVec3> = (0..4000)
        .map(|i| {
            let mut sampler = Sampler::new(0, i, 0);
            let found = trace(&open, &settings, None, Vec3::NEG_Z, direction, &mut sampler);
            found.direct + found.indirect
        })
        .collect();
    for light in &lights {
        assert!((light.element_sum() / 3.0 - 1.0).abs() < 1e-9, "{light}");
    }
    for channel in 0..3 {
        assert_is(statistics(lights.iter().map(|light| light[channel])), 1.0, 0.02);
    }
}

#[test]
fn fog_that_only_absorbs_dims_by_beer_and_lambert() {
    let fog = Fog { absorption: [0.1, 0.4, 2.0], ..fog(0.0, 0.0, 1.0) };
    let scene = scene(Vec::new(), &[], Sky::constant([3.0; 3])).with_fog(fog).unwrap();
    let mut sampler = Sampler::new(0, 0, 0);
    let found = trace(&scene, &lambertian(None), None, Vec3::Z * 5.0, DVec3::NEG_Z, &mut sampler);
    for (found, absorption) in found.direct.to_array().into_iter().zip(fog.absorption) {
        let exact = 3.0 * (-2.0 * f64::from(absorption)).exp();
        assert!((found / exact - 1.0).abs() < 1e-9, "{found} {exact}");
    }
    assert_eq!(found.indirect, DVec3::ZERO);
}

#[test]
fn light_scattered_once_is_that_of_a_quadrature() {
    let lamp = Vec3::new(0.06, 0.08, 0.0);
    let (power, absorption, scattering) = (1000.0_f32, 0.1_f32, 0.4_f32);
    for asymmetry in [0.0_f32, 0.6] {
        let fog = Fog { asymmetry, ..fog(absorption, scattering, 2.0) };
        // ∫ T(t) σs p(cos) I/d² T(d) dt from the box's face, 1 m ahead.
        let extinction = f64::from(absorption) + f64::from(scattering);
        let steps = 100_000;
        let exact: f64 = (0..steps)
            .map(|step| {
                let distance = 4.0 * (f64::from(step) + 0.5) / f64::from(steps);
                let ray = lamp.as_dvec3() - DVec3::new(0.0, 0.0, 2.0 - distance);
                let g = f64::from(asymmetry);
                // Light travels along −ray, the path towards the camera along +Z.
                let cosine = (-ray.normalize()).dot(DVec3::Z);
                let phase = (1.0 - g * g) / (4.0 * PI * (1.0 + g * g - 2.0 * g * cosine).powf(1.5));
                f64::from(scattering) * phase * f64::from(power) / (4.0 * PI) / ray.length_squared()
                    * (-extinction * (distance + ray.length())).exp()
                    * 4.0
                    / f64::from(steps)
            })
            .sum();
        let scene = scene(Vec::new(), &[point_light(lamp, power)], Sky::Black);
        let scene = scene.with_fog(fog).unwrap();
        let found = measure(&scene, &lambertian(Some(0)), 8000, Vec3::Z * 3.0, DVec3::NEG_Z);
        // Distances by transmittance alone have more than twice that error.
        assert_is(found, exact, 0.025);
    }
}

/// A room with a lamp on its ceiling, a dark slab below it, and a point light.
fn room() -> ReferenceScene {
    let mut walls = MeshBuilder::new();
    walls.room(Vec3::splat(-1.0), Vec3::splat(1.0));
    walls.cuboid(Vec3::new(-0.4, 0.2, -0.4), Vec3::new(0.4, 0.25, 0.4));
    let mut lamp = MeshBuilder::new();
    lamp.cuboid(Vec3::new(-0.3, 0.9, -0.3), Vec3::new(0.3, 0.95, 0.3));
    let light = point_light(Vec3::new(0.8, -0.5, 0.6), 60.0);
    scene(vec![(matte(0.6, 0.0), walls), (matte(0.0, 10.0), lamp)], &[light], Sky::Black)
}

#[test]
fn all_ways_to_sample_have_the_same_mean() {
    let fog = Fog { scattering: [0.3, 0.8, 0.5], asymmetry: 0.4, ..fog(0.1, 0.0, 0.9) };
    let (from, to) = (Vec3::new(0.1, 0.3, -0.95), DVec3::new(0.1, 0.1, 1.0).normalize());
    for bounces in [Some(0), Some(2)] {
        let strategies = [Strategy::Combined, Strategy::Lights, Strategy::Scattering];
        let all = strategies.map(|strategy| {
            let room = room().with_fog(fog).unwrap();
            measure(&room, &Settings { strategy, ..lambertian(bounces) }, 12_000, from, to)
        });
        for (mean, error) in &all[1..] {
            let tolerance = 4.0 * error.hypot(all[0].1);
            assert!((mean - all[0].0).abs() < tolerance, "{bounces:?}: {all:?}");
        }
        assert!(all[0].1 < 0.03 * all[0].0, "{all:?}");
    }
}

#[test]
fn fog_without_density_changes_no_bit_and_thin_fog_hardly_the_mean() {
    let view = View {
        pose: CameraPose::looking_at(Vec3::new(0.0, 0.0, -0.9), Vec3::Z),
        vertical_fov_degrees: 60.0,
        near: 0.01,
        size: UVec2::new(8, 6),
    };
    let settings = Settings { samples: 16, ..Settings::default() };
    let image = |scene: &ReferenceScene| render(scene, &view, &settings, Watch::default()).unwrap();
    let clear = image(&room());
    assert_eq!(image(&room().with_fog(fog(0.0, 0.0, 1.0)).unwrap()), clear);
    let thin = image(&room().with_fog(fog(1e-4, 1e-4, 1.0)).unwrap());
    assert_ne!(thin, clear);
    assert!((thin.full().mean() / clear.full().mean() - 1.0).abs() < 0.05);
}

#[test]
fn lights_in_odd_places_leave_fog_finite() {
    let lights = [
        point_light(Vec3::Z, 100.0),
        Light::Directional { direction: Vec3::Z, illuminance: 1.0, color: [1.0; 3] },
    ];
    let fog = fog(0.0, 40.0, 1.0);
    let mut flat = MeshBuilder::new();
    flat.quad([Vec3::ZERO; 4]);
    let open = scene(vec![(matte(0.5, 1.0), flat)], &lights, Sky::Black).with_fog(fog).unwrap();
    for (origin, direction) in [
        (Vec3::Z * 5.0, DVec3::NEG_Z),
        (Vec3::Z, DVec3::NEG_Z),
        (Vec3::NAN, DVec3::NEG_Z),
        (Vec3::ONE, DVec3::X),
    ] {
        let (mean, _) = measure(&open, &lambertian(Some(5)), 64, origin, direction);
        assert!(mean.is_finite() && mean >= 0.0, "{origin} {direction}: {mean}");
    }
}
