//! Guided images have the mean of unguided ones, and less noise where most light is indirect.

use super::super::gain::gain;
use super::super::learn::{KINDS, Kind, learn};
use super::super::photons::Emission;
use super::*;
use crate::guide::{Field, Photon};
use crate::scene::SkyMap;

/// A closed room with a block.
fn room(lights: &[Light], sky: Sky) -> ReferenceScene {
    let walls =
        geometry(SceneMaterial { perceptual_roughness: 0.6, ..SceneMaterial::default() }, |b| {
            b.tint([0.7, 0.6, 0.5]).room(Vec3::ZERO, Vec3::new(4.0, 2.5, 4.0));
            b.cuboid(Vec3::new(2.0, 0.0, 1.0), Vec3::new(2.8, 1.2, 1.8));
        });
    scene(walls, lights, sky)
}

/// A spot at the ceiling, behind the camera.
fn spot() -> Light {
    Light::Spot {
        position: Vec3::new(0.6, 0.5, 3.5),
        direction: Vec3::Y,
        luminous_power: 1e5,
        range: 30.0,
        inner_angle: 4.0,
        outer_angle: 5.0,
        color: [1.0, 0.9, 0.8],
    }
}

fn corner() -> View {
    view(Vec3::new(0.5, 1.6, 3.2), Vec3::new(2.5, 0.8, 0.5), 8, 6)
}

/// Paths through the image's pixels in turn, guided by `field`: the light of each of 12 tiles.
fn tiles(
    scene: &ReferenceScene,
    settings: &Settings,
    field: Option<&Field>,
    count: u64,
) -> Vec<Measured> {
    let view = corner();
    (0..12)
        .map(|tile| {
            let values: Vec<f64> = (0..count)
                .map(|i| {
                    let mut sampler = Sampler::new(settings.seed, tile * count + i, 0);
                    let [u, v] = sampler.pair();
                    let x = 2.0 * ((tile % 4) as f64 + u);
                    let y = 2.0 * ((tile / 4) as f64 + v);
                    let (origin, direction) = view.ray(x, y);
                    let light = trace(scene, settings, field, origin, direction, &mut sampler);
                    (light.direct + light.indirect).element_sum()
                })
                .collect();
            Measured::of(values.iter().copied())
        })
        .collect()
}

/// All tiles agree within four standard errors; there are 12 of them, and a few scenes.
#[track_caller]
fn assert_same_means(scene: &ReferenceScene, settings: &Settings, field: Option<&Field>) {
    let unguided = tiles(scene, settings, None, 12_000);
    let guided = tiles(scene, &Settings { seed: 1, ..*settings }, field, 12_000);
    for (one, other) in unguided.iter().zip(&guided) {
        one.assert_agrees(other);
    }
    let total = |tiles: &[Measured]| Measured {
        mean: tiles.iter().map(|tile| tile.mean).sum::<f64>(),
        error: tiles.iter().map(|tile| tile.error.powi(2)).sum::<f64>().sqrt(),
    };
    total(&unguided).assert_agrees(&total(&guided));
}

fn learned(scene: &ReferenceScene, settings: &Settings, kinds: &[Kind]) -> Option<Field> {
    learn(scene, &corner(), &Settings { samples: 4096, ..*settings }, kinds, &|| false)
        .expect("nothing interrupts")
}

#[test]
fn guided_paths_have_the_unguided_mean() {
    let lamp = || {
        let lamp = geometry(emissive(3000.0), |b| {
            b.cuboid(Vec3::new(0.5, 2.0, 3.0), Vec3::new(0.7, 2.1, 3.2));
        });
        let walls =
            geometry(diffuse(), |b| b.tint([0.7; 3]).room(Vec3::ZERO, Vec3::new(4.0, 2.5, 4.0)));
        scene(joined(walls, lamp), &[], Sky::Black)
    };
    let map = SkyMap::new(8, 4, (0..32).map(|i| [(i * i) as f32; 3]).collect()).expect("a sky");
    let open = |sky| {
        let floor = geometry(diffuse(), |b| {
            b.tint([0.6; 3]).cuboid(Vec3::new(-3.0, -0.1, -3.0), Vec3::new(5.0, 0.0, 5.0));
            b.cuboid(Vec3::new(2.0, 0.0, 1.0), Vec3::new(2.8, 1.2, 1.8));
        });
        scene(floor, &[sun(Vec3::new(-0.3, -1.0, 0.2), 100.0)], sky)
    };
    let unlimited = Settings { samples: 1, ..Settings::default() };
    for (name, scene, settings) in [
        ("spot", room(&[spot()], Sky::Black), unlimited),
        ("two bounces", room(&[spot()], Sky::Black), Settings { bounces: Some(2), ..unlimited }),
        ("lamp", lamp(), unlimited),
        ("scattering", lamp(), Settings { strategy: Strategy::Scattering, ..unlimited }),
        ("constant sky", open(Sky::Constant(DVec3::splat(30.0))), unlimited),
        ("sky map", open(Sky::map(map, 1.0)), unlimited),
    ] {
        for kind in KINDS {
            let Some(field) = learned(&scene, &settings, &[kind]) else {
                println!("{name}: nothing to learn");
                continue;
            };
            assert_same_means(&scene, &settings, Some(&field));
        }
    }
}

