//! Samples of lights, photons and pixels against their densities.

use std::f64::consts::{PI, TAU};

use super::super::path::{emitter, per_steradian};
use super::super::photons::{Emission, Flight};
use super::*;
use crate::bsdf::Surface;
use crate::color::luminance;
use crate::scene::{SkyMap, TextureUse};
use crate::testing::{COUNT, Fit, fit_directions, fit_square};

const POINT: Vec3 = Vec3::new(1.0, 1.0, 0.25);
const SPOT: Vec3 = Vec3::new(-1.0, 1.25, 0.5);
const OUTER: f32 = 50.0;

/// A floor, and emitters: one that faces down, one with two sides.
fn emitters() -> SceneGeometry {
    let mut all = geometry(diffuse(), |builder| square(builder, 2.0, 0.0, true));
    all = joined(all, geometry(emissive(10.0), |builder| square(builder, 0.5, 1.5, false)));
    let double = SceneMaterial { double_sided: true, ..emissive(40.0) };
    joined(
        all,
        geometry(double, |builder| {
            builder.sheet(1, 1, |s, t| Vec3::new(s - 0.5, 0.5 + 0.5 * t, -1.5));
        }),
    )
}

/// The same with one more, with a texture and two sides.
fn textured() -> SceneGeometry {
    let mut all = emitters();
    all.textures.push(row_texture(&[[255; 4], [0, 0, 0, 255], [64; 4], [128; 4]]));
    let mut builder = MeshBuilder::new();
    builder.sheet(4, 2, |s, t| Vec3::new(1.0 + s, 0.25 + t, 1.5 - s));
    all.meshes.push(builder.finish(all.materials.len()));
    let emissive_texture = Some(TextureUse::plain(0));
    all.materials.push(SceneMaterial { emissive_texture, double_sided: true, ..emissive(20.0) });
    all
}

#[test]
fn points_on_emitters_have_the_density_that_rays_which_hit_them_are_weighed_by() {
    let scene = scene(textured(), &[], Sky::Black);
    for position in [DVec3::new(0.0, 0.5, 0.0), DVec3::new(-0.75, 0.125, -0.5)] {
        for (axis, focus) in [(DVec3::Y, 1), (DVec3::NEG_Z, 2), (DVec3::new(0.8, 0.0, 0.6), 2)] {
            let fit = fit_directions(
                (axis, focus),
                |sampler| emitter(&scene, position, sampler).map(|sample| sample.direction),
                |direction| {
                    let Some(hit) = scene.closest(position.as_vec3(), direction) else {
                        return 0.0;
                    };
                    let surface = Surface::new(&scene.geometry, &hit);
                    let ray = surface.position - position;
                    per_steradian(scene.emitters.density(&hit), ray, surface.geometric_normal)
                },
            );
            fit.assert("emitters");
        }
    }
}

fn lights() -> [Light; 3] {
    let spot = Light::Spot {
        position: SPOT,
        direction: Vec3::new(0.0, -0.8, 0.6),
        luminous_power: 300.0,
        range: 1e6,
        inner_angle: 20.0,
        outer_angle: OUTER,
        color: [1.0; 3],
    };
    [sun(Vec3::new(0.3, -1.0, 0.2), 10.0), point_light(POINT, 200.0), spot]
}

/// Which light a photon is of: sun, point, spot, emitter that faces down, one of two sides, sky.
fn kind(flight: &Flight) -> usize {
    let sun = DVec3::new(0.3, -1.0, 0.2).normalize();
    match flight.origin {
        _ if flight.pace == 0.0 => 5 * usize::from(flight.direction.distance(sun) > 1e-6),
        POINT => 1,
        SPOT => 2,
        origin => 3 + usize::from(origin.y < 1.25),
    }
}

