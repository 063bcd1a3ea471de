//! Histograms against their densities, their photons and the truth.

use glam::{DVec3, Vec3};

use super::super::tests::{assert_chi_square, lambertian, patches, photons};
use super::super::{Aims, Field};
use super::*;
use crate::guide::around;

fn learned(photons: &[Photon]) -> Option<Histogram> {
    Histogram::learn(&photons.iter().collect::<Vec<_>>())
}

#[test]
fn bins_have_equal_areas_and_hold_their_directions() {
    for i in 0..COLUMNS * ROWS {
        for (u, v) in [(0.01, 0.99), (0.5, 0.5), (0.99, 0.01)] {
            let direction = within(i, u, v);
            assert!((direction.length() - 1.0).abs() < 1e-12);
            assert_eq!(bin(direction), i);
        }
    }
    let mut counts = vec![0.0_f64; COLUMNS * ROWS];
    let count = 1 << 18;
    for i in 0..count {
        let [u, v] = crate::sampler::Sampler::new(3, i, 0).pair();
        counts[bin(around(DVec3::Y, 1.0 - 2.0 * u, v))] += 1.0;
    }
    let expected = count as f64 / counts.len() as f64;
    let statistic: f64 = counts.iter().map(|count| (count - expected).powi(2) / expected).sum();
    let freedom = (counts.len() - 1) as f64;
    assert!((statistic - freedom) / (2.0 * freedom).sqrt() < 4.0, "{statistic}");
}

#[test]
fn sampled_directions_follow_their_density() {
    let learned = learned(&patches()).expect("light from patches");
    assert!((0.25..=0.81).contains(&learned.share()), "{}", learned.share());
    assert_chi_square(&Aims::Histogram(&learned), (DVec3::new(1.0, 2.0, 0.0), 1));
    for patch in [DVec3::new(1.0, 2.0, 0.0), DVec3::new(-20.0, 9.0, 4.0)] {
        assert!(learned.density(patch.normalize()) > 0.5, "towards {patch}");
    }
}

#[test]
fn even_light_needs_no_histogram() {
    let share = learned(&lambertian(20_000)).map_or(0.0, |learned| learned.share());
    assert!(share < 0.15, "{share}");
}

#[test]
fn cubes_tell_places_and_orientations_apart() {
    let mut all = Vec::new();
    let places =
        [(Vec3::ZERO, Vec3::new(0.4, 1.0, 0.5)), (Vec3::X * 10.0, Vec3::new(9.7, 1.0, 0.8))];
    for (place, source) in places {
        all.extend(photons(3000, place, |_| source, |_| 1.0));
    }
    let field = Field::histograms(&mut all);
    for (place, source) in places {
        let aims = field.aims(place.as_dvec3(), DVec3::Y).expect("light");
        assert!(aims.density((source - place).as_dvec3().normalize()) > 0.5, "at {place}");
        assert!(field.aims(place.as_dvec3(), DVec3::NEG_Y).is_none(), "no light on the back");
    }
    assert!(field.aims(DVec3::splat(1e20), DVec3::Y).is_none());
    assert!(field.aims(DVec3::NAN, DVec3::NAN).is_none_or(|aims| aims.share() < 1.0));
}

#[test]
fn extreme_photons_are_tolerated() {
    let here = |mut photons: Vec<Photon>| {
        let field = Field::histograms(&mut photons);
        let aims = field.aims(photons.first()?.position.as_dvec3(), DVec3::Y)?;
        assert!((0.0..1.0).contains(&aims.share()), "{}", aims.share());
        for i in 0..64 {
            let mut sampler = crate::sampler::Sampler::new(1, i, 0);
            let direction = aims.sample(sampler.number() * aims.share(), sampler.pair());
            let density = aims.density(direction);
            assert!(direction.is_finite() && density.is_finite() && density >= 0.0, "{density}");
        }
        Some(aims.share())
    };
    assert_eq!(here(Vec::new()), None);
    let point = |power: f32| photons(500, Vec3::ZERO, |_| Vec3::Y, |_| power);
    assert_eq!(here(point(1.0)[..7].to_vec()), None, "few photons prove nothing");
    for power in [1e-30, 1e-20, 1.0, 1e20, f32::MAX] {
        here(point(power));
        assert!(learned(&point(power)).expect("a point").share() > 0.2, "{power}");
    }
    let outshone = |i| if i == 7 { 1e30 } else { 1e-6 };
    here(photons(500, Vec3::ZERO, |_| Vec3::Y, outshone));
    for source in [Vec3::ZERO, Vec3::MAX, Vec3::NAN, Vec3::INFINITY] {
        here(photons(500, Vec3::ZERO, |_| source, |_| 1.0));
    }
    for place in [Vec3::splat(1e20), Vec3::splat(f32::MAX), Vec3::splat(1e-20), Vec3::NAN] {
        here(photons(500, place, |_| Vec3::Y, |_| 1.0));
    }
}
