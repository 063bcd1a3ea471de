//! Samplers against their densities, and what is learned against what was there.

use glam::{DVec3, Vec3};

use super::sources::Sources;
use super::*;
use crate::sampler::Sampler;
use crate::testing::fit_edges;

/// Photons that arrive around `place`, on a surface that faces up, from `source`.
pub(super) fn photons(
    count: u32,
    place: Vec3,
    source: impl Fn([f64; 2]) -> Vec3,
    power: impl Fn(u32) -> f32,
) -> Vec<Photon> {
    let photon = |i| {
        let mut sampler = Sampler::new(7, 0, i);
        let [x, z] = sampler.pair().map(|number| number as f32 - 0.5);
        Photon {
            position: place + Vec3::new(x, 0.0, z) * 0.1,
            normal: Vec3::Y,
            source: source(sampler.pair()),
            power: power(i),
        }
    };
    (0..count).map(photon).collect()
}

fn around_point([u, v]: [f64; 2], middle: Vec3, half: f32) -> Vec3 {
    middle + Vec3::new(u as f32 - 0.5, 0.0, v as f32 - 0.5) * (2.0 * half)
}

/// Two bright patches, near and far, in an evenly lit hemisphere.
pub(super) fn patches() -> Vec<Photon> {
    let mut all = photons(
        2000,
        Vec3::ZERO,
        |pair| around_point(pair, Vec3::new(1.0, 2.0, 0.0), 0.1),
        |_| 3.0,
    );
    all.extend(photons(
        2000,
        Vec3::ZERO,
        |pair| around_point(pair, Vec3::new(-20.0, 9.0, 4.0), 0.5),
        |_| 1.0,
    ));
    all.extend(lambertian(4000));
    all
}

/// Light as even as BSDF sampling expects it: from everywhere, by the cosine.
pub(super) fn lambertian(count: u32) -> Vec<Photon> {
    let far = |[u, v]: [f64; 2]| (around(DVec3::Y, u.sqrt(), v) * 50.0).as_vec3();
    photons(count, Vec3::ZERO, far, |_| 1.0)
}

fn field(mut photons: Vec<Photon>) -> Tree {
    Tree::learn(&mut photons)
}

/// Chi-square of sampled directions, and of the share that they take, against the density; cells
/// are the finer near `axis` the greater `focus` is.
#[track_caller]
pub(super) fn assert_chi_square(aims: &Aims, (axis, focus): (DVec3, i32)) {
    let sample = |sampler: &mut Sampler| {
        let choice = sampler.number();
        (choice < aims.share()).then(|| aims.sample(choice, sampler.pair()))
    };
    let fit = fit_edges((axis.normalize(), focus), 240, sample, |to| aims.density(to));
    fit.assert(&format!("{:.2} of paths", aims.share()));
}

#[test]
fn sampled_directions_follow_their_density() {
    let field = field(patches());
    let sources = field.at(DVec3::ZERO, DVec3::Y).expect("light from patches");
    // From where it was learned, from beside it, and from near a patch: wider cones.
    for position in [DVec3::ZERO, DVec3::new(0.4, 0.0, 0.3), DVec3::new(0.9, 1.6, 0.0)] {
        let cones = Aims::Cones(sources.seen_from(position));
        for patch in [DVec3::new(1.0, 2.0, 0.0), DVec3::new(-20.0, 9.0, 4.0)] {
            assert_chi_square(&cones, (patch - position, 3));
        }
    }
}

#[test]
fn patches_are_aimed_at_and_even_light_is_not() {
    let learned = field(patches());
    let cones = learned.at(DVec3::ZERO, DVec3::Y).expect("light").seen_from(DVec3::ZERO);
    // 8000 of 12000 units of power come from the patches; what chance may have made gets little.
    assert!((0.25..=0.81).contains(&cones.share()), "{}", cones.share());
    let towards = [DVec3::new(1.0, 2.0, 0.0), DVec3::new(-20.0, 9.0, 4.0)].map(DVec3::normalize);
    let aims = (0..4096).filter(|i| {
        let mut sampler = Sampler::new(13, *i, 0);
        let direction = cones.sample(sampler.number() * cones.share(), sampler.pair());
        towards.iter().any(|patch| patch.dot(direction) > 0.98)
    });
    let aimed = aims.count();
    assert!(aimed > 4096 * 3 / 4, "{aimed} of 4096 aim at the patches");
    for (patch, least) in [(DVec3::new(1.0, 2.0, 0.0), 10.0), (DVec3::new(-20.0, 9.0, 4.0), 10.0)] {
        let density = cones.density(patch.normalize());
        assert!(density > least, "{density} per steradian towards {patch}");
    }
    assert_eq!(cones.density(DVec3::new(0.0, 1.0, -1.0).normalize()), 0.0);
    // From elsewhere, the near patch is where it is, not in the direction learned.
    let aside = DVec3::new(0.5, 0.0, 0.0);
    let cones = learned.at(DVec3::ZERO, DVec3::Y).expect("light").seen_from(aside);
    assert!(cones.density((DVec3::new(1.0, 2.0, 0.0) - aside).normalize()) > 10.0);
    let even = field(lambertian(20_000));
    let share = even.at(DVec3::ZERO, DVec3::Y).map_or(0.0, |it| it.seen_from(DVec3::ZERO).share());
    assert!(share < 0.1, "{share} of the samples aim at even light");
}

