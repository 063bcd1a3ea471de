//! Derivatives against differences, closed forms, and hostile input.

use glam::{DVec3, UVec2, Vec3};

use super::jet::{Jet, distance, eigen, form_factor};
use super::record::{gather, radii, record};
use super::*;
use crate::light::Sky;
use crate::media::Fog;
use crate::scene::testing::MeshBuilder;
use crate::scene::{CameraPose, RayScene, SceneGeometry, SceneMaterial};

/// A ball of radius 2 that emits inwards, with fog in it.
fn ball(nits: f32, extinction: f32) -> ReferenceScene {
    let mut builder = MeshBuilder::new();
    builder.icosphere(Vec3::ZERO, 2.0, 4, true);
    emissive(builder, nits, extinction)
}

/// Black triangles that emit, in fog.
fn emissive(builder: MeshBuilder, nits: f32, scattering: f32) -> ReferenceScene {
    let material = SceneMaterial {
        base_color: [0.0, 0.0, 0.0, 1.0],
        emissive: [nits; 3],
        double_sided: true,
        ..SceneMaterial::default()
    };
    let geometry = SceneGeometry {
        meshes: vec![builder.finish(0)],
        materials: vec![material],
        ..SceneGeometry::default()
    };
    with_fog(geometry, scattering)
}

fn with_fog(geometry: SceneGeometry, scattering: f32) -> ReferenceScene {
    let rays = RayScene::from_geometry(&geometry);
    let scene = ReferenceScene::new(geometry.into(), rays.into(), &[], Sky::Black).unwrap();
    let bounds = Bounds { min: Vec3::splat(-2.0), max: Vec3::splat(2.0) };
    let fog = Fog { absorption: [0.0; 3], scattering: [scattering; 3], asymmetry: 0.0, bounds };
    scene.with_fog(fog).unwrap()
}

fn view() -> View {
    View {
        pose: CameraPose::looking_at(Vec3::ZERO, Vec3::NEG_Z),
        vertical_fov_degrees: 60.0,
        near: 0.01,
        size: UVec2::new(4, 3),
    }
}

fn found(scene: &ReferenceScene, extinction: f64, at: DVec3, rings: u32) -> (DVec3, [Jet; 3]) {
    gather(scene, DVec3::splat(extinction), at, rings, [1, 0])
}

#[test]
fn derivatives_agree_with_differences() {
    let corners =
        [DVec3::new(1.0, 0.2, -0.3), DVec3::new(-0.4, 1.1, 0.5), DVec3::new(0.2, -0.6, 1.3)];
    let value =
        |x: DVec3| form_factor(corners.map(|y| y - x)).times(distance(corners[0] - x).decay(0.7));
    // On one side, on the other, and close to the plane.
    for x in [DVec3::new(0.1, -0.2, 0.15), DVec3::splat(2.0), DVec3::new(0.25, 0.2, 0.5)] {
        let (jet, h) = (value(x), 1e-5);
        for axis in DVec3::AXES {
            let (more, less) = (value(x + axis * h), value(x - axis * h));
            let slope = (more.value - less.value) / (2.0 * h);
            let scale = jet.gradient.length();
            assert!((slope - jet.gradient.dot(axis)).abs() < 1e-7 * scale, "{slope} {jet:?}");
            let change = (more.gradient - less.gradient) / (2.0 * h);
            let own = jet.hessian * axis;
            assert!((change - own).length() < 1e-6 * own.length().max(scale), "{change} {own}");
        }
    }
}

#[test]
fn eigenvectors_rebuild_their_matrix() {
    let columns = [[2.0, -1.0, 0.5], [-1.0, -3.0, 0.25], [0.5, 0.25, 1.0]];
    let matrix = glam::DMat3::from_cols_array_2d(&columns);
    let (values, vectors) = eigen(matrix);
    let rebuilt = vectors * glam::DMat3::from_diagonal(values) * vectors.transpose();
    assert!(rebuilt.abs_diff_eq(matrix, 1e-12), "{rebuilt}");
    assert_eq!(eigen(glam::DMat3::ZERO).0, DVec3::ZERO);
}

#[test]
fn in_a_furnace_light_is_even() {
    let (radiance, jets) = found(&ball(3.0, 0.5), 0.0, DVec3::new(0.7, -0.4, 0.9), 16);
    assert!((radiance - 3.0).length() < 1e-6, "{radiance}");
    for jet in jets {
        assert!((jet.value - 3.0).abs() < 1e-9, "closed: {}", jet.value);
        assert!(jet.gradient.length() < 1e-9 && jet.hessian.col(0).length() < 1e-9);
    }
}

