//! Samplers against their densities, and transmittance against its closed form.

use std::f64::consts::{PI, TAU};

use glam::{DVec3, Vec3};

use super::*;
use crate::sampler::Sampler;
use crate::scene::Bounds;
use crate::testing::{Fit, fit_directions};

fn fog(absorption: f32, scattering: f32) -> Fog {
    Fog {
        absorption: [absorption; 3],
        scattering: [scattering; 3],
        asymmetry: 0.0,
        bounds: Bounds { min: Vec3::splat(-1.0), max: Vec3::splat(1.0) },
    }
}

#[test]
fn the_phase_function_is_normalised_and_its_mean_cosine_is_the_asymmetry() {
    for asymmetry in [-0.9, -0.3, 0.0, 5e-5, 0.5, 0.95] {
        let steps = 200_000;
        let (mut sum, mut mean) = (0.0, 0.0);
        for step in 0..steps {
            let cosine = (f64::from(step) + 0.5) / f64::from(steps) * 2.0 - 1.0;
            let share = density(asymmetry, cosine) * TAU * 2.0 / f64::from(steps);
            sum += share;
            mean += share * cosine;
        }
        assert!((sum - 1.0).abs() < 1e-5, "{asymmetry}: {sum}");
        assert!((mean - asymmetry).abs() < 1e-4, "{asymmetry}: {mean}");
    }
    assert!((density(0.0, 0.3) - 1.0 / (4.0 * PI)).abs() < 1e-15);
}

#[test]
fn sampled_directions_have_the_density_of_the_phase_function() {
    let axis = DVec3::new(0.6, -0.48, 0.64);
    for (asymmetry, focus) in
        [(-0.99, 6), (-0.6, 2), (0.0, 1), (5e-5, 1), (2e-4, 1), (0.7, 2), (0.95, 4), (0.99, 6)]
    {
        let fit = fit_directions(
            (axis * 1.0_f64.copysign(asymmetry), focus),
            |sampler| Some(sample(asymmetry, axis, sampler.pair())),
            |direction| density(asymmetry, direction.dot(axis)),
        );
        fit.assert(&format!("asymmetry {asymmetry}"));
    }
}

#[test]
fn sampled_distances_have_their_densities() {
    let fog = Fog { scattering: [0.3, 0.9, 2.0], ..fog(0.1, 0.0) };
    let line = fog.line(DVec3::new(0.2, -3.0, 0.1), DVec3::Y, 10.0).unwrap();
    assert!((line.near - 2.0).abs() < 1e-12 && (line.far - 4.0).abs() < 1e-12);
    let point = Equiangular::new(&line, Some(DVec3::new(0.5, -0.4, 0.3)));
    let outside = Equiangular::new(&line, Some(DVec3::new(0.2, 5.0, 0.3)));
    let far = Equiangular::new(&line, Some(DVec3::splat(1e14)));
    assert!(matches!(far, Equiangular::Uniform { .. }));
    let (cells, count) = (40, 1 << 16);
    let check =
        |name: &str, sample: &dyn Fn(&mut Sampler) -> Option<f64>, density: &dyn Fn(f64) -> f64| {
            let mut observed = vec![0.0; cells + 1];
            for i in 0..count {
                let distance = sample(&mut Sampler::new(5, i, 0));
                let cell = distance.map_or(cells, |distance| {
                    (((distance - 2.0) / 2.0 * cells as f64) as usize).min(cells - 1)
                });
                observed[cell] += 1.0;
            }
            let mut expected: Vec<f64> = (0..cells)
                .map(|cell| {
                    let at = |step: i32| {
                        2.0 + 2.0 * (cell as f64 + (f64::from(step) + 0.5) / 64.0) / cells as f64
                    };
                    (0..64).map(|step| density(at(step))).sum::<f64>() * 2.0 / 64.0 / cells as f64
                })
                .collect();
            expected.push(1.0 - expected.iter().sum::<f64>());
            expected.iter_mut().for_each(|expected| *expected *= count as f64);
            Fit::new(&observed, &expected).assert(name);
            expected[cells] / count as f64
        };
    for channels in [line.channels, DVec3::new(0.1, 0.7, 0.2), DVec3::Z] {
        let line = Line { channels, ..line };
        let sample = |sampler: &mut Sampler| line.sample(sampler.pair());
        let through = check("by transmittance", &|sampler| sample(sampler).distance, &|distance| {
            line.density(distance)
        });
        let exact = channels.dot((-2.0 * fog.extinction()).exp());
        assert!((through - exact).abs() < 1e-4, "{through}");
    }
    for distances in [point, outside, far] {
        let through =
            check("by angle", &|sampler| Some(distances.sample(sampler.number())), &|distance| {
                distances.density(distance)
            });
        assert!(through.abs() < 1e-4, "{distances:?}: {through}");
    }
}

#[test]
fn fog_dims_by_beer_and_lambert_within_its_box_only() {
    let fog = fog(0.25, 0.5);
    let at = |origin: DVec3, direction: DVec3, reach: f64| -> f64 {
        fog.transmittance(origin, direction, reach).x
    };
    for (expected, found) in [
        (1.5, at(DVec3::X * -5.0, DVec3::X, f64::INFINITY)),
        (0.75, at(DVec3::ZERO, DVec3::Z, 7.0)),
        (0.375, at(DVec3::ZERO, DVec3::NEG_Y, 0.5)),
        (0.0, at(DVec3::X * -5.0, DVec3::X, 3.0)),
        (0.0, at(DVec3::X * -5.0, DVec3::NEG_X, f64::INFINITY)),
        (0.0, at(DVec3::new(0.0, 2.0, -9.0), DVec3::Z, f64::INFINITY)),
        // Along an edge of the box.
        (1.5, at(DVec3::new(1.0, 1.0, -2.0), DVec3::Z, f64::INFINITY)),
    ] {
        assert!((found - f64::exp(-expected)).abs() < 1e-12, "{found}, not exp(-{expected})");
    }
}

#[test]
fn bad_fog_is_refused() {
    let good = fog(0.1, 0.2);
    assert_eq!(good.validate(), Ok(()));
    let bad = |change: &dyn Fn(&mut Fog)| {
        let mut fog = good;
        change(&mut fog);
        fog.validate().is_err()
    };
    assert!(bad(&|fog| fog.absorption[1] = -0.1));
    assert!(bad(&|fog| fog.scattering[2] = f32::NAN));
    assert!(bad(&|fog| fog.scattering[0] = f32::INFINITY));
    assert!(bad(&|fog| fog.asymmetry = 1.0));
    assert!(bad(&|fog| fog.asymmetry = f32::NAN));
    assert!(bad(&|fog| fog.bounds.max.x = -2.0));
    assert!(bad(&|fog| fog.bounds.min.y = f32::NEG_INFINITY));
    assert!(fog(0.0, 0.0).is_empty() && !good.is_empty());
    // A light on the ray, and a box without volume.
    let line = good.line(DVec3::ZERO, DVec3::X, 1.0).unwrap();
    let on = Equiangular::new(&line, Some(DVec3::X * 0.5));
    assert!([0.0, 0.5, 0.999].into_iter().all(|number| {
        let distance = on.sample(number);
        distance.is_finite() && on.density(distance).is_finite()
    }));
    let flat = Fog { bounds: Bounds { min: Vec3::ZERO, max: Vec3::ZERO }, ..good };
    assert!(flat.line(DVec3::NEG_X, DVec3::X, f64::INFINITY).is_none());
}
