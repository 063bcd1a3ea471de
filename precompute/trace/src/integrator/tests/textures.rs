//! Materials by texture: each equals the material without one that has the texel's value.

use std::f64::consts::PI;

use glam::{Affine2, Vec2};

use super::extended::{STRATEGIES, corner_form_factor};
use super::*;
use crate::scene::{SceneMesh, TextureUse};

const BLACK: [u8; 4] = [0, 0, 0, 255];
const WHITE: [u8; 4] = [255; 4];

/// A floor of side 2 around the origin: u grows along x and v along z, from 0 to 1.
fn floor() -> SceneMesh {
    let mut builder = MeshBuilder::new();
    builder.sheet(1, 1, |s, t| Vec3::new(2.0 * s - 1.0, 0.0, 1.0 - 2.0 * t));
    builder.finish(0)
}

fn textured(mesh: SceneMesh, material: SceneMaterial, texture: SceneTexture) -> SceneGeometry {
    SceneGeometry { meshes: vec![mesh], materials: vec![material], textures: vec![texture] }
}

/// Radiance at x along the floor's middle, as a share of white's, under a sun of 1 lux straight
/// above, seen from straight above.
fn brightness(geometry: &SceneGeometry, shading: Shading, x: f64) -> f64 {
    let scene = scene(geometry.clone(), &[sun(Vec3::NEG_Y, 1.0)], Sky::Black);
    let settings = Settings { shading, ..lambertian(Some(0)) };
    measure(&scene, &settings, 2, down(x, 1.0, 0.01)).0.mean * PI
}

fn base_color(read: TextureUse) -> SceneMaterial {
    SceneMaterial { base_color_texture: Some(read), ..diffuse() }
}

#[test]
fn a_transform_moves_scales_and_turns_the_texture() {
    // Black on the left, white on the right.
    let at = |transform: Affine2, x: f64| {
        let read = TextureUse { transform, ..TextureUse::plain(0) };
        let geometry = textured(floor(), base_color(read), row_texture(&[BLACK, WHITE]));
        brightness(&geometry, Shading::Lambertian, x)
    };
    let along = [-0.9, -0.6, -0.4, -0.1, 0.1, 0.4, 0.6, 0.9];
    let found = |transform| along.map(|x| at(transform, x).round() as u8);
    assert_eq!(found(Affine2::IDENTITY), [0, 0, 0, 0, 1, 1, 1, 1]);
    assert_eq!(found(Affine2::from_translation(Vec2::X * 0.5)), [1, 1, 1, 1, 0, 0, 0, 0]);
    assert_eq!(found(Affine2::from_scale(Vec2::splat(2.0))), [0, 0, 1, 1, 0, 0, 1, 1]);
    let half_turn =
        Affine2::from_scale_angle_translation(Vec2::ONE, std::f32::consts::PI, Vec2::new(1.0, 1.0));
    assert_eq!(found(half_turn), [1, 1, 1, 1, 0, 0, 0, 0]);
    assert!((at(Affine2::IDENTITY, 0.5) - 1.0).abs() < 1e-6);
}

#[test]
fn a_texture_reads_the_coordinates_that_it_names() {
    let second = TextureUse { second_uvs: true, ..TextureUse::plain(0) };
    // The first coordinates are of the black texel, the second of the white one.
    let mut mesh = floor();
    let count = mesh.positions.len();
    mesh.uvs = vec![Vec2::new(0.25, 0.5); count];
    mesh.second_uvs = vec![Vec2::new(0.75, 0.5); count];
    let read = |mesh: &SceneMesh, read| {
        let geometry = textured(mesh.clone(), base_color(read), row_texture(&[BLACK, WHITE]));
        brightness(&geometry, Shading::Lambertian, 0.3).round()
    };
    assert_eq!((read(&mesh, TextureUse::plain(0)), read(&mesh, second)), (0.0, 1.0));
    // As in Bevy: without second coordinates the first, without any no texture.
    mesh.second_uvs.clear();
    assert_eq!(read(&mesh, second), 0.0);
    mesh.uvs.clear();
    assert_eq!(read(&mesh, second), 1.0);
}

#[test]
fn vertex_colors_and_texture_multiply() {
    let mut mesh = floor();
    let texture = || row_texture(&[[51, 51, 51, 255]]);
    let at = |mesh: &SceneMesh| {
        let geometry = textured(mesh.clone(), base_color(TextureUse::plain(0)), texture());
        brightness(&geometry, Shading::Lambertian, 0.3)
    };
    assert!((at(&mesh) - 0.2).abs() < 1e-6);
    mesh.colors = vec![[0.5; 4]; mesh.positions.len()];
    assert!((at(&mesh) - 0.1).abs() < 1e-6);
    mesh.colors.clear();
    assert!((at(&mesh) - 0.2).abs() < 1e-6);
}