#[test]
fn in_a_ball_of_fog_light_is_that_of_the_closed_form() {
    let exact = |x: f64| -> f64 {
        (0..4000).fold(0.0, |sum, i| {
            let cosine = (f64::from(i) + 0.5) / 2000.0 - 1.0;
            let reach = -x * cosine + (4.0 - x * x * (1.0 - cosine * cosine)).sqrt();
            sum + (-0.8 * reach).exp() / 4000.0
        })
    };
    let scene = ball(1.0, 0.8);
    let (x, h) = (0.9, 1e-3);
    let (radiance, [jet, ..]) = found(&scene, 0.8, DVec3::X * x, 64);
    assert!((radiance.x / exact(x) - 1.0).abs() < 5e-3, "{radiance}");
    let slope = (exact(x + h) - exact(x - h)) / (2.0 * h);
    assert!((jet.gradient.x / slope - 1.0).abs() < 0.1, "{} {slope}", jet.gradient);
    let middle = found(&scene, 0.8, DVec3::ZERO, 64).1[0];
    assert!(middle.gradient.length() < 0.02 * exact(0.0), "{}", middle.gradient);
}

#[test]
fn radii_follow_tolerance_and_shape() {
    let settings = CacheSettings { radii: [1e-9, 1e9], ..CacheSettings::default() };
    let values = DVec3::new(1.0, -4.0, 0.5);
    let own = radii(2.0, values, &settings);
    let half = CacheSettings { tolerance: settings.tolerance / 2.0, ..settings };
    assert!((radii(2.0, values, &half) / own - 0.5_f64.powf(0.2)).length() < 1e-12);
    let ball = radii(2.0, values, &CacheSettings { shape: Shape::Isotropic, ..settings });
    assert!((ball - own.min_element()).length() < 1e-12);
    assert_eq!(radii(2.0, DVec3::ZERO, &settings), DVec3::splat(1e9), "even light");
    assert_eq!(radii(0.0, DVec3::ZERO, &settings), DVec3::splat(1e-9), "full shadow");
}

/// A panel of 1.6 m, 1.9 m above the middle.
fn panel() -> ReferenceScene {
    let mut builder = MeshBuilder::new();
    let corner = |x: f32, z: f32| Vec3::new(0.8 * x, 1.9, 0.8 * z);
    builder.quad([corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)]);
    emissive(builder, 1.0, 0.1)
}

#[test]
fn light_of_a_record_has_little_noise() {
    let (scene, at) = (panel(), DVec3::new(0.4, -0.5, 0.3));
    let [a, b, c, d] = [[-0.8, -0.8], [0.8, -0.8], [0.8, 0.8], [-0.8, 0.8]]
        .map(|[x, z]| DVec3::new(x, 1.9, z) - at);
    let exact = form_factor([a, b, c]).value.abs() + form_factor([a, c, d]).value.abs();
    let squares = (0..32).map(|number| {
        let (radiance, _) = gather(&scene, DVec3::ZERO, at, 24, [1, number]);
        (radiance.x / exact - 1.0).powi(2)
    });
    let error = (squares.sum::<f64>() / 32.0).sqrt();
    assert!(error < 0.02, "{error}");
}

#[test]
fn light_that_no_triangle_sees_has_the_least_region() {
    let settings = CacheSettings { rings: 2, ..CacheSettings::default() };
    let own = record(&panel(), DVec3::ZERO, DVec3::NEG_Y * 1.5, &settings, 1);
    assert!(own.radiance.x > 0.0);
    let beyond = DVec3::X * settings.radii[0] * 1.01;
    assert_eq!(own.weight(own.position + beyond), 0.0, "{own:?}");
}

#[test]
fn hostile_input_gives_finite_light_or_none() {
    let [a, b] = [DVec3::X, DVec3::new(0.0, 1.0, 0.5)];
    for rays in [[DVec3::ZERO, a, b], [a, a, a], [a, b, -a], [a * f64::NAN, a, b]] {
        let jet = form_factor(rays);
        assert!(jet.value.is_finite() && jet.gradient.is_finite() && jet.hessian.is_finite());
    }
    let settings = CacheSettings { rings: 6, ..CacheSettings::default() };
    let make = |scene: &ReferenceScene, settings| Cache::new(scene, &view(), settings);
    let plain = ball(1.0, 0.5);
    let one = make(&plain, settings).unwrap();
    let image = one.image(&plain, &view());
    for nits in [1e-20, 1e20] {
        let scene = ball(nits, 0.5);
        let cache = make(&scene, settings).unwrap();
        assert_eq!(cache.count(), one.count());
        for (own, unit) in cache.image(&scene, &view()).rgb.iter().zip(&image.rgb) {
            assert!((own[0] / nits / unit[0] - 1.0).abs() < 1e-4, "{own:?} {unit:?}");
        }
    }
    let is_dark = |scene: &ReferenceScene| {
        let image = make(scene, settings).unwrap().image(scene, &view());
        image.rgb.iter().all(|rgb| *rgb == [0.0; 3])
    };
    assert!(is_dark(&ball(0.0, 0.5)), "no light");
    assert!(is_dark(&with_fog(SceneGeometry::default(), 0.5)), "no surface");
    let bad = |change: &dyn Fn(&mut CacheSettings)| {
        let mut settings = settings;
        change(&mut settings);
        make(&plain, settings).is_none()
    };
    assert!(bad(&|settings| settings.tolerance = f64::NAN));
    assert!(bad(&|settings| settings.step = 0.0));
    assert!(bad(&|settings| settings.rings = 1));
    assert!(bad(&|settings| settings.radii = [2.0, 1.0]));
    assert!(make(&ball(1.0, 0.0), settings).is_none(), "no fog");
}