#[test]
fn a_few_photons_aim_at_what_many_show() {
    // Far more light arrives from one small disc than its size has even light send; a place whose
    // own photons come from elsewhere aims at all of it, too.
    let small = |[u, v]: [f64; 2]| {
        (around(DVec3::Y, 0.0, v) * (0.04 * u.sqrt())).as_vec3() + Vec3::new(0.7, 2.5, -0.3)
    };
    let mut many = photons(3000, Vec3::ZERO, small, |_| 1.0);
    many.extend(lambertian(5000));
    let striking = Sources::striking(&mut many);
    let learned = Sources::learn(&mut lambertian(100), striking.as_ref()).expect("the disc");
    let cones = Aims::Cones(learned.seen_from(DVec3::new(0.3, 0.0, 0.2)));
    assert_chi_square(&cones, (DVec3::new(0.4, 2.5, -0.5), 3));
    for i in 0..256 {
        let point = small(Sampler::new(5, i, 0).pair()).as_dvec3();
        let density = cones.density((point - DVec3::new(0.3, 0.0, 0.2)).normalize());
        assert!(density > 10.0, "{density} per steradian towards {point}");
    }
}

#[test]
fn places_are_told_apart() {
    let mut all = Vec::new();
    for (place, source) in [(Vec3::ZERO, Vec3::Y), (Vec3::X * 10.0, Vec3::new(10.0, 1.0, 1.0))] {
        all.extend(photons(3000, place, |pair| around_point(pair, source, 0.01), |_| 1.0));
    }
    let field = field(all);
    for (place, towards) in [(DVec3::ZERO, DVec3::Y), (DVec3::X * 10.0, DVec3::new(0.0, 1.0, 1.0))]
    {
        let cones = field.at(place, DVec3::Y).expect("light").seen_from(place);
        assert!(cones.density(towards.normalize()) > 10.0, "at {place}");
        assert!(cones.share() < 1.0);
        assert!(field.at(place, DVec3::NEG_Y).is_none(), "no light on the back");
    }
}

#[test]
fn extreme_photons_are_tolerated() {
    let point = |power: f32| photons(500, Vec3::ZERO, |_| Vec3::Y, |_| power);
    let here = |photons| {
        let cones = field(photons).at(DVec3::ZERO, DVec3::Y)?.seen_from(DVec3::ZERO);
        assert!((0.0..1.0).contains(&cones.share()), "{}", cones.share());
        for i in 0..64 {
            let mut sampler = Sampler::new(1, i, 0);
            let direction = cones.sample(sampler.number() * cones.share(), sampler.pair());
            let density = cones.density(direction);
            assert!(direction.is_finite() && density.is_finite() && density >= 0.0, "{density}");
        }
        Some(cones.share())
    };
    assert_eq!(here(Vec::new()), None);
    assert_eq!(here(point(1.0)[..3].to_vec()), None, "three photons prove nothing");
    for power in [1e-30, 1e-20, 1.0, 1e20, f32::MAX] {
        assert!(here(point(power)).expect("all light comes from a point") > 0.2);
    }
    // One photon that outshines all others proves nothing either.
    let power = |i| if i == 7 { 1e30 } else { 1e-6 };
    assert!(Sources::learn(&mut photons(500, Vec3::ZERO, |_| Vec3::Y, power), None).is_none());
    // Light that comes from where it arrives.
    here(photons(500, Vec3::ZERO, |_| Vec3::ZERO, |_| 1.0));
    here(photons(500, Vec3::ZERO, |[u, v]| Vec3::new(u as f32, 0.0, v as f32) * 0.1, |_| 1.0));
    here(photons(500, Vec3::ZERO, |_| Vec3::MAX, |_| 1.0));
    here(photons(500, Vec3::ZERO, |_| Vec3::NAN, |_| 1.0));
    here(photons(
        500,
        Vec3::ZERO,
        |[u, _]| Vec3::splat(if u < 0.5 { f32::NAN } else { 1.0 }),
        |_| 1.0,
    ));
    // Seen from inside its sphere.
    let learned = field(point(1.0));
    let inside = learned.at(DVec3::ZERO, DVec3::Y).expect("light").seen_from(DVec3::Y);
    assert_eq!((inside.share(), inside.density(DVec3::X)), (0.0, 0.0));
}
