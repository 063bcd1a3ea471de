//! The map and the estimates.

use std::f64::consts::PI;

use glam::Quat;

use super::super::gather::Point;
use super::super::map::{Photon, PhotonMap};
use super::*;
use crate::sampler::Sampler;

/// Photons spread evenly over a square of side 2, from above and some from below.
fn spread(count: u32, seed: u64) -> Vec<Photon> {
    let photon = |i| {
        // Sample 0 of a pixel of its own: not stratified.
        let mut sampler = Sampler::new(seed, u64::from(i), 0);
        let [x, z] = sampler.pair().map(|number| 2.0 * number as f32 - 1.0);
        let [a, b] = sampler.pair();
        let direction = unit(a - 0.5, 0.3, b - 0.5) * if i % 8 == 7 { -1.0 } else { 1.0 };
        let power = Vec3::splat(1.0 + sampler.number() as f32);
        Photon { position: at(Vec2::new(x, z)), direction, power, surfaces: 1, length: 0.0 }
    };
    (0..count).map(photon).collect()
}

/// Squared distances to photons above, the nearest first.
fn brute(photons: &[Photon], place: Vec3, normal: Vec3) -> Vec<(f32, Photon)> {
    let above = photons.iter().filter(|photon| photon.direction.dot(normal) > 0.0);
    let mut all: Vec<_> =
        above.map(|photon| (photon.position.distance_squared(place), *photon)).collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    all
}

#[test]
fn the_tree_finds_what_brute_force_finds() {
    for count in [0, 1, 7, 9, 100, 5000] {
        let mut photons = spread(count, 3);
        // Many at one place.
        photons.extend(
            photons
                .clone()
                .iter()
                .take(40)
                .map(|photon| Photon { position: Vec3::new(0.25, 0.0, 0.25), ..*photon }),
        );
        let map = PhotonMap::new(photons.clone());
        assert_eq!(map.photons.len(), photons.len());
        for i in 0..50 {
            let [x, z] = Sampler::new(4, i, 0).pair().map(|number| 3.0 * number as f32 - 1.5);
            let place = Vec3::new(x, 0.01, z);
            let all = brute(&photons, place, Vec3::Y);
            for (nearest, reach) in [(1, 9.0), (20, 9.0), (20, 0.2), (100_000, 9.0)] {
                let wanted: Vec<f32> = all
                    .iter()
                    .map(|(squared, _)| *squared)
                    .filter(|squared| *squared <= reach * reach)
                    .take(nearest)
                    .collect();
                let found = map.nearest(place, Vec3::Y, nearest, reach);
                assert!(found.iter().map(|(squared, _)| *squared).eq(wanted), "{count} {nearest}");
            }
            let mut found = 0;
            map.within(place, Vec3::Y, 0.3, |_, _| found += 1);
            let wanted = all.iter().filter(|(squared, _)| *squared <= 0.3_f32.powi(2)).count();
            assert_eq!(found, wanted);
        }
    }
    let odd = Photon { position: Vec3::NAN, ..spread(1, 0)[0] };
    assert!(PhotonMap::new(vec![odd]).photons.is_empty());
    let map = PhotonMap::new(spread(100, 0));
    assert!(map.nearest(Vec3::NAN, Vec3::Y, 5, 9.0).is_empty());
    assert!(map.nearest(Vec3::ZERO, Vec3::NAN, 5, 9.0).is_empty());
    assert!(map.nearest(Vec3::ZERO, Vec3::Y, 0, 9.0).is_empty());
}

/// Calls `test` with the point of a matte floor straight below `place`, turned by `turn`.
fn on_floor<T>(turn: Quat, test: impl FnOnce(&Point) -> T) -> T {
    let floor = scene(&[(matte(0.5), |builder| square(builder, 2.0, 0.0))], &[], Sky::Black);
    let settings = Settings { shading: crate::bsdf::Shading::Lambertian, ..Settings::default() };
    // A Lambertian floor looks the same from everywhere: the turn is of the view.
    let from = Vec3::new(0.0, 1.0, 0.0) + turn * Vec3::X;
    let ray = (from, -from.as_dvec3().normalize());
    let split = Split { scene: &floor, settings: &settings, caustics: &Caustics::default() };
    let found = split.points(ray, &mut Sampler::new(1, 0, 0));
    assert_eq!(found.len(), 1);
    test(&found[0])
}

#[test]
fn the_estimate_is_jensens_and_ignores_order_and_turns() {
    let photons = spread(3000, 5);
    let gather = |photons: Vec<Photon>, turn| {
        let map = PhotonMap::new(photons);
        on_floor(turn, |point| point.nearest(&map, 50, 9.0))
    };
    let found = gather(photons.clone(), Quat::IDENTITY);
    let near = brute(&photons, Vec3::ZERO, Vec3::Y);
    let flux: f64 = near[..49].iter().map(|(_, photon)| f64::from(photon.power.x)).sum();
    let exact = 0.5 / PI * flux / (PI * f64::from(near[49].0));
    assert!((found.radiance.x / exact - 1.0).abs() < 1e-5, "{found:?} {exact}");
    let mut shuffled = photons.clone();
    shuffled.reverse();
    shuffled.swap(10, 2000);
    let turn = Quat::from_rotation_y(1.0);
    let turned = photons.iter().map(|photon| Photon {
        position: turn * photon.position,
        direction: turn * photon.direction,
        ..*photon
    });
    for other in [gather(shuffled, Quat::IDENTITY), gather(turned.collect(), turn)] {
        assert!((other.radiance.x / found.radiance.x - 1.0).abs() < 1e-5, "{other:?}");
    }
    // Half the size: four times the density.
    let small = photons.iter().map(|photon| Photon { position: photon.position * 0.5, ..*photon });
    let small = gather(small.collect(), Quat::IDENTITY);
    assert!((small.radiance.x / found.radiance.x - 4.0).abs() < 1e-5);
}

#[test]
fn an_even_field_is_even() {
    // Photons from above: 7/8 of `count`, of the mean power 1.5, on 4 m².
    let (count, nearest) = (4000, 50);
    let exact = 0.5 / PI * 1.5 * f64::from(count) * 7.0 / 8.0 / 4.0;
    let values: Vec<f64> = (0..400)
        .map(|seed| {
            let map = PhotonMap::new(spread(count, 100 + seed));
            on_floor(Quat::IDENTITY, |point| point.nearest(&map, nearest, 9.0).radiance.x / exact)
        })
        .collect();
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let spread = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
    let spread = (spread / (values.len() - 1) as f64).sqrt();
    let theory = f64::from(nearest).sqrt().recip();
    // Counting the farthest photon, too, would give 1.02.
    assert!((mean - 1.0).abs() < 3.0 * theory / 20.0, "{mean}");
    // Powers that vary add 1 %, and 48 degrees of freedom rather than 50 add 2 %.
    assert!((0.85..1.2).contains(&(spread / theory)), "{spread} against {theory}");
}
