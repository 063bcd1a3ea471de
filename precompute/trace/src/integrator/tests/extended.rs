//! Lights with extent: form factors in closed form, and agreement of the sampling strategies.

use std::f64::consts::PI;

use super::*;
use crate::scene::{AlphaMode, SkyMap, TextureUse};

pub(super) const STRATEGIES: [Strategy; 3] =
    [Strategy::Combined, Strategy::Lights, Strategy::Scattering];

/// Form factor from a differential patch to a parallel rectangle of `a` × `b` at distance `c` with
/// a corner above it (Howell, "A Catalog of Radiation Heat Transfer Configuration Factors", B-3).
pub(super) fn corner_form_factor(a: f64, b: f64, c: f64) -> f64 {
    let (x, y) = (a / c, b / c);
    let (along, across) = (1.0_f64.hypot(x), 1.0_f64.hypot(y));
    (x / along * (y / along).atan() + y / across * (x / across).atan()) / (2.0 * PI)
}

/// Form factor between equal, parallel, opposite squares with the side `ratio` times their distance
/// (Howell, C-11).
fn opposite_squares(ratio: f64) -> f64 {
    let squared = 1.0 + ratio * ratio;
    let logarithm = (squared * squared / (1.0 + 2.0 * ratio * ratio)).sqrt().ln();
    let angle =
        2.0 * ratio * squared.sqrt() * (ratio / squared.sqrt()).atan() - 2.0 * ratio * ratio.atan();
    2.0 / (PI * ratio * ratio) * (logarithm + angle)
}

#[test]
fn a_floor_under_an_emissive_square_has_its_form_factor() {
    let albedo = 0.7;
    for strategy in STRATEGIES {
        let floor =
            geometry(diffuse(), |builder| square(builder.tint([albedo; 3]), 20.0, 0.0, true));
        let square_above = geometry(emissive(500.0), |builder| square(builder, 1.0, 1.5, false));
        let scene = scene(joined(floor, square_above), &[], Sky::Black);
        let settings = Settings { strategy, ..lambertian(Some(0)) };
        for (x, factor) in [
            (0.0, 4.0 * corner_form_factor(1.0, 1.0, 1.5)),
            // Beside the square: a wider rectangle minus a narrower one.
            (3.0, 2.0 * (corner_form_factor(4.0, 1.0, 1.5) - corner_form_factor(2.0, 1.0, 1.5))),
        ] {
            let (direct, indirect) = measure(&scene, &settings, 20_000, down(x, 1.0, 0.0));
            direct.assert(f64::from(albedo) * 500.0 * factor, 0.0);
            assert!(
                direct.error < 0.05 * direct.mean && indirect.mean == 0.0,
                "{strategy:?} at {x}: {direct:?}"
            );
        }
        // Emissive from below, culled from above.
        assert_eq!(
            measure(&scene, &settings, 2, |_| (DVec3::new(0.1, 1.0, 0.2), DVec3::Y)).0.mean,
            500.0
        );
        assert!(measure(&scene, &settings, 2, down(0.0, 9.0, 0.0)).0.mean < 400.0);
    }
}

#[test]
fn one_bounce_between_plates_has_their_form_factor() {
    // The sun shines up on the front of the upper plate; the lower plate's back casts no shadow.
    let (lower, upper) = (0.5, 0.9);
    let plates = geometry(diffuse(), |builder| {
        square(builder.tint([lower; 3]), 1.0, 0.0, true);
        square(builder.tint([upper; 3]), 1.0, 2.0, false);
    });
    let scene = scene(plates, &[sun(Vec3::Y, 1000.0)], Sky::Black);
    let all_over =
        |[u1, u2]: [f64; 2]| (DVec3::new(2.0 * u1 - 1.0, 1.0, 2.0 * u2 - 1.0), DVec3::NEG_Y);
    let (direct, indirect) = measure(&scene, &lambertian(Some(1)), 40_000, all_over);
    let (lower, upper) = (f64::from(lower), f64::from(upper));
    let once = lower * upper * 1000.0 / PI * opposite_squares(1.0);
    assert!((opposite_squares(1.0) - 0.199_825).abs() < 1e-6);
    assert_eq!(direct.mean, 0.0);
    indirect.assert(once, 0.0);
    assert!(indirect.error < 0.02 * once);
    // A second bounce would end on the lower plate, which receives no direct light. A third goes up
    // and down once more, and the upper plate is slightly brighter in the middle: only a bound is
    // known.
    let (_, two) = measure(&scene, &lambertian(Some(2)), 40_000, all_over);
    two.assert_agrees(&indirect);
    let (_, three) = measure(&scene, &lambertian(Some(3)), 40_000, all_over);
    let added = three.mean - once;
    assert!(
        added > 0.0 && added < once * lower * upper * 4.0 * corner_form_factor(1.0, 1.0, 2.0),
        "{added} after {once}"
    );
}