#[test]
fn metallic_is_the_blue_of_its_texture_and_roughness_the_green() {
    let plain = |metallic: f32, perceptual_roughness: f32| SceneMaterial {
        metallic,
        perceptual_roughness,
        base_color: [0.8; 4],
        ..SceneMaterial::default()
    };
    for texel in [[255, 255, 0, 255], [0, 102, 255, 255], [9, 51, 153, 0]] {
        let [_, green, blue, _] = texel.map(|value| f32::from(value) / 255.0);
        for shading in [Shading::Lambertian, Shading::Standard] {
            let by_texture = SceneMaterial {
                metallic_roughness_texture: Some(TextureUse::plain(0)),
                ..plain(1.0, 1.0)
            };
            let found = textured(floor(), by_texture, row_texture(&[texel]));
            let expected = textured(floor(), plain(blue, green), row_texture(&[texel]));
            let (found, expected) =
                (brightness(&found, shading, 0.2), brightness(&expected, shading, 0.2));
            assert!((found - expected).abs() < 1e-5 * (1.0 + expected), "{found} {expected}");
        }
    }
}

#[test]
fn a_texture_of_emission_shines_where_its_texels_do() {
    // A panel 1.5 m above the floor, of which the texture lights one quarter.
    let quarter = [WHITE, BLACK, BLACK, BLACK];
    let mut panel = SceneGeometry {
        materials: vec![SceneMaterial {
            emissive_texture: Some(TextureUse::plain(0)),
            double_sided: true,
            ..emissive(500.0)
        }],
        textures: vec![SceneTexture { width: 2, height: 2, ..row_texture(&quarter) }],
        ..SceneGeometry::default()
    };
    let mut builder = MeshBuilder::new();
    builder.sheet(1, 1, |s, t| Vec3::new(2.0 * s - 1.0, 1.5, 1.0 - 2.0 * t));
    panel.meshes.push(builder.finish(0));
    let mut ground = geometry(diffuse(), |builder| square(builder, 20.0, 0.0, true));
    ground.meshes[0].material = 1;
    panel.meshes.append(&mut ground.meshes);
    panel.materials.append(&mut ground.materials);
    let scene = scene(panel, &[], Sky::Black);
    for strategy in STRATEGIES {
        let settings = Settings { strategy, ..lambertian(Some(0)) };
        // The lit quarter has a corner above the middle.
        let (direct, _) = measure(&scene, &settings, 40_000, down(0.0, 1.0, 0.0));
        direct.assert(500.0 * corner_form_factor(1.0, 1.0, 1.5), 0.0);
        assert!(direct.error < 0.05 * direct.mean, "{strategy:?}: {direct:?}");
        let up = |_: [f64; 2]| (DVec3::new(-0.5, 1.0, -0.5), DVec3::Y);
        assert_eq!(measure(&scene, &settings, 2, up).0.mean, 500.0);
        let up = |_: [f64; 2]| (DVec3::new(0.5, 1.0, -0.5), DVec3::Y);
        assert!(measure(&scene, &settings, 2, up).0.mean < 1.0);
    }
}

#[test]
fn a_spot_that_the_power_estimate_misses_shines_all_the_same() {
    // One texel of 40 × 40, between the points of the estimate.
    let mut texels = vec![BLACK; 1600];
    texels[40 + 1] = WHITE;
    let texture = SceneTexture { width: 40, height: 40, ..row_texture(&texels) };
    let material = SceneMaterial {
        emissive_texture: Some(TextureUse::plain(0)),
        double_sided: true,
        ..emissive(1e5)
    };
    let mut panel = textured(floor(), material, texture);
    let mut ground = geometry(diffuse(), |builder| square(builder, 20.0, -0.5, true));
    ground.meshes[0].material = 1;
    panel.meshes.append(&mut ground.meshes);
    panel.materials.append(&mut ground.materials);
    let scene = scene(panel, &[], Sky::Black);
    let found = STRATEGIES.map(|strategy| {
        let settings = Settings { strategy, ..lambertian(Some(0)) };
        measure(&scene, &settings, 60_000, down(-0.925, -0.2, -0.925)).0
    });
    // 0.05 m × 0.05 m at 0.5 m, almost straight above.
    for measured in &found {
        measured.assert(1e5 / PI * (0.05 * 0.05) / 0.25, 0.05);
        assert!(measured.mean > 0.0);
    }
    found[0].assert_agrees(&found[2]);
}

#[test]
fn a_scene_is_the_same_after_being_sent() {
    let sent = textured(floor(), base_color(TextureUse::plain(0)), row_texture(&[BLACK, WHITE]));
    let text = serde_json::to_string(&sent).expect("plain data");
    assert_eq!(serde_json::from_str::<SceneGeometry>(&text).expect("what was sent"), sent);
}
