//! Occlusion: sides, cut-outs, seams.

use std::f64::consts::PI;

use super::*;
use crate::scene::{AlphaMode, TextureUse};

/// The lit floor's radiance under a sun of 1000 lux straight above.
const LIT: f64 = 1000.0 / PI;

fn double_sided(material: SceneMaterial) -> SceneMaterial {
    SceneMaterial { double_sided: true, ..material }
}

#[test]
fn a_cut_out_lets_paths_and_light_through() {
    // Alpha comes from texture, vertex and material: the right half, all, and all of the cloth are
    // cut out.
    let texture = row_texture(&[[255; 4], [255, 255, 255, 0]]);
    for (vertex_alpha, material_alpha, is_left_there) in
        [(1.0, 1.0, true), (0.4, 1.0, false), (1.0, 0.4, false)]
    {
        let mut builder = MeshBuilder::new();
        builder.sheet(1, 1, |s, t| Vec3::new(2.0 * s - 1.0, 1.0, 1.0 - 2.0 * t));
        let mut cloth = builder.finish(0);
        cloth.colors.iter_mut().for_each(|color| color[3] = vertex_alpha);
        let mut floor = MeshBuilder::new();
        square(&mut floor, 5.0, 0.0, true);
        let material = SceneMaterial {
            base_color: [0.0, 0.0, 0.0, material_alpha],
            alpha: AlphaMode::Mask(0.5),
            base_color_texture: Some(TextureUse::plain(0)),
            ..double_sided(diffuse())
        };
        let geometry = SceneGeometry {
            meshes: vec![cloth, floor.finish(1)],
            materials: vec![material, diffuse()],
            textures: vec![texture.clone()],
        };
        let scene = scene(
            geometry,
            &[sun(Vec3::NEG_Y, 1000.0), point_light(Vec3::new(-0.5, 2.0, 0.0), 0.0)],
            Sky::Black,
        );
        let settings = lambertian(Some(0));
        for (x, is_there) in [(-0.5, is_left_there), (0.5, false)] {
            let beneath = measure(&scene, &settings, 2, down(x, 0.5, 0.1)).0;
            beneath.assert(if is_there { 0.0 } else { LIT }, 0.0);
            // From above the black cloth is visible, or the floor through it.
            let above = measure(&scene, &settings, 2, down(x, 3.0, 0.1)).0;
            above.assert(if is_there { 0.0 } else { LIT }, 0.0);
        }
    }
}

#[test]
fn backs_of_single_sided_sheets_are_culled() {
    let settings = lambertian(Some(0));
    let sky = || Sky::Constant(DVec3::splat(7.0));
    let sheet =
        |material: SceneMaterial| geometry(material, |builder| square(builder, 1.0, 1.0, true));
    let up = |_: [f64; 2]| (DVec3::new(0.1, 0.5, 0.2), DVec3::Y);
    // A camera below a sheet that faces up sees the sky through it; a double-sided sheet is lit
    // from below.
    measure(&scene(sheet(diffuse()), &[], sky()), &settings, 2, up).0.assert(7.0, 0.0);
    let light_below = [sun(Vec3::Y, 1000.0)];
    measure(&scene(sheet(diffuse()), &light_below, sky()), &settings, 2, up).0.assert(7.0, 0.0);
    measure(&scene(sheet(double_sided(diffuse())), &light_below, Sky::Black), &settings, 2, up)
        .0
        .assert(LIT, 0.0);

    // As in shadow maps: a face that is turned away from the sun casts no shadow.
    for (faces_up, is_double_sided, expected) in
        [(true, false, 0.0), (false, false, LIT), (true, true, 0.0), (false, true, 0.0)]
    {
        let material = if is_double_sided { double_sided(diffuse()) } else { diffuse() };
        let roof = geometry(material, |builder| square(builder, 1.0, 1.0, faces_up));
        let floor = geometry(diffuse(), |builder| square(builder, 5.0, 0.0, true));
        let scene = scene(joined(roof, floor), &[sun(Vec3::NEG_Y, 1000.0)], Sky::Black);
        measure(&scene, &settings, 2, down(0.1, 0.5, 0.2)).0.assert(expected, 0.0);
    }
}

#[test]
fn solids_hide_light_and_lit_sides_are_lit() {
    let blocks = geometry(diffuse(), |builder| {
        square(builder, 9.0, 0.0, true);
        builder.cuboid(Vec3::new(-1.0, 1.0, -1.0), Vec3::new(1.0, 2.0, 1.0));
    });
    let lights = [
        sun(Vec3::NEG_Y, 1000.0),
        point_light(Vec3::new(0.0, 3.0, 0.0), 400.0 * std::f32::consts::PI),
    ];
    let scene = scene(blocks, &lights, Sky::Black);
    let settings = lambertian(Some(0));
    measure(&scene, &settings, 2, down(0.2, 0.5, 0.3)).0.assert(0.0, 0.0);
    // On the block: a point light of 100 candela a metre above.
    measure(&scene, &settings, 2, down(0.0, 2.5, 0.0)).0.assert(LIT + 100.0 / PI, 1e-5);
    // The sun alone, where the block occludes the point light; then both.
    measure(&scene, &settings, 2, down(1.4, 2.5, 0.0)).0.assert(LIT, 0.0);
    let far: f64 = 3.0_f64.powi(2) + 16.0;
    measure(&scene, &settings, 2, down(4.0, 2.5, 0.0))
        .0
        .assert(LIT + 100.0 / PI * 3.0 / far.powf(1.5), 1e-5);
}

#[test]
fn no_light_leaks_into_a_closed_box_with_bent_normals() {
    // A sphere of twenty triangles, lit from all around, whose interpolated normals deviate from
    // its facets by up to 37°.
    for twist in [0.0, 1.0] {
        let mut ball = geometry(double_sided(diffuse()), |builder| {
            builder.icosphere(Vec3::ZERO, 1.0, 0, true);
        });
        for (i, normal) in ball.meshes[0].normals.iter_mut().enumerate() {
            *normal =
                (*normal + Vec3::new((i as f32).sin(), (i as f32).cos(), 0.5) * twist).normalize();
        }
        let shell =
            geometry(emissive(1000.0), |builder| builder.icosphere(Vec3::ZERO, 5.0, 1, true));
        let lights = [
            sun(Vec3::new(0.3, -1.0, 0.2), 1e5),
            sun(Vec3::X, 1e5),
            point_light(Vec3::new(0.0, 2.0, 0.0), 1e6),
        ];
        let scene = scene(joined(ball, shell), &lights, Sky::Constant(DVec3::splat(100.0)));
        let settings = Settings { bounces: Some(4), ..Settings::default() };
        let around = |[u1, u2]: [f64; 2]| {
            (DVec3::new(0.1, -0.2, 0.1), DVec3::new(u1 - 0.5, u2 - 0.5, u1 * u2 - 0.3))
        };
        let found = estimates(&scene, &settings, 4000, around);
        assert!(found.iter().all(|one| *one == Estimate::default()), "light leaked in");
    }
}
