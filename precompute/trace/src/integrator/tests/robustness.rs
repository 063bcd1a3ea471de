//! Extremes of geometry, light and scale; and independence of the machine.

use std::sync::atomic::{AtomicU32, Ordering};

use super::*;

fn assert_finite(rendering: &Rendering) {
    for value in rendering.direct.rgb.iter().chain(&rendering.indirect.rgb).flatten() {
        assert!(value.is_finite() && *value >= 0.0, "{value}");
    }
}

fn room_with_a_block(offset: Vec3, size: f32) -> SceneGeometry {
    let material =
        SceneMaterial { perceptual_roughness: 0.3, metallic: 0.2, ..SceneMaterial::default() };
    geometry(material, |builder| {
        builder.tint([0.7; 3]).room(offset - Vec3::splat(size), offset + Vec3::splat(size));
        builder.cuboid(offset - Vec3::splat(size), offset - Vec3::new(0.2, 0.4, 0.3) * size);
    })
}

#[test]
fn the_image_depends_on_the_seed_and_not_on_threads() {
    let light = geometry(emissive(100.0), |builder| square(builder, 0.4, 0.9, false));
    let scene = scene(
        joined(room_with_a_block(Vec3::ZERO, 1.0), light),
        &[point_light(Vec3::new(0.3, 0.5, 0.2), 100.0)],
        Sky::Black,
    );
    let view = view(Vec3::new(0.8, 0.3, 0.8), Vec3::ZERO, 12, 9);
    let settings = Settings { samples: 4, ..Settings::default() };
    let with_threads = |count: usize, settings: &Settings| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(count).build().expect("threads");
        pool.install(|| picture(&scene, &view, settings))
    };
    let alone = with_threads(1, &settings);
    assert_eq!(alone, with_threads(3, &settings));
    assert_ne!(alone, with_threads(1, &Settings { seed: 1, ..settings }));
    assert!(alone.dropped == 0 && alone.indirect.mean() > 0.0);
}

#[test]
fn an_interrupted_image_is_none() {
    let scene = scene(SceneGeometry::default(), &[], Sky::Black);
    let (rows, pixels) = (AtomicU32::new(0), AtomicU32::new(0));
    let count = |counter: &AtomicU32| counter.fetch_add(1, Ordering::Relaxed);
    let small = view(Vec3::ZERO, Vec3::X, 4, 3);
    let watch = Watch {
        row_done: &|| {
            count(&rows);
        },
        interrupted: &|| count(&pixels) > 12,
    };
    assert!(render(&scene, &small, &lambertian(None), watch).is_some());
    assert_eq!((rows.load(Ordering::Relaxed), pixels.load(Ordering::Relaxed)), (3, 12));
    assert!(
        render(
            &scene,
            &small,
            &lambertian(None),
            Watch { row_done: &|| (), interrupted: &|| count(&pixels) > 13 }
        )
        .is_none()
    );
}

#[test]
fn paths_of_very_many_bounces_end() {
    /// Surfaces of a path.
    struct Surfaces(u32);
    impl path::Record for Surfaces {
        fn met(&mut self, _: f64) {
            self.0 += 1;
        }
    }
    let white = geometry(diffuse(), |builder| builder.room(Vec3::splat(-1.0), Vec3::ONE));
    let (scene, settings) = (scene(white, &[], Sky::Black), lambertian(Some(100_000)));
    for i in 0..64 {
        let (mut sampler, mut met) = (Sampler::new(0, i, 0), Surfaces(0));
        path::trace(&scene, &settings, None, Vec3::ZERO, DVec3::X, &mut sampler, &mut met);
        assert!(met.0 < 1000, "{} surfaces", met.0);
    }
}

#[test]
fn an_empty_scene_shows_its_sky() {
    let view = view(Vec3::ZERO, Vec3::X, 3, 2);
    for (sky, expected) in [(Sky::Black, 0.0), (Sky::Constant(DVec3::splat(5.0)), 5.0)] {
        let rendering = picture(
            &scene(SceneGeometry::default(), &[], sky),
            &view,
            &Settings { samples: 2, ..Settings::default() },
        );
        assert!(
            rendering.direct.rgb.iter().all(|pixel| *pixel == [expected; 3])
                && rendering.indirect.mean() == 0.0
        );
    }
    // Geometry without light is black.
    let dark = picture(
        &scene(room_with_a_block(Vec3::ZERO, 1.0), &[], Sky::Black),
        &view,
        &Settings { samples: 2, ..Settings::default() },
    );
    assert_eq!(dark.full().mean(), 0.0);
}

