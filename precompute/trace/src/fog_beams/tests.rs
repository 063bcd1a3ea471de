//! Beams against closed forms, against paths, and with hostile input.

use std::f64::consts::PI;

use glam::Vec3;

use super::*;
use crate::integrator::photons::Emission;
use crate::integrator::{self, Pixels};
use crate::light::{Light, Sky};
use crate::scene::testing::MeshBuilder;
use crate::scene::{Bounds, CameraPose, RayScene, SceneGeometry, SceneMaterial};
use crate::testing::statistics;

fn fog(absorption: f32, scattering: f32) -> Fog {
    Fog {
        absorption: [absorption; 3],
        scattering: [scattering; 3],
        asymmetry: 0.4,
        bounds: Bounds { min: Vec3::splat(-1.0), max: Vec3::splat(1.0) },
    }
}

fn material(albedo: f32, nits: f32) -> SceneMaterial {
    SceneMaterial {
        base_color: [albedo, albedo, albedo, 1.0],
        emissive: [nits; 3],
        reflectance: 0.0,
        double_sided: true,
        ..SceneMaterial::default()
    }
}

fn scene(parts: Vec<(SceneMaterial, MeshBuilder)>, lights: &[Light], fog: Fog) -> ReferenceScene {
    let mut geometry = SceneGeometry::default();
    for (material, builder) in parts {
        geometry.meshes.push(builder.finish(geometry.materials.len()));
        geometry.materials.push(material);
    }
    let rays = RayScene::from_geometry(&geometry);
    let scene = ReferenceScene::new(geometry.into(), rays.into(), lights, Sky::Black).unwrap();
    scene.with_fog(fog).unwrap()
}

/// A floor of 2 m, 0.9 m below the middle.
fn floor() -> MeshBuilder {
    let mut builder = MeshBuilder::new();
    let corner = |x: f32, z: f32| Vec3::new(x, -0.9, z);
    builder.quad([corner(-1.0, 1.0), corner(1.0, 1.0), corner(1.0, -1.0), corner(-1.0, -1.0)]);
    builder
}

fn point_light(position: Vec3) -> Light {
    Light::Point { position, luminous_power: 1000.0, range: 1e3, color: [1.0; 3] }
}

/// A light above a black floor.
fn lit(fog: Fog) -> ReferenceScene {
    scene(vec![(material(0.0, 0.0), floor())], &[point_light(Vec3::new(0.2, 0.3, -0.1))], fog)
}

/// Looks over the floor into darkness: all that it sees is scattered by fog.
fn view(size: [u32; 2]) -> View {
    View {
        pose: CameraPose::looking_at(Vec3::Z * 3.0, Vec3::ZERO),
        vertical_fov_degrees: 26.0,
        near: 0.01,
        size: size.into(),
    }
}

fn once(samples: u32, seed: u64) -> Settings {
    let pixels = Pixels::Middle;
    Settings { samples, seed, bounces: Some(0), pixels, ..Settings::default() }
}

fn image(scene: &ReferenceScene, view: &View, settings: &Settings, photons: u32) -> Radiance {
    render(scene, view, settings, photons, 0.1, Watch::default()).unwrap()
}

/// ∫ T(t) σs p(cos) I/d² T(d) dt of the light through the middle of a view of one pixel, nits.
fn exact(fog: &Fog) -> f64 {
    let extinction = fog.extinction().x;
    let steps = 20_000;
    let step = |step: i32| {
        let distance = 2.0 * (f64::from(step) + 0.5) / f64::from(steps);
        let ray = DVec3::new(0.2, 0.3, -0.1) - DVec3::new(0.0, 0.0, 1.0 - distance);
        let phase = density(fog.asymmetry(), -ray.normalize().z);
        let through = (-extinction * (distance + ray.length())).exp();
        fog.scattering().x * phase * 1000.0 / (4.0 * PI) / ray.length_squared() * through
    };
    (0..steps).map(step).sum::<f64>() * 2.0 / f64::from(steps)
}

/// A photon of a light, and its line through fog.
fn beam(scene: &ReferenceScene, start: [f64; 5]) -> Beam {
    let settings = Settings::default();
    let flight = Emission::new(scene, &settings).unwrap().emit(&start).unwrap();
    let line = scene.fog.unwrap().line(flight.origin.as_dvec3(), flight.direction, 0.7).unwrap();
    Beam::new(flight, line, DVec3::Z * 3.0)
}