/// Light that is said to come from around `source`, everywhere in a room.
fn lies(source: Vec3) -> [Field; 2] {
    let mut photons = Vec::new();
    for i in 0..60_000 {
        let axis = Vec3::AXES[i % 3] * if i % 2 == 0 { 1.0 } else { -1.0 };
        let spread = Vec3::new((i % 7) as f32, (i % 11) as f32, (i % 13) as f32) * 0.02;
        let place = Vec3::new((i % 40) as f32, (i % 25) as f32, (i % 39) as f32) * 0.1;
        photons.push(Photon { position: place, normal: axis, source: source + spread, power: 1.0 });
    }
    let fields = KINDS.map(|learn| learn(&mut photons));
    let floor = DVec3::new(3.0, 0.1, 3.0);
    assert!(fields.iter().all(|field| field.aims(floor, DVec3::Y).is_some()));
    fields
}

#[test]
fn wrong_guides_change_neither_mean_nor_noise() {
    let scene = room(&[point_light(Vec3::new(1.0, 1.5, 2.5), 1000.0)], Sky::Black);
    let noise = |settings: &Settings, field: Option<&Field>| -> f64 {
        tiles(&scene, settings, field, 12_000).iter().map(|tile| tile.error.powi(2)).sum()
    };
    for bounces in [Some(2), None] {
        let settings = Settings { samples: 1, bounces, ..Settings::default() };
        let unguided = noise(&settings, None);
        // From a corner, from inside a block, from below, and from nowhere.
        for source in [Vec3::ZERO, Vec3::new(2.4, 0.6, 1.4), Vec3::NEG_Y * 9.0, Vec3::splat(1e30)] {
            for field in lies(source) {
                assert_same_means(&scene, &settings, Some(&field));
                let guided = noise(&settings, Some(&field));
                assert!(guided < 1.2 * unguided, "{guided}, not {unguided}, from {source}");
            }
        }
    }
}

#[test]
fn gains_are_foretold() {
    let settings = Settings { samples: 4096, ..Settings::default() };
    let spotlit = room(&[spot()], Sky::Black);
    let told = |scene: &ReferenceScene, field: &Field| gain(scene, &corner(), &settings, field);
    let good = told(&spotlit, &learned(&spotlit, &settings, &KINDS).expect("light"));
    assert!(good > 4.0, "{good}");
    // A wrong guide costs time; and an even sky is found without one.
    let lit = room(&[point_light(Vec3::new(1.0, 1.5, 2.5), 1000.0)], Sky::Black);
    for field in lies(Vec3::ZERO) {
        let bad = told(&lit, &field);
        assert!(bad < 1.0, "{bad}");
    }
    let floor = geometry(diffuse(), |b| {
        b.tint([0.6; 3]).cuboid(Vec3::new(-3.0, -0.1, -3.0), Vec3::new(5.0, 0.0, 5.0));
    });
    let open = scene(floor, &[sun(Vec3::NEG_Y, 100.0)], Sky::Constant(DVec3::splat(30.0)));
    for kind in KINDS {
        assert!(learned(&open, &settings, &[kind]).is_none(), "an open field pays no guide");
    }
}

#[test]
fn spots_are_told_from_light_round_a_corner() {
    let settings = Settings { samples: 1, ..Settings::default() };
    let spotlit = learned(&room(&[spot()], Sky::Black), &settings, &KINDS);
    assert!(matches!(spotlit, Some(Field::Spheres(_))));
    // A corridor with its mouth at the far end, behind which a light stands to the side.
    let walls = geometry(diffuse(), |b| {
        b.tint([0.6; 3]).room(Vec3::new(0.0, 0.0, -6.0), Vec3::new(8.0, 2.5, 4.0));
        b.cuboid(Vec3::new(3.0, 0.0, -4.0), Vec3::new(8.0, 2.5, 4.0));
    });
    let scene = scene(walls, &[point_light(Vec3::new(7.0, 2.0, -5.0), 4000.0)], Sky::Black);
    let round = learned(&scene, &settings, &KINDS);
    assert!(matches!(round, Some(Field::Histograms(_))));
}