#[test]
fn broken_triangles_and_normals_are_tolerated() {
    let mut builder = MeshBuilder::new();
    builder.room(Vec3::splat(-1.0), Vec3::ONE);
    let valid = builder.triangle_count();
    for corners in [
        [Vec3::ZERO; 3],
        [Vec3::ZERO, Vec3::X, Vec3::X * 2.0],
        [Vec3::NAN, Vec3::X, Vec3::Y],
        [Vec3::MAX, Vec3::MIN, Vec3::Y],
    ] {
        let [a, b, c] = corners.map(|corner| builder.vertex(corner, Vec3::Z, glam::Vec2::NAN));
        builder.triangle(a, b, c);
    }
    let mut mesh = builder.finish(0);
    for (i, normal) in mesh.normals.iter_mut().enumerate() {
        *normal = [*normal, Vec3::ZERO, Vec3::NAN, -*normal, Vec3::splat(1e30)][i % 5];
    }
    let material = SceneMaterial { emissive: [3.0; 3], ..SceneMaterial::default() };
    let broken =
        SceneGeometry { meshes: vec![mesh], materials: vec![material], ..SceneGeometry::default() };
    let scene = scene(
        broken,
        &[point_light(Vec3::splat(0.5), 100.0), point_light(Vec3::splat(1.0), 100.0)],
        Sky::Black,
    );
    assert_eq!(scene.triangle_count(), valid);
    let rendering = picture(
        &scene,
        &view(Vec3::ZERO, Vec3::new(1.0, 0.2, 0.3), 8, 8),
        &Settings { samples: 8, bounces: Some(3), ..Settings::default() },
    );
    assert_finite(&rendering);
    assert!(rendering.full().mean() > 3.0 && rendering.dropped == 0);
    let mut missing = room_with_a_block(Vec3::ZERO, 1.0);
    missing.meshes[0].indices[0] = u32::MAX;
    assert!(try_scene(missing, &[], Sky::Black).is_err());
}

#[test]
fn far_away_and_very_small_the_light_is_the_same() {
    let relative = |offset: Vec3, size: f32| {
        let scene = scene(
            room_with_a_block(offset, size),
            &[point_light(offset + Vec3::Y * 0.5 * size, 100.0 * size * size)],
            Sky::Black,
        );
        let camera = View {
            near: 0.01 * size,
            ..view(offset + Vec3::new(0.75, 0.25, 0.75) * size, offset, 8, 6)
        };
        let rendering = picture(&scene, &camera, &Settings { samples: 64, ..lambertian(Some(2)) });
        assert_finite(&rendering);
        assert_eq!(rendering.dropped, 0);
        [rendering.direct.mean(), rendering.indirect.mean()]
    };
    let here = relative(Vec3::ZERO, 1.0);
    // Sizes and offsets that are exact in single precision.
    for (offset, size) in [
        (Vec3::splat(4096.0), 1.0),
        (Vec3::new(-65536.0, 0.0, 65536.0), 16.0),
        (Vec3::ZERO, 16384.0),
        (Vec3::ZERO, 1.0 / 65536.0),
    ] {
        let there = relative(offset, size);
        for (one, other) in here.iter().zip(there) {
            assert!(
                (other / one - 1.0).abs() < 5e-3,
                "at {offset} of {size} m: {there:?} for {here:?}"
            );
        }
    }
    // Single precision has steps of metres here: the image is meaningless but finite.
    for offset in [1e8, 1e12, 1e15, 1e30] {
        let scene = scene(
            room_with_a_block(Vec3::splat(offset), 1.0),
            &[point_light(Vec3::splat(offset), 100.0)],
            Sky::Constant(DVec3::ONE),
        );
        assert_finite(&picture(
            &scene,
            &view(Vec3::splat(offset), Vec3::ZERO, 4, 4),
            &Settings { samples: 4, ..Settings::default() },
        ));
    }
}

#[test]
fn enormous_light_stays_finite_and_overflows_are_counted() {
    let bright = |light: Light| {
        let scene = scene(room_with_a_block(Vec3::ZERO, 1.0), &[light], Sky::Black);
        picture(
            &scene,
            &view(Vec3::new(0.8, 0.3, 0.8), Vec3::ZERO, 6, 6),
            &Settings { samples: 8, bounces: Some(2), ..Settings::default() },
        )
    };
    let ordinary = bright(point_light(Vec3::new(0.1, 0.5, 0.0), 1.0));
    let huge = bright(point_light(Vec3::new(0.1, 0.5, 0.0), 1e20));
    assert_finite(&huge);
    assert!(
        huge.dropped == 0
            && (huge.full().mean() / ordinary.full().mean() / 1e20 - 1.0).abs() < 1e-5
    );
    // In a wall, and in a corner.
    for position in [Vec3::new(0.0, 1.0, 0.0), Vec3::ONE, Vec3::new(0.0, 1.0 - 1e-6, 0.0)] {
        assert_finite(&bright(point_light(position, 1e20)));
    }
    // Four suns, each representable, whose sum overflows.
    let floor = geometry(diffuse(), |builder| square(builder, 5.0, 0.0, true));
    let scene = scene(floor, &[const { f32::MAX }; 4].map(|lux| sun(Vec3::NEG_Y, lux)), Sky::Black);
    let rendering = picture(
        &scene,
        &view(Vec3::Y, Vec3::ZERO, 2, 2),
        &Settings { samples: 8, ..lambertian(Some(0)) },
    );
    assert_eq!((rendering.dropped, rendering.direct.mean()), (32, 0.0));
}