#[test]
fn photons_have_the_density_that_their_power_says() {
    let texels = (0..32).map(|i| [(i % 7) as f32, (i % 3) as f32 * 2.0, 1.0]).collect();
    let map = Sky::map(SkyMap::new(8, 4, texels).unwrap(), 3.0);
    for sky in [map, Sky::constant([2.0, 3.0, 4.0])] {
        let scene = scene(emitters(), &lights(), sky);
        let settings = Settings::default();
        let emission = Emission::new(&scene, &settings).expect("light");
        let bounds = scene.geometry.bounds().expect("triangles");
        let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
        let (middle, radius) = (0.5 * (min + max), 0.5 * (max - min).length());
        let disc = PI * radius * radius;
        let outer = f64::from(OUTER).to_radians().cos();
        let sky_power = match &scene.sky {
            Sky::Constant(radiance) => 4.0 * PI * luminance(*radiance),
            sky => sky.power(),
        };
        // Emitters: π × nits × m².
        let powers = [
            10.0 * disc,
            200.0,
            150.0 * (1.0 - outer),
            PI * 10.0,
            PI * 40.0 * 0.5,
            sky_power * disc,
        ];
        let total: f64 = powers.iter().sum();
        let shares = powers.map(|power| power / total);
        let emit = |sampler: &mut Sampler| {
            let (choice, [a, b], [c, d]) = (sampler.number(), sampler.pair(), sampler.pair());
            emission.emit(&[choice, a, b, c, d])
        };
        let of = |wanted, sampler: &mut Sampler| emit(sampler).filter(|it| kind(it) == wanted);
        let mut observed = [0.0; 6];
        for i in 0..COUNT {
            let flight = emit(&mut Sampler::new(3, i, 0)).expect("all points shine");
            observed[kind(&flight)] += 1.0;
            let spot = scene.lights[2].incident(SPOT.as_dvec3() + flight.direction);
            // Power × density is what the light sends.
            let sent = match kind(&flight) {
                2 => spot.map_or(0.0, |it| luminance(it.illuminance)) / (300.0 / (2.0 * TAU)),
                4 => 2.0,
                5 if matches!(scene.sky, Sky::Constant(_)) => {
                    luminance(scene.sky.radiance(-flight.direction)) * 4.0 * PI / sky_power
                }
                _ => 1.0,
            };
            let found = luminance(flight.power) / total;
            assert!((found - sent).abs() < 1e-5, "{}: {found} for {sent}", kind(&flight));
        }
        Fit::new(&observed, &shares.map(|share| share * COUNT as f64)).assert("lights");

        let directions = |name, which, axis, focus, density: &dyn Fn(DVec3) -> f64| {
            let sample = |sampler: &mut Sampler| of(which, sampler).map(|it| it.direction);
            fit_directions((axis, focus), sample, |to| shares[which] * density(to)).assert(name);
        };
        directions("point", 1, DVec3::Y, 1, &|_| 0.25 / PI);
        let axis = DVec3::new(0.0, -0.8, 0.6);
        directions("spot", 2, axis, 1, &|to| {
            f64::from(u8::from(to.dot(axis) > outer)) / (TAU * (1.0 - outer))
        });
        directions("facing down", 3, DVec3::NEG_Y, 1, &|to| (-to.y).max(0.0) / PI);
        directions("of two sides", 4, DVec3::Z, 1, &|to| to.z.abs() / TAU);
        directions("sky", 5, DVec3::Y, 1, &|to| match &scene.sky {
            Sky::Constant(_) => 0.25 / PI,
            sky => sky.density(-to),
        });

        let places = |name, which, place: &dyn Fn(&Flight) -> [f64; 2]| {
            let sample = |sampler: &mut Sampler| {
                of(which, sampler).map(|it| place(&it).map(|x| x.clamp(0.0, 1.0)))
            };
            fit_square([8, 8], sample, |_| shares[which]).assert(name);
        };
        let on_disc = |flight: &Flight| {
            let (right, up) = flight.direction.any_orthonormal_pair();
            let offset = flight.origin.as_dvec3() - middle;
            let (x, y) = (offset.dot(right) / radius, offset.dot(up) / radius);
            [x * x + y * y, (y.atan2(x) / TAU).rem_euclid(1.0)]
        };
        places("sun's places", 0, &on_disc);
        places("sky's places", 5, &on_disc);
        let flat = |it: &Flight| [it.origin.x, it.origin.z].map(|x| f64::from(x) + 0.5);
        places("places that face down", 3, &flat);
        // Place and direction together.
        places("down, and where", 3, &|it| [flat(it)[0], it.direction.y.powi(2)]);
        let upright = |it: &Flight| [it.origin.x + 0.5, 2.0 * it.origin.y - 1.0].map(f64::from);
        places("places of two sides", 4, &upright);
        places("side, and where", 4, &|it| {
            let z = it.direction.z;
            [upright(it)[1], 0.5 + 0.5 * z * z.abs()]
        });
    }
}

#[test]
fn rays_are_even_over_a_pixel() {
    let view = View {
        pose: CameraPose::looking_at(Vec3::new(1.0, 2.0, 3.0), Vec3::ZERO),
        vertical_fov_degrees: 70.0,
        near: 0.1,
        size: UVec2::new(5, 3),
    };
    let sample = |sampler: &mut Sampler| {
        let (_, direction) = view.sampled_ray(Pixels::Area, [4, 1], sampler);
        let ahead = view.pose.rotation.as_dquat().inverse() * direction;
        let (x, y) = (-ahead.x / ahead.z / view.half().x, -ahead.y / ahead.z / view.half().y);
        let place = [2.5 * (1.0 + x) - 4.0, 1.5 * (1.0 - y) - 1.0];
        Some(place.map(|x| if x.abs() < 1e-6 { 0.0 } else { x }))
    };
    fit_square([16, 16], sample, |_| 1.0).assert("a pixel");
}