#[test]
fn a_room_lit_by_a_spot_has_a_fraction_of_the_noise() {
    let scene = room(&[spot()], Sky::Black);
    let settings = Settings { samples: 1, ..Settings::default() };
    let noise = |field: Option<&Field>| -> f64 {
        tiles(&scene, &settings, field, 12_000).iter().map(|tile| tile.error.powi(2)).sum()
    };
    let unguided = noise(None);
    for kind in KINDS {
        let field = learned(&scene, &settings, &[kind]).expect("light");
        let gain = unguided / noise(Some(&field));
        assert!(gain > 4.0, "{gain}");
    }
}

#[test]
fn guided_images_depend_on_the_seed_and_not_on_threads() {
    let scene = room(&[spot()], Sky::Black);
    let settings = Settings { samples: 4, guide: Guide::Photons, ..Settings::default() };
    let with_threads = |count: usize, seed: u64| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(count).build().expect("threads");
        pool.install(|| picture(&scene, &corner(), &Settings { seed, ..settings }))
    };
    let alone = with_threads(1, 0);
    assert_eq!(alone, with_threads(3, 0));
    assert_ne!(alone, with_threads(1, 1));
    assert!(alone.dropped == 0 && alone.indirect.mean() > 0.0);
    let stop = Watch { row_done: &|| (), interrupted: &|| true };
    assert!(render(&scene, &corner(), &settings, stop).is_none());
}

#[test]
fn scenes_without_light_or_surfaces_teach_nothing() {
    let settings = Settings { samples: 2, guide: Guide::Photons, ..Settings::default() };
    let empty = scene(SceneGeometry::default(), &[spot()], Sky::Constant(DVec3::splat(5.0)));
    assert!(learned(&empty, &settings, &KINDS).is_none());
    assert!(
        picture(&empty, &corner(), &settings).direct.rgb.iter().all(|pixel| *pixel == [5.0; 3])
    );
    let dark = room(&[], Sky::Black);
    assert!(learned(&dark, &settings, &KINDS).is_none());
    assert_eq!(picture(&dark, &corner(), &settings).full().mean(), 0.0);
}

#[test]
fn extreme_scenes_stay_finite() {
    let settings = Settings { samples: 2, guide: Guide::Photons, ..Settings::default() };
    // A light that overflows, one in a wall, triangles without area or with corners that are NaN.
    let mut builder = MeshBuilder::new();
    builder.tint([0.7; 3]).room(Vec3::ZERO, Vec3::new(4.0, 2.5, 4.0));
    for corners in [[Vec3::ONE; 3], [Vec3::NAN, Vec3::X, Vec3::Y], [Vec3::MAX, Vec3::MIN, Vec3::Y]]
    {
        let [a, b, c] = corners.map(|corner| builder.vertex(corner, Vec3::Z, glam::Vec2::NAN));
        builder.triangle(a, b, c);
    }
    let broken = SceneGeometry {
        meshes: vec![builder.finish(0)],
        materials: vec![SceneMaterial::default()],
        ..SceneGeometry::default()
    };
    for light in [
        point_light(Vec3::new(1.0, 1.0, 1.0), 100.0),
        point_light(Vec3::new(1.0, 2.5, 1.0), 1e20),
        sun(Vec3::NEG_Y, f32::MAX),
    ] {
        let scene = scene(broken.clone(), &[light], Sky::Black);
        let rendering = picture(&scene, &corner(), &settings);
        let finite = |rgb: &[f32; 3]| rgb.iter().all(|value| value.is_finite() && *value >= 0.0);
        assert!(rendering.full().rgb.iter().all(finite));
    }
}

#[test]
fn photons_carry_the_light_s_power() {
    // A point light in a black room: all its lumens arrive; those are found without a guide. With a
    // diffuse albedo ρ, walls that see one another receive ρ of it again, then ρ², …
    let albedo = 0.5;
    let material = SceneMaterial { base_color: [albedo, albedo, albedo, 1.0], ..diffuse() };
    let walls = geometry(material, |b| b.room(Vec3::ZERO, Vec3::new(4.0, 2.5, 4.0)));
    let scene = scene(walls, &[point_light(Vec3::new(2.0, 1.0, 1.0), 100.0)], Sky::Black);
    let settings = lambertian(None);
    let emission = Emission::new(&scene, &settings).expect("light");
    let count = 40_000;
    let mut power = 0.0;
    for i in 0..count {
        let mut sampler = Sampler::new(3, i, 0);
        let start = std::array::from_fn(|_| sampler.number());
        emission.trace(&start, &mut sampler, |photon, is_sampled| {
            power += if is_sampled { 0.0 } else { f64::from(photon.power) };
        });
    }
    // The range's window takes next to nothing.
    let measured = power / count as f64;
    let exact = 100.0 * f64::from(albedo / (1.0 - albedo));
    assert!((measured / exact - 1.0).abs() < 0.03, "{measured} lm, not {exact}");
}