#[test]
fn a_beam_across_a_ray_has_the_light_of_the_closed_form() {
    let fog = fog(0.7, 0.5);
    let scene = lit(fog);
    let beam = beam(&scene, [0.5, 0.3, 0.2, 0.0, 0.0]);
    // Rays beside each other, all as far along the beam: the kernel's integral is 1.
    let (light, eye) = (0.4, 0.6);
    let direction = DVec3::new(0.3, 0.5, -0.8).normalize();
    let across = direction.cross(beam.line.direction).normalize();
    let (steps, radius) = (1000, 0.1);
    let sum: f64 = (0..steps)
        .map(|step| {
            let offset = 0.12 * (2.0 * (f64::from(step) + 0.5) / f64::from(steps) - 1.0);
            let origin = beam.line.at(light) + across * offset - direction * eye;
            let ray = Line { origin, direction, near: 0.0, far: 1.0, ..beam.line };
            beam.seen(&fog, &ray, radius).map_or(0.0, |seen| seen.0.x) * 0.24 / f64::from(steps)
        })
        .sum();
    let cosine = direction.dot(beam.line.direction);
    let (phase, sine) = (density(0.4_f32.into(), -cosine), (1.0 - cosine * cosine).sqrt());
    let exact = 1000.0 * 0.5 * phase * (-1.2 * (light + eye)).exp() / sine;
    assert!((sum / exact - 1.0).abs() < 1e-5, "{sum} {exact}");
}

#[test]
fn once_scattered_light_is_that_of_a_quadrature_and_its_error_falls_as_theory_says() {
    let fog = fog(0.1, 0.4);
    let (scene, exact) = (lit(fog), exact(&fog));
    let values = |passes: u32| -> Vec<f64> {
        let one = |seed| image(&scene, &view([1, 1]), &once(passes, seed), 300).rgb[0][0];
        (0..200).map(one).map(f64::from).collect()
    };
    let (short, long) = (values(4), values(64));
    let (mean, error) = statistics(long.iter().copied());
    let tolerance = 3.0 * error;
    assert!((mean - exact).abs() < tolerance && error < 0.02 * exact, "{mean} ± {error}, {exact}");
    let square = |values: &[f64]| statistics(values.iter().map(|value| (value - exact).powi(2))).0;
    // Two to three standard errors of a slope from 200 values at each end.
    let slope = (square(&long) / square(&short)).ln() / 16.0_f64.ln();
    assert!((slope + 0.8).abs() < 0.15, "{slope}");
}

#[test]
fn white_fog_in_an_even_room_has_the_light_that_it_hides() {
    let mut room = MeshBuilder::new();
    room.room(Vec3::splat(-1.0), Vec3::splat(1.0));
    let scene = scene(vec![(material(0.0, 1.0), room)], &[], fog(0.0, 1.5));
    let view =
        View { pose: CameraPose::looking_at(Vec3::new(0.1, 0.2, 0.9), Vec3::ZERO), ..view([4, 3]) };
    let eye = view.pose.position.as_dvec3();
    let exact: f64 = integrator::surfaces(&scene, &view)
        .into_iter()
        .map(|hit| 1.0 - (-1.5 * (hit.unwrap().position.distance(eye) - 0.01)).exp())
        .sum::<f64>()
        / 12.0;
    let settings = |seed| Settings { bounces: None, ..once(16, seed) };
    let found = (0..24).map(|seed| image(&scene, &view, &settings(seed), 1000).mean());
    let (mean, error) = statistics(found);
    assert!((mean - exact).abs() < 3.0 * error && error < 0.02, "{mean} ± {error}, {exact}");
}

#[test]
fn beams_and_paths_have_the_same_mean() {
    let mut panel = MeshBuilder::new();
    panel.cuboid(Vec3::new(-0.9, 0.6, -0.3), Vec3::new(-0.5, 0.65, 0.3));
    let mut slab = MeshBuilder::new();
    slab.cuboid(Vec3::new(-0.6, 0.2, -0.4), Vec3::new(0.3, 0.25, 0.2));
    let mut metal = MeshBuilder::new();
    metal.cuboid(Vec3::new(0.3, -0.85, -0.5), Vec3::new(0.9, -0.8, 0.3));
    let rough = SceneMaterial { metallic: 1.0, perceptual_roughness: 0.5, ..material(0.9, 0.0) };
    let spot = Light::Spot {
        position: Vec3::new(0.9, 0.9, 0.5),
        direction: Vec3::new(-0.3, -1.7, -0.5),
        luminous_power: 2000.0,
        range: 4.0,
        inner_angle: 10.0,
        outer_angle: 25.0,
        color: [1.0, 0.8, 0.6],
    };
    let fog = Fog { scattering: [0.3, 0.8, 0.5], ..fog(0.2, 0.0) };
    let parts = vec![
        (material(0.6, 0.0), floor()),
        (material(0.0, 50.0), panel),
        (material(0.0, 0.0), slab),
        (rough, metal),
    ];
    let scene = scene(parts, &[spot], fog);
    // Above all surfaces that reflect or emit.
    let view = View { vertical_fov_degrees: 8.0, ..view([4, 3]) };
    for bounces in [Some(0), Some(2)] {
        let settings = |samples, seed| Settings { bounces, ..once(samples, seed) };
        let beams = (0..24).map(|seed| image(&scene, &view, &settings(6, seed), 1000).mean());
        let (mean, error) = statistics(beams);
        let paths = (0..24).map(|seed| {
            let watch = Watch::default();
            integrator::render(&scene, &view, &settings(512, seed), watch).unwrap().full().mean()
        });
        let (exact, other) = statistics(paths);
        let tolerance = 3.0 * error.hypot(other);
        assert!((mean - exact).abs() < tolerance, "{mean} ± {error}, {exact} ± {other}");
        assert!(tolerance < 0.1 * exact, "{tolerance} of {exact}");
    }
}