#[test]
fn strategies_agree_on_a_glossy_floor() {
    let glossy = SceneMaterial {
        perceptual_roughness: 0.45,
        metallic: 0.5,
        base_color: [0.8, 0.6, 0.4, 1.0],
        ..SceneMaterial::default()
    };
    for (half, nits) in [(0.05, 1e6), (1.0, 1e3)] {
        let floor = geometry(glossy.clone(), |builder| square(builder, 20.0, 0.0, true));
        // In the mirror direction of the view.
        let light = geometry(emissive(nits), |builder| {
            let (center, along) =
                (Vec3::new(1.8, 1.5, 0.0), Vec3::new(1.5, -1.8, 0.0).normalize() * half);
            let across = Vec3::Z * half;
            builder.quad([
                center - along - across,
                center + along - across,
                center + along + across,
                center - along + across,
            ]);
        });
        let scene = scene(joined(floor, light), &[], Sky::Black);
        let found = STRATEGIES.map(|strategy| {
            let settings = Settings { bounces: Some(0), strategy, ..Settings::default() };
            measure(&scene, &settings, 30_000, |_| {
                (DVec3::new(-1.2, 1.0, 0.0), DVec3::new(1.2, -1.0, 0.0))
            })
            .0
        });
        assert!(found.iter().all(|one| one.mean > 0.0), "{found:?}");
        found[0].assert_agrees(&found[1]);
        found[0].assert_agrees(&found[2]);
        assert!(found[0].error < found[1].error.max(found[2].error), "{found:?}");
        assert!(found[0].error < 0.02 * found[0].mean, "{found:?}");
    }
}

#[test]
fn strategies_agree_on_a_sky_with_a_sun_in_it() {
    let mut texels = vec![[0.2, 0.3, 0.5]; 32 * 16];
    texels[4 * 32 + 20] = [400.0, 390.0, 380.0];
    let glossy = SceneMaterial { perceptual_roughness: 0.6, ..SceneMaterial::default() };
    let floor = geometry(glossy, |builder| {
        square(builder, 20.0, 0.0, true);
        builder.cuboid(Vec3::new(-1.5, 0.0, -1.0), Vec3::new(-0.5, 1.0, 0.0));
    });
    let scene = scene(floor, &[], Sky::map(SkyMap::new(32, 16, texels).expect("a sky"), 50.0));
    let found = STRATEGIES.map(|strategy| {
        let settings = Settings { bounces: Some(1), strategy, ..Settings::default() };
        measure(&scene, &settings, 30_000, |_| {
            (DVec3::new(-1.0, 1.0, 1.0), DVec3::new(1.0, -1.0, -0.8))
        })
    });
    for other in &found[1..] {
        found[0].0.assert_agrees(&other.0);
        found[0].1.assert_agrees(&other.1);
    }
    assert!(found[0].0.error < found[2].0.error, "{found:?}");
}

#[test]
fn a_cut_out_emitter_emits_only_where_it_is_opaque() {
    // Left half opaque, right half cut out; all strategies must leave out the same half.
    let mut cloth = SceneGeometry {
        textures: vec![row_texture(&[[255; 4], [255, 255, 255, 0]])],
        materials: vec![SceneMaterial {
            alpha: AlphaMode::Mask(0.5),
            base_color_texture: Some(TextureUse::plain(0)),
            double_sided: true,
            ..emissive(500.0)
        }],
        ..SceneGeometry::default()
    };
    cloth.materials[0].base_color[3] = 1.0;
    let mut builder = MeshBuilder::new();
    builder.sheet(1, 1, |s, t| Vec3::new(2.0 * s - 1.0, 1.5, 2.0 * t - 1.0));
    cloth.meshes.push(builder.finish(0));
    let mut floor = geometry(diffuse(), |builder| square(builder, 20.0, 0.0, true));
    floor.meshes[0].material = 1;
    cloth.meshes.append(&mut floor.meshes);
    cloth.materials.append(&mut floor.materials);
    let scene = scene(cloth, &[], Sky::Black);
    for strategy in STRATEGIES {
        let settings = Settings { strategy, ..lambertian(Some(0)) };
        let (direct, _) = measure(&scene, &settings, 20_000, down(0.0, 1.0, 0.0));
        direct.assert(500.0 * 2.0 * corner_form_factor(1.0, 1.0, 1.5), 0.0);
    }
}
