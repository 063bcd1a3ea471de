//! A time-of-flight camera: phases, depths beyond the range, and correction.

use std::f64::consts::{PI, TAU};

use glam::{DVec2, UVec2, Vec3};

use super::tests::{settings, view};
use super::*;
use crate::integrator::{Pixels, ReferenceScene, Settings, View, Watch};
use crate::light::{Light, Sky};
use crate::scene::testing::MeshBuilder;
use crate::scene::{CameraPose, RayScene, SceneGeometry, SceneMaterial};

#[test]
fn phases_give_depth_and_more_paths_more_of_it() {
    let frequency = 20e6;
    for metres in [0.0, 0.01, 1.0, 3.9, 7.4] {
        let found = depth(phases(phasor(0.3, 2.0 * metres, frequency), 0.7), frequency).unwrap();
        assert!((found - metres).abs() < 1e-9, "{found} is not {metres}");
        let wrapped = phasor(0.3, 2.0 * (metres + range(frequency)), frequency);
        let found = depth(phases(wrapped, 0.0), frequency).unwrap();
        assert!((found - metres).abs() < 1e-9, "{found} wraps to {metres}");
    }
    for (amplitude, expected) in [(0.3, 2.3048), (0.5, 2.4663)] {
        let both = phasor(1.0, 4.0, frequency) + phasor(amplitude, 7.0, frequency);
        assert!((depth(phases(both, 0.1), frequency).unwrap() - expected).abs() < 1e-4);
    }
    // Each value is a sum over paths.
    let paths: [(f64, f64); 3] = [(1.0, 4.0), (0.3, 5.5), (0.2, 9.0)];
    let sum: DVec2 = paths.iter().map(|(own, metres)| phasor(*own, *metres, frequency)).sum();
    for (k, found) in phases(sum, 0.2).into_iter().enumerate() {
        let turn = |metres: f64| metres * frequency / SPEED_OF_LIGHT + k as f64 / 4.0;
        let expected: f64 =
            paths.iter().map(|(own, metres)| own * (TAU * turn(*metres)).cos()).sum();
        assert!((found - 0.2 - expected).abs() < 1e-12, "{k}: {found}");
    }
    assert_eq!(depth([1.0; 4], frequency), None);
    assert_eq!(depth([f64::NAN; 4], frequency), None);
    assert_eq!(depth([1.0, 0.0, 0.0, 0.0], 0.0), None);
    assert_eq!(depth([1.0, 0.0, 0.0, -0.0], frequency), Some(0.0));
}

/// Two white walls that meet in an edge 2 m before the eye, all of them in view, and a point light of
/// 1 candela at the eye.
fn edge() -> (ReferenceScene, View) {
    let mut walls = MeshBuilder::new();
    let corner = |x: f32, y: f32| Vec3::new(x, y, x.abs() - 2.0);
    walls.quad([corner(-0.8, -0.5), corner(0.0, -0.5), corner(0.0, 0.5), corner(-0.8, 0.5)]);
    walls.quad([corner(0.0, -0.5), corner(0.8, -0.5), corner(0.8, 0.5), corner(0.0, 0.5)]);
    let geometry = SceneGeometry {
        meshes: vec![walls.finish(0)],
        materials: vec![SceneMaterial { reflectance: 0.0, ..SceneMaterial::default() }],
        ..SceneGeometry::default()
    };
    let power = (4.0 * PI) as f32;
    let (position, range, color) = (Vec3::ZERO, 1e6, [1.0; 3]);
    let light = Light::Point { position, luminous_power: power, range, color };
    let rays = RayScene::from_geometry(&geometry);
    let scene = ReferenceScene::new(geometry.into(), rays.into(), &[light], Sky::Black).unwrap();
    let pose = CameraPose::looking_at(Vec3::ZERO, Vec3::NEG_Z);
    (scene, View { pose, size: UVec2::new(32, 24), ..view(1.0) })
}

/// Median and greatest error of depths, metres.
fn errors(capture: &Capture, phasors: &[DVec2]) -> (f64, f64) {
    let depths = capture.depths(phasors).into_iter().zip(capture.distances());
    let mut errors: Vec<f64> = depths.filter_map(|(a, b)| Some((a? - (*b)?).abs())).collect();
    errors.sort_by(f64::total_cmp);
    (errors[errors.len() / 2], errors[errors.len() - 1])
}