#[test]
fn tiles_lose_no_beam() {
    let fog = fog(0.1, 0.4);
    let (scene, view, settings) = (lit(fog), view([9, 5]), once(1, 3));
    let beams = emitted(&scene, &settings, 3, [0, 500], &|| false, |flight, sampler, found| {
        walk(flight, &scene, &fog, &settings, sampler, |flight, line| {
            found.push(Beam::new(flight, line, view.pose.position.as_dvec3()));
        });
    });
    let beams = beams.unwrap();
    for radius in [1e-3, 0.05, 5.0] {
        let (scene, view, settings) = (&scene, &view, &settings);
        let (fog, beams, records) =
            (&fog, &beams, &Vec::from_iter((0..45).map(|_| Mutex::new(()))));
        let (pass, share) = (0, 1.0);
        let pass = Pass { scene, view, settings, fog, beams, records, share, pass, radius };
        let all: Vec<usize> = (0..beams.len()).collect();
        let mut found = vec![DVec3::ZERO; 45];
        for (pixel, light) in pass.tile([0, 0], [9, 5], &all) {
            found[pixel] = light;
        }
        for (pixel, found) in found.into_iter().enumerate() {
            let exact = pass.pixel([pixel as u32 % 9, pixel as u32 / 9], &all).1;
            assert_eq!(found, exact, "{pixel} at {radius}");
        }
    }
}

#[test]
fn extremes_give_finite_light_or_none() {
    let get = |scene: &ReferenceScene, radius: f64| {
        render(scene, &view([4, 3]), &once(2, 0), 200, radius, Watch::default())
    };
    let is_dark = |image: Radiance| image.rgb.iter().all(|rgb| *rgb == [0.0; 3]);
    assert!(is_dark(get(&lit(fog(2.0, 0.0)), 0.1).unwrap()), "albedo 0");
    let dark = scene(vec![(material(0.5, 0.0), floor())], &[], fog(0.1, 0.5));
    assert!(is_dark(get(&dark, 0.1).unwrap()), "no light");
    assert!(is_dark(get(&scene(vec![], &[point_light(Vec3::ZERO)], fog(0.1, 0.5)), 0.1).unwrap()));
    for (absorption, scattering) in [(0.0, 1e-6), (1e-6, 1e-6), (0.0, 1e6), (1e6, 1e6)] {
        let image = get(&lit(fog(absorption, scattering)), 0.1).unwrap();
        assert!(image.rgb.iter().flatten().all(|value| value.is_finite() && *value >= 0.0));
        assert!(scattering > 1.0 || image.mean() > 0.0);
    }
    let plain = lit(fog(0.1, 0.5));
    for radius in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(get(&plain, radius).is_none());
    }
    assert!(get(&plain, 1e-12).is_some() && get(&plain, 1e12).is_some());
    assert!(get(&lit(fog(0.0, 0.0)), 0.1).is_none(), "no fog");
    let stop = Watch { interrupted: &|| true, ..Watch::default() };
    assert!(render(&plain, &view([4, 3]), &once(2, 0), 200, 0.1, stop).is_none());
    // In line with the ray, beside it, and without length.
    let one = beam(&plain, [0.5, 0.3, 0.2, 0.0, 0.0]);
    for offset in [DVec3::ZERO, DVec3::splat(0.01)] {
        for direction in [one.line.direction, -one.line.direction] {
            let ray = Line { origin: one.line.origin + offset, direction, ..one.line };
            assert!(one.seen(&fog(0.1, 0.5), &ray, 0.1).is_none_or(|seen| seen.0.is_finite()));
        }
    }
    let none = Beam::new(one.flight, Line { far: one.line.near, ..one.line }, DVec3::Z * 3.0);
    let ray = Line { origin: one.line.origin - DVec3::X, direction: DVec3::X, ..one.line };
    assert!(none.seen(&fog(0.1, 0.5), &ray, 0.1).is_none());
}
