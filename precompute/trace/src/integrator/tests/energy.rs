//! Furnace tests: energy is conserved.

use super::*;
use crate::color::color;
use crate::scene::SkyMap;

const RADIUS: f64 = 2.0;

/// The inside of a white sphere with a point light at its centre, and the relative change of
/// squared distances by its facets.
fn furnace(albedo: f32, power: f32) -> (ReferenceScene, f64) {
    let sphere = geometry(diffuse(), |builder| {
        builder.tint([albedo; 3]).icosphere(Vec3::ZERO, RADIUS as f32, 5, true);
    });
    let nearest = sphere.triangles().map(|triangle| {
        let [a, b, c] = triangle.corners.map(|corner| corner.as_dvec3());
        (b - a).cross(c - a).normalize().dot(a).abs()
    });
    let nearest = nearest.min_by(f64::total_cmp).expect("triangles");
    (scene(sphere, &[point_light(Vec3::ZERO, power)], Sky::Black), (RADIUS / nearest).powi(2) - 1.0)
}

/// Rays in all directions from a point off the centre.
fn around([u1, u2]: [f64; 2]) -> (DVec3, DVec3) {
    let (y, angle) = (1.0 - 2.0 * u1, std::f64::consts::TAU * u2);
    let radius = (1.0 - y * y).sqrt();
    (DVec3::new(0.3, -0.2, 0.5), DVec3::new(radius * angle.cos(), y, radius * angle.sin()))
}

#[test]
fn a_furnace_has_its_closed_form_at_every_bounce() {
    let (albedo, power) = (0.6, 20_000.0);
    let (scene, facets) = furnace(albedo, power);
    let albedo = f64::from(albedo);
    let candela = f64::from(power) / (4.0 * std::f64::consts::PI);
    let direct = albedo / std::f64::consts::PI * candela / (RADIUS * RADIUS);
    assert!(facets < 2e-3);
    // Interpolated normals deviate from the facets by at most 1.2°, which loses (1 − cos 1.2°)/2
    // per bounce.
    let bias = facets + 1e-3;
    for bounces in [Some(0), Some(1), Some(2), Some(5), None] {
        // ρ + ρ² + … of the direct light.
        let series = match bounces {
            Some(count) => (1..=count).map(|bounce| albedo.powi(bounce as i32)).sum(),
            None => albedo / (1.0 - albedo),
        };
        let (first, rest) = measure(&scene, &lambertian(bounces), 2000, around);
        first.assert(direct, bias);
        rest.assert(direct * series, bias);
        assert!(rest.error <= 0.03 * direct, "{bounces:?}: {rest:?}");
    }
}

#[test]
fn a_convex_solid_in_a_white_furnace_reflects_its_albedo() {
    let cube = || {
        geometry(diffuse(), |builder| {
            builder.tint([0.8, 0.5, 0.25]).cuboid(Vec3::splat(-1.0), Vec3::ONE);
        })
    };
    let (albedo, light) = (color([0.8, 0.5, 0.25]), DVec3::new(100.0, 200.0, 300.0));
    let at_the_cube = |[u1, u2]: [f64; 2]| {
        (DVec3::new(3.0, 2.0, 4.0), DVec3::new(u1 - 3.5, u2 - 2.5, -4.0 + u2 - u1))
    };
    for bounces in [Some(0), Some(3), None] {
        let constant = scene(cube(), &[], Sky::Constant(light));
        for one in estimates(&constant, &lambertian(bounces), 500, at_the_cube) {
            // Every path has the exact result, or misses the cube and sees the sky.
            let reflected = (one.direct / (albedo * light) - 1.0).abs().max_element() < 1e-6;
            assert!((reflected || one.direct == light) && one.indirect == DVec3::ZERO, "{one:?}");
        }
    }
    // The same light as a sky map, whose directions are sampled.
    let map = SkyMap::new(8, 4, vec![[1.0; 3]; 32]).expect("a sky");
    let mapped = scene(cube(), &[], Sky::map(map, 100.0));
    for strategy in [Strategy::Combined, Strategy::Lights, Strategy::Scattering] {
        let settings = Settings { strategy, ..lambertian(None) };
        let (direct, indirect) = measure(&mapped, &settings, 4000, |[u1, u2]| {
            (DVec3::new(3.0, 2.0, 4.0), DVec3::new(u1 - 3.5, u2 - 2.5, -4.0))
        });
        direct.assert(80.0, 0.0);
        assert_eq!(indirect.mean, 0.0);
    }
}

#[test]
fn smooth_normals_on_facets_lose_little_and_gain_nothing() {
    let ball = geometry(diffuse(), |builder| builder.icosphere(Vec3::ZERO, 1.0, 3, false));
    let scene = scene(ball, &[], Sky::Constant(DVec3::splat(100.0)));
    let (direct, indirect) = measure(&scene, &lambertian(None), 4000, |[u1, u2]| {
        (DVec3::new(0.0, 0.0, 5.0), DVec3::new(u1 - 0.5, u2 - 0.5, -5.0))
    });
    assert!(
        direct.mean <= 100.0 && direct.mean > 99.5 && indirect.mean == 0.0,
        "{direct:?} {indirect:?}"
    );
}

#[test]
fn bevys_material_reflects_the_sun_by_its_own_formula() {
    // View and sun at normal incidence: half vector, light and view are the normal.
    let material = SceneMaterial {
        perceptual_roughness: 0.5,
        reflectance: 0.8,
        base_color: [0.5, 0.5, 0.5, 1.0],
        ..SceneMaterial::default()
    };
    let floor = geometry(material, |builder| square(builder, 5.0, 0.0, true));
    let scene = scene(floor, &[sun(Vec3::NEG_Y, 1000.0)], Sky::Black);
    let (direct, _) = measure(
        &scene,
        &Settings { bounces: Some(0), ..Settings::default() },
        2,
        down(0.3, 2.0, 0.1),
    );
    // D = 1/πα², V = 1/4, F = F0; Burley is 1 at normal incidence.
    let alpha: f64 = 0.25;
    let specular = 0.16 * 0.64 / (4.0 * std::f64::consts::PI * alpha * alpha);
    direct.assert(1000.0 * (0.5 / std::f64::consts::PI + specular), 1e-6);
}