#[test]
fn a_light_at_the_eye_shows_true_depth_and_light_of_two_bounces_can_be_taken_off() {
    let (scene, view) = edge();
    let pixels = Pixels::Middle;
    let settings = Settings { pixels, samples: 512, bounces: Some(1), ..settings() };
    let capture = capture(&scene, &view, &settings, 20e6, Watch::default()).unwrap();
    let error = |phasors: &[DVec2]| errors(&capture, phasors);
    assert!(error(capture.direct()).1 < 1e-5, "{:?}", error(capture.direct()));
    // More bounces are longer ways: no depth is too near.
    let [all, direct] = [capture.all(), capture.direct()].map(|own| capture.depths(own));
    assert!(all.iter().zip(&direct).all(|(all, direct)| *all >= direct.map(|own| own - 1e-9)));
    let raw = error(capture.all()).0;
    assert!(raw > 0.02, "white walls disturb each other: {raw}");
    let corrected = error(&without_bounce(&capture, 1.0, 3).unwrap()).0;
    assert!(corrected < 0.4 * raw, "{corrected} of {raw}");
}

#[test]
fn high_frequencies_bring_less_error_when_low_ones_unwrap_them() {
    let (scene, view) = edge();
    let pixels = Pixels::Middle;
    let settings = Settings { pixels, samples: 256, bounces: None, ..settings() };
    let mut coarse = None;
    // Median errors: as measured, and corrected.
    let medians = [20e6, 60e6, 100e6].map(|frequency| {
        let mut one = capture(&scene, &view, &settings, frequency, Watch::default()).unwrap();
        if let Some(coarse) = coarse.take() {
            one = one.unwrapped(coarse).unwrap();
        }
        let corrected = without_bounce(&one, 1.0, 3).unwrap();
        coarse = Some(one.depths(one.all()));
        [one.all(), &corrected].map(|phasors| errors(&one, phasors).0)
    });
    let [low, _, high] = medians;
    assert!(high[0] < 0.4 * low[0] && high[1] < 0.4 * low[1], "{medians:?}");
    assert!(high[1] < 0.4 * high[0], "{medians:?}");
}

#[test]
fn phases_are_unwrapped_by_coarse_depths() {
    let view = View { size: UVec2::new(8, 1), ..edge().1 };
    let exact: Vec<f64> = (0..8).map(|i| 0.1 + 0.9 * f64::from(i)).collect();
    let phasors: Vec<DVec2> = exact.iter().map(|own| phasor(2.0, 2.0 * own, 100e6)).collect();
    let capture =
        || Capture::new(&view, 100e6, [phasors.clone(), phasors.clone()], vec![None; 8]).unwrap();
    let depths = |coarse: Vec<Option<f64>>| capture().unwrapped(coarse).unwrap().depths(&phasors);
    for error in [-0.74, 0.0, 0.74] {
        let coarse = exact.iter().map(|own| Some(own + error)).collect();
        for (own, exact) in depths(coarse).iter().zip(&exact) {
            assert!((own.unwrap() - exact).abs() < 1e-9, "{own:?} is not {exact}");
        }
    }
    // Half a range and more is a range off, and no depth is below 0.
    let off = depths(exact.iter().map(|own| Some(own + 0.76)).collect());
    assert!((off[3].unwrap() - exact[3] - range(100e6)).abs() < 1e-9, "{off:?}");
    assert!(depths(vec![Some(-9.0); 8]).iter().all(|own| own.is_some_and(|own| own >= 0.0)));
    let wrapped = capture().depths(&phasors);
    for unknown in [None, Some(f64::NAN), Some(f64::INFINITY)] {
        assert_eq!(depths(vec![unknown; 8]), wrapped);
    }
    assert_eq!(capture().unwrapped(vec![None; 7]), Err(TimeError::Pixels));
}

#[test]
fn captures_of_other_renderers_are_of_their_view() {
    let view = edge().1;
    let count = view.size.element_product() as usize;
    let of = |frequency, count: usize| {
        let phasors = vec![phasor(2.0, 3.0, 20e6); count];
        Capture::new(&view, frequency, [phasors.clone(), phasors], vec![Some(1.5); count])
    };
    let capture = of(20e6, count).unwrap();
    let depths = capture.depths(capture.all());
    assert!(depths.iter().flatten().all(|depth| (depth - 1.5).abs() < 1e-9), "{:?}", depths[0]);
    assert_eq!(of(20e6, count - 1), Err(TimeError::Pixels));
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert_eq!(of(bad, count), Err(TimeError::NotPositive));
    }
}

#[test]
fn light_of_two_bounces_is_taken_off_images_of_any_size() {
    let (scene, wide) = edge();
    for size in [[0, 0], [0, 3], [1, 1], [5, 1], [1, 5], [2, 2], [3, 7]] {
        let view = View { size: UVec2::from(size), ..wide };
        let captured = capture(&scene, &view, &settings(), 20e6, Watch::default()).unwrap();
        let found = without_bounce(&captured, 1.0, 2).unwrap();
        assert!(found.iter().all(|phasor| phasor.is_finite()));
        // A row has no normals.
        assert!(found == captured.all() || size[0].min(size[1]) > 1, "{size:?}");
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert_eq!(without_bounce(&captured, bad, 2), Err(TimeError::NotPositive));
        }
    }
}
